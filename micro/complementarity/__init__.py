"""The contact problem: pressures between bounds, gaps, rigid motions prescribed or free.

    solve_contact                displacements by finite slopes     `slope_iteration`
      └ solve_on_surface         boxes of cells, coarser grids      `solver`
          └ solve                which cells touch                  `active_set`
              └ ContactCells     their pressures                    `boundary_elements.inverse`

The search starts from pressures that meet the loads (`admissible_start`). All of them solve a
`CellProblem` (`cell_problem`): compliance, interference, bounds, and the motions of the body that
are free, with their loads.
"""
