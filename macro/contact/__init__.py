"""Contact of meshed bodies with a rigid plane or each other: by laws of patches, or node by node.

    LawContactProblem           laws of patches on a face                    `law_problem`
      └ LoadedFace, FacePair    patches on the faces of one body, or two     `loaded_face`, …
      └ ContactForces           laws under a plane                           `contact_forces`
      └ Equilibrium, Newton     residual, tangent, PETSc's SNES              `equilibrium`, …
    UnilateralContactProblem    no penetration of a rough top                `unilateral_problem`
      └ PrimalDualActiveSet     at its nodes                                 `active_set`
      └ AugmentedLagrangian     at its quadrature points                     `augmented_lagrangian`

`face_nodes` and `facet_area` read results off the top.
"""
