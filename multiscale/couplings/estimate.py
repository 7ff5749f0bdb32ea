"""The rigid plane at the largest load, where something before the load steps needs it."""

from __future__ import annotations

from geometry import PatchGrid, RigidPlane, Surface
from geometry.patches import patch_means
from micro import HalfSpaceModel
from multiscale.couplings.contact_solver import ContactSolver
from multiscale.loading.stepper import LoadHistory, Solver, load_steps

_ESTIMATE_CELLS = 96
"""Cells along a side, at most, of the half-space that estimates the plane at the largest load. On
1024² cells with waves down to a 16th, 64th and 256th of the side the approach was within 1.5 %."""


def prescribed_plane(load_history: LoadHistory, surface: Surface) -> RigidPlane | None:
    """Return the rigid plane at the largest load; None where force or moments are prescribed.

    Args:
        load_history: The loads.
        surface: The surface.
    """
    if load_history.quantity == "force" or load_history.tilt is None:
        return None
    return RigidPlane.above(surface, load_history.largest, load_history.tilt)


def plane_at_largest_load(
    load_history: LoadHistory, solver: Solver, surface: Surface
) -> RigidPlane:
    """Return the rigid plane at the largest load.

    Args:
        load_history: The loads.
        solver: Finds the plane where the force or the moment is prescribed.
        surface: The surface.

    Raises:
        NotConverged: When the plane is not found in smaller steps either.
    """
    if plane := prescribed_plane(load_history, surface):
        return plane
    (step,) = load_steps(solver, load_history.up_to_largest)
    return RigidPlane.above(surface, step.approach_mm, step.tilt)


def estimated_plane(load_history: LoadHistory, model: HalfSpaceModel) -> RigidPlane:
    """Return the rigid plane at the largest load on a half-space of few cells.

    Args:
        load_history: The loads.
        model: The half-space on the cells of the surface.
    """
    surface = model.surface
    x, y = surface.grid
    coarse = model.resampled((min(x, _ESTIMATE_CELLS), min(y, _ESTIMATE_CELLS)))
    whole = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    solver = ContactSolver(coarse, whole, patch_means(surface, whole))
    return plane_at_largest_load(load_history, solver, surface)
