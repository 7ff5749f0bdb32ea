"""Friction on the cells of a rough surface: tangential tractions, stick and slip.

    FrictionModel                  load steps, dissipation, stiffness     `friction_model`
      └ solve_tractions            which cells slip, and where to         `stick_slip`
          └ ContactCells           their tractions           `boundary_elements.inverse`
              ├ FreeInverse        their preconditioner                   `stick_slip`
              └ TangentialGrid     tangential compliance                  `tangential_grid`

They solve a `TractionProblem`. `CrossCompliance` in `tangential_grid` is what Goodman's assumption
neglects for bodies of different elasticity, and `coupled` takes into account.
"""
