"""The compliance of an elastic body as a sum of terms: pressures on its surface to displacements.

    term            for a grid of cells     for Legendre modes of the face   for patches
    half-space      `half_space_grid`       `body_modes`                     `closed_forms`
    free sides      `side_cells`            `body_modes`                     `free_sides`
    finite body     `body_modes`            (given)                          `body_modes`
    finite slopes   `finite_slopes`         -                                -

`grid_compliance` sums them on grids for the contact problem. `body_modes` has the modes
of tractions along the face too.
"""
