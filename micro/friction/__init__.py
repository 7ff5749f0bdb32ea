"""Friction on the cells of a rough surface: tangential tractions, stick and slip.

    FrictionModel                  load steps, dissipation, stiffness     `friction_model`
      └ solve_tractions            which cells slip, and where to         `stick_slip`
          └ ContactCells           their tractions                        `micro.complementarity`
              ├ FreeInverse        their preconditioner                   `free_inverse`
              └ TangentialGrid     tangential compliance                  `tangential_grid`

They solve a `TractionProblem` (`traction_problem`). `goodman` measures what is neglected for bodies
of different elasticity.
"""
