"""The contact problem: pressures between bounds, gaps, rigid motions prescribed or free.

    ContactSolver                which cells can touch, finite slopes     `solver`
      └ SurfaceProblem           boxes of cells, coarser grids to start   `nested_grids`
          └ ContactProblem       compliance, interference, bounds, loads  `problem`
              └ ActiveSet        which cells touch                        `active_set`
                  └ ContactCells their pressures                          `conjugate_gradients`

`slope_iteration` repeats a solution until it agrees with the displacements by finite slopes.
`rigid_motions` holds the approach and the slopes that are free, with their loads, and `clear_plane`
finds where a plane that may turn clears the surface.
"""
