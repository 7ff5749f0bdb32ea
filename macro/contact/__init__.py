"""Contact of meshed bodies with a rigid plane or each other: by laws of patches, or node by node.

    LawContactProblem           laws of patches on a face                    `law_problem`
      └ LoadedFace, FacePair    patches on the faces of one body, or two     `loaded_face`, …
      └ ContactForces           pressures and shear stresses                 `contact_forces`
        └ PressedPlane          by laws under a plane                        `pressed_plane`
        └ FaceSliders           by sliders, remembered between load steps    `face_sliders`
      └ ContactResponse         first order changes of an equilibrium        `contact_response`
    ContactProblem              laws in a user's own variational problem     `contact_problem`
      └ Interface               laws on a face, as a term of its equations   `interface`
      └ UserEquations           residual and tangent of both                 `equations`
    UnilateralContactProblem    no interference with a rough top           `unilateral_problem`
      └ PrimalDualActiveSet     at its nodes                                 `active_set`
      └ AugmentedLagrangian     at its quadrature points                     `augmented_lagrangian`

Both problems with laws are solved by `newton`; all three give a `face_equilibrium`.
`face_nodes` reads results off a rough top.
"""
