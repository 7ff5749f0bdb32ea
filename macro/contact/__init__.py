"""Contact of a meshed block with a rigid plane: through laws of patches, or node by node.

    LawContactProblem           laws of patches on a flat interface          `law_problem`
      └ Interface               where laws are evaluated                     `law_interface`
      └ Equilibrium, Newton     residual, tangent, plane, PETSc's SNES       `equilibrium`, …
    UnilateralContactProblem    no penetration of a rough top                `unilateral_problem`
      └ PrimalDualActiveSet     at its nodes                                 `active_set`
      └ AugmentedLagrangian     at its quadrature points                     `augmented_lagrangian`

`face_nodes` and `facet_area` read results off the top.
"""
