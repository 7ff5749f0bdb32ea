"""Contact of a rigid body on the cells of a surface, of which it can touch only a part.

The half-space's displacements by pressures are never negative. Without periodicity a rigid body
therefore touches only cells with a positive interference, and a box around these is all that enters
the solution. A finite body may lift other cells into contact: they are searched for at the end.

Theory: demos/theory.md, section 3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from micro.compliance.cells import Box
from micro.compliance.grid_compliance import Compliance
from micro.contact.active_set import solve
from micro.contact.nested_grids import FEW_CELLS, SurfaceProblem
from micro.contact.problem import ContactPressures
from micro.contact.rigid_motions import Motions
from micro.contact.slope_iteration import solve_with_slopes

Array = NDArray[np.float64]

_MARGIN = 1.1
"""Factor on an estimated approach, so that the box of cells that it overlaps holds the contact."""
_ESTIMATE = 1e-2
"""Residual of the solution on a coarse grid that the approach is estimated from."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactSolver:
    """Solves contacts of rigid bodies with one elastic body, on nx × ny cells.

    Args:
        compliance: The elastic body.
        spacing: Sides of a cell [mm].
        tolerance: Largest residual, as that of `micro.contact.active_set.solve`.
        upper: Upper bound of the pressures / E*.
    """

    compliance: Compliance
    spacing: tuple[float, float]
    tolerance: float
    upper: float = np.inf

    def solve(
        self,
        interference: Array,
        motions: Motions | None = None,
        start: ContactPressures | None = None,
    ) -> ContactPressures:
        """Solve one contact; pressures are those of all cells.

        Args:
            interference: Overlap of the undeformed bodies where all free motions are zero, shape
                (nx, ny) [mm].
            motions: Free motions: none, the approach under a force, or slopes with or without it.
            start: A solution nearby, its motion that of the solution where the approach is free.

        Raises:
            NotConverged: When the contact conditions or the loads cannot be met.
        """
        return solve_with_slopes(
            self._solve, self.compliance, interference, motions, start, self.tolerance
        )

    def _solve(
        self,
        interference: Array,
        motions: Motions | None,
        start: ContactPressures | None,
        tolerance: float,
    ) -> ContactPressures:
        problem = SurfaceProblem(
            compliance=self.compliance,
            interference=interference,
            motions=motions,
            upper=self.upper,
            spacing=self.spacing,
        )
        pressure = None if start is None else start.pressure
        if motions is None:
            if interference.max() <= 0.0:
                return ContactPressures(np.zeros(interference.shape))
            return _solve_growing(problem, _box(problem, interference), pressure, tolerance)
        if motions.turns:
            return _solve_on(problem, Box.whole(interference.shape), pressure, tolerance)
        return _solve_under_force(problem, start, tolerance)


def _solve_under_force(
    problem: SurfaceProblem, start: ContactPressures | None, tolerance: float
) -> ContactPressures:
    """Solve with a free approach; the box follows from an estimate of it."""
    top = float(problem.interference.max())
    level = problem.interference - top  # the approach counts from first touch of a cell
    problem = replace(problem, interference=level)
    first, most = None, np.inf
    if start is not None and start.pressure.any():
        first, most = start.pressure, _MARGIN * (float(start.motion[0]) + top)
    elif not problem.compliance.periodic:
        # summits of a coarse grid are lower: the estimate errs upwards
        bits = FEW_CELLS.bit_length() - 1
        factors = [1 << max(0, (n - 1).bit_length() - bits) for n in level.shape]
        most = _MARGIN * float(problem.coarsened(factors).solve_coarse(_ESTIMATE).motion[0])
    while True:
        box = _box(problem, level + max(most, float(np.finfo(float).tiny)))
        found = _solve_growing(problem, box, first, tolerance)
        approach = float(found.motion[0])
        if approach <= most or box.shape == level.shape:
            return found._replace(motion=found.motion - top)
        first, most = found.pressure, _MARGIN * approach


def _box(problem: SurfaceProblem, interference: Array) -> Box:
    """Return the box that a body of this interference can touch on a half-space."""
    if problem.compliance.periodic or not np.isfinite(interference).all():
        return Box.whole(interference.shape)
    return Box.around(interference > 0.0)


def _solve_growing(
    problem: SurfaceProblem, box: Box, start: Array | None, tolerance: float
) -> ContactPressures:
    """Solve on a box, and on a larger one while cells outside are lifted into contact."""
    found = _solve_on(problem, box, start, tolerance)
    while problem.compliance.body is not None and box.shape != problem.interference.shape:
        nearer = problem.interference
        if problem.motions is not None:
            nearer = nearer + problem.motions.displacement(found.motion)
        lifted = _lifted(problem, box, nearer, found.pressure)
        if not lifted.any():
            break
        box = Box.around((found.pressure > 0.0) | (nearer > 0.0) | lifted)
        again = _solve_on(problem, box, found.pressure, tolerance)
        found = again._replace(iterations=found.iterations + again.iterations)
    return found


def _lifted(
    problem: SurfaceProblem, box: Box, interference: Array, pressure: Array
) -> NDArray[np.bool_]:
    """Return which cells outside a box penetrate the rigid body.

    The half-space only lowers cells. All displacements are therefore evaluated only where those by
    the finite body alone do not clear every cell outside.
    """
    outside = np.ones(interference.shape, bool)
    outside[box] = False
    body = problem.compliance.body_displacement(pressure, problem.spacing)
    if not np.any(outside & (body < interference)):
        return np.zeros(interference.shape, bool)
    everywhere = Box.whole(pressure.shape)
    grid = problem.compliance.on_grid(pressure.shape, problem.spacing, everywhere)
    return np.asarray(outside & (grid.displacement(pressure) < interference))


def _solve_on(
    problem: SurfaceProblem, box: Box, start: Array | None, tolerance: float
) -> ContactPressures:
    """Solve on the cells of a box, from coarser grids where there is no start."""
    part = problem.on(box)
    first = part.nested_start() if start is None or not start[box].any() else start[box]
    grid = problem.compliance.on_grid(box.shape, problem.spacing, box)
    found = solve(part.with_compliance(grid), first, tolerance)
    pressure = np.zeros(problem.interference.shape)
    pressure[box] = found.pressure
    return found._replace(pressure=pressure)
