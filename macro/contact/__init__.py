"""Contact of meshed bodies with a rigid plane or each other: by laws of patches, or node by node.

    ContactForces               pressures and shear stresses on a face         `contact_forces`
      └ LoadedFace, FacePair    patches on the faces of one body, or two       `loaded_face`, …
      └ PressedPlane            closures under a plane, by laws                `pressed_plane`
      └ FaceSliders             shear by sliders, remembered by load steps     `face_sliders`
    ContactEquations            inner less contact forces, Newton's method     `newton`
      └ FirstSteps              where Newton's method starts                   `initial_guess`
        └ FaceLayer             laws on the body near its face alone           `face_layer`
      └ LawContactProblem       of a linear body with a contact face           `law_problem`
      └ ContactProblem          of a user's own variational problem            `contact_problem`
        └ Interface             contact forces, results, leak of a face        `interface`
    UnilateralContactProblem    no interference with a rough top               `unilateral_problem`
      └ PrimalDualActiveSet     at its nodes
      └ AugmentedLagrangian     at its quadrature points, by a law           `augmented_lagrangian`

All three problems give a `face_equilibrium`. `face_nodes` reads results off a rough top.
"""
