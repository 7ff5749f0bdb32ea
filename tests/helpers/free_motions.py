"""Free motions of a plane on cells, and contacts solved with them, in one call."""

import numpy as np

from patchlaw.micro.boundary_elements.grid_compliance import Compliance
from patchlaw.micro.complementarity.cell_problem import CellProblem, Motions
from patchlaw.micro.complementarity.slope_iteration import solve_contact


def turning(x, y, total):
    """Return free tilts, and the approach under a total of pressures / E* where it is given."""
    free = np.array([total is not None, True, True])
    return Motions.of_plane(x, y, free, [total or 0.0, 0.0, 0.0])


def approach(grid, total):
    """Return the approach under a total of pressures / E*."""
    x, y = map(np.zeros, grid)
    return Motions.of_plane(x, y, np.array([True, False, False]), [total, 0.0, 0.0])


def still(grid):
    """Return no free motion."""
    x, y = map(np.zeros, grid)
    return Motions.of_plane(x, y, np.zeros(3, bool), np.zeros(3))


def contact_problem(
    interference, spacing, motions=None, *, tolerance=1e-11, periodic=False, hardness=np.inf
):
    """Return a contact problem on the half-space, by default of a body that does not move."""
    return CellProblem(
        compliance=Compliance(periodic=periodic),
        spacing=spacing,
        interference=interference,
        motions=still(interference.shape) if motions is None else motions,
        tolerance=tolerance,
        hardness=hardness,
    )


def solved(*given, **options):
    """Solve a `contact_problem`."""
    return solve_contact(contact_problem(*given, **options), None)
