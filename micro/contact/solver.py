"""Contact of a rigid body on the cells of a surface, of which it can touch only a part.

The half-space's displacements by pressures are never negative. Without periodicity a rigid body
therefore touches only cells with a positive interference, and a box around these is all that enters
the solution. A finite body may lift other cells into contact: they are searched for at the end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from micro.compliance.cells import Box
from micro.compliance.grid_compliance import Compliance
from micro.contact.active_set import solve
from micro.contact.nested_grids import nested_start, solve_coarse
from micro.contact.problem import ContactPressures, ContactProblem
from micro.contact.rigid_motions import Motions
from micro.contact.slope_iteration import solve_with_slopes

Array = NDArray[np.float64]

_MARGIN = 1.1
"""Factor on an estimated approach, so that the box of cells that it overlaps holds the contact."""
_FEW_CELLS = 32
"""Cells per side on which the approach is estimated."""


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
        pressure = None if start is None else start.pressure
        if motions is not None and motions.turns:
            whole = Box.whole(interference.shape)
            return self._on(whole, interference, pressure, motions, tolerance)
        if motions is not None:
            return self._under_force(interference, motions, start, tolerance)
        if interference.max() <= 0.0:
            return ContactPressures(np.zeros(interference.shape))
        return self._grown(self._box(interference), interference, pressure, None, tolerance)

    def _under_force(
        self,
        interference: Array,
        motions: Motions,
        start: ContactPressures | None,
        tolerance: float,
    ) -> ContactPressures:
        """Solve with a free approach; the box follows from an estimate of it."""
        top = float(interference.max())
        level = interference - top  # from here on the approach counts from first touch of a cell
        first, most = None, np.inf
        if start is not None and start.pressure.any():
            first, most = start.pressure, _MARGIN * (float(start.motion[0]) + top)
        elif not self.compliance.periodic:
            most = _MARGIN * self._estimated_approach(level, motions)
        while True:
            box = self._box(level + max(most, float(np.finfo(float).tiny)))
            found = self._grown(box, level, first, motions, tolerance)
            approach = float(found.motion[0])
            if approach <= most or box.shape == interference.shape:
                return found._replace(motion=found.motion - top)
            first, most = found.pressure, _MARGIN * approach

    def _estimated_approach(self, interference: Array, motions: Motions) -> float:
        """Estimate the approach on a coarse grid: its summits are lower, it errs upwards."""
        bits = _FEW_CELLS.bit_length() - 1
        factors = [1 << max(0, (n - 1).bit_length() - bits) for n in interference.shape]
        coarse = solve_coarse(
            self.compliance,
            interference,
            self.spacing,
            (0.0, 0.0),
            motions,
            self.upper,
            factors,
            1e-2,
        )
        return float(coarse.motion[0])

    def _box(self, interference: Array) -> Box:
        whole = self.compliance.periodic or not np.isfinite(interference).all()
        if whole:
            return Box.whole(interference.shape)
        return Box.around(interference > 0.0)

    def _grown(
        self,
        box: Box,
        interference: Array,
        start: Array | None,
        motions: Motions | None,
        tolerance: float,
    ) -> ContactPressures:
        """Solve on a box, and on a larger one while cells outside are lifted into contact."""
        found = self._on(box, interference, start, motions, tolerance)
        while self.compliance.body is not None and box.shape != interference.shape:
            nearer = interference
            if motions is not None:
                nearer = interference + motions.nearer(found.motion)
            touched = self._lifted(box, nearer, found.pressure)
            if not touched.any():
                break
            box = Box.around((found.pressure > 0.0) | (nearer > 0.0) | touched)
            again = self._on(box, interference, found.pressure, motions, tolerance)
            found = again._replace(iterations=found.iterations + again.iterations)
        return found

    def _lifted(self, box: Box, interference: Array, pressure: Array) -> NDArray[np.bool_]:
        """Return which cells outside a box penetrate the rigid body.

        The half-space only lowers cells. All displacements are therefore evaluated only where those
        by the finite body alone do not clear every cell outside.
        """
        outside = np.ones(interference.shape, bool)
        outside[box] = False
        body = self.compliance.body_displacement(pressure, self.spacing)
        if not np.any(outside & (body < interference)):
            return np.zeros(interference.shape, bool)
        whole = self.compliance.on_grid(pressure.shape, self.spacing, Box.whole(pressure.shape))
        return np.asarray(outside & (whole.displacement(pressure) < interference))

    def _on(
        self,
        box: Box,
        interference: Array,
        start: Array | None,
        motions: Motions | None,
        tolerance: float,
    ) -> ContactPressures:
        """Solve on the cells of a box, from coarser grids where there is no start."""
        part = np.ascontiguousarray(interference[box])
        free = None if motions is None else motions.on(box)
        if start is None or not start[box].any():
            corner = box.corner(self.spacing)
            first = nested_start(self.compliance, part, self.spacing, corner, free, self.upper)
        else:
            first = start[box]
        problem = ContactProblem(
            compliance=self.compliance.on_grid(part.shape, self.spacing, box),
            interference=part,
            motions=free,
            upper=self.upper,
        )
        found = solve(problem, first, tolerance)
        pressure = np.zeros(interference.shape)
        pressure[box] = found.pressure
        return found._replace(pressure=pressure)
