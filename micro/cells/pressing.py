"""Pressing a rigid body into the half-space, on the cells that it can touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from micro.cells.coarse_start import coarsened, nested_pressure
from micro.cells.contact_pressure import Pressures, contact_pressure
from micro.cells.elastic_grid import ElasticGrids
from micro.cells.reach import Box

Array = NDArray[np.float64]

_MARGIN = 1.1
"""Factor on an estimated approach, so that the cells in its reach hold the contact."""
_FEW_CELLS = 32
"""Cells per side on which the approach is estimated."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pressing:
    """A rigid body on nx × ny cells of the half-space.

    Displacements by pressures are not negative, so that without periodicity a body touches no
    cell but those that it would penetrate: a box around them is all that enters the solution.

    Args:
        grids: The elastic half-space.
        spacing: Sides (dx, dy) of a cell [mm].
        tolerance: Largest residual.
    """

    grids: ElasticGrids
    spacing: tuple[float, float]
    tolerance: float

    def by_approach(self, required: Array, start: Array | None) -> Pressures:
        """Solve with given displacements d, as `contact_pressure`; pressures on all cells."""
        if required.max() <= 0.0:
            return Pressures(np.zeros(required.shape), 0.0, 0.0, 0, 0)
        return self._on(self._box(required), required, start, None)

    def by_force(self, required: Array, total: float, start: Pressures | None) -> Pressures:
        """Solve with a given sum of pressures / E*; ``required`` holds up to a constant."""
        top = float(required.max())
        level = required - top  # from here on the approach counts from first touch of a cell
        first, reach = None, np.inf
        if start is not None:
            first, reach = start.pressure, _MARGIN * (start.approach + top)
        elif not self.grids.periodic:
            reach = _MARGIN * self._estimate(level, total)
        while True:
            box = self._box(level + max(reach, float(np.finfo(float).tiny)))
            found = self._on(box, level, first, total)
            if found.approach <= reach or box.shape == required.shape:
                return found._replace(approach=found.approach - top)
            first, reach = found.pressure, _MARGIN * found.approach

    def _estimate(self, required: Array, total: float) -> float:
        """Estimate the approach on a coarse grid: its summits are lower, it errs upwards."""
        factors = [
            1 << max(0, (n - 1).bit_length() - _FEW_CELLS.bit_length() + 1) for n in required.shape
        ]
        spacing = (self.spacing[0] * factors[0], self.spacing[1] * factors[1])
        coarse = coarsened(required, factors)
        part = total / (factors[0] * factors[1])
        return nested_pressure(self.grids, coarse, spacing, total=part, tolerance=1e-2).approach

    def _box(self, required: Array) -> Box:
        whole = self.grids.periodic or not np.isfinite(required).all()
        return Box.around(np.ones(required.shape, bool) if whole else required > 0.0)

    def _on(self, box: Box, required: Array, start: Array | None, total: float | None) -> Pressures:
        part = np.ascontiguousarray(required[box])
        first = None if start is None else start[box]
        if first is None or not first.any():
            found = nested_pressure(
                self.grids, part, self.spacing, total=total, tolerance=self.tolerance, box=box
            )
        else:
            grid = self.grids.at(part.shape, self.spacing, box)
            found = contact_pressure(grid, part, first, total=total, tolerance=self.tolerance)
        pressure = np.zeros(required.shape)
        pressure[box] = found.pressure
        return found._replace(pressure=pressure)
