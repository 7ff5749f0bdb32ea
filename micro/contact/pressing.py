"""Pressing a rigid body into an elastic one, on the cells that it can touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from micro.compliance.bounding_box import Box
from micro.compliance.elastic_grid import ElasticGrids
from micro.contact.nested_grids import coarse_pressure, coarsened, nested_pressure
from micro.contact.problem import Pressures, contact_pressure
from micro.contact.rigid_motions import Motions
from micro.contact.slope_iteration import Solve, with_slopes

Array = NDArray[np.float64]

_MARGIN = 1.1
"""Factor on an estimated approach, so that the cells in its reach hold the contact."""
_FEW_CELLS = 32
"""Cells per side on which the approach is estimated."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pressing:
    """A rigid body on nx × ny cells of an elastic one.

    On a half-space displacements by pressures are not negative, so that without periodicity a body
    touches no cell but those that it would penetrate: a box around them is all that enters the
    solution. A finite body may lift others into contact: they are looked for at the end.

    Args:
        grids: The elastic body.
        spacing: Sides of a cell [mm].
        tolerance: Largest residual.
        upper: Upper bound of the pressures / E*.
    """

    grids: ElasticGrids
    spacing: tuple[float, float]
    tolerance: float
    upper: float = np.inf

    def by_approach(self, required: Array, start: Pressures | None) -> Pressures:
        """Solve with given displacements d, as `contact_pressure`; pressures on all cells."""
        return self._agreed(self._by_approach, required, None, start)

    def by_force(self, required: Array, total: float, start: Pressures | None) -> Pressures:
        """Solve with a given sum of pressures / E*; ``required`` holds up to a constant.

        Args:
            required: Displacement that the body asks for, shape (nx, ny) [mm].
            total: Sum of pressures / E* over the cells.
            start: A solution nearby, its motion the approach.
        """
        motions = Motions.approach(required.shape, total)
        return self._agreed(self._by_force, required, motions, start)

    def by_turning(self, required: Array, motions: Motions, start: Pressures | None) -> Pressures:
        """Solve with free slopes; ``required`` holds up to the free motions."""
        return self._agreed(self._by_turning, required, motions, start)

    def _agreed(
        self, solve: Solve, required: Array, motions: Motions | None, start: Pressures | None
    ) -> Pressures:
        return with_slopes(solve, self.grids, required, motions, start, self.tolerance)

    def _by_approach(
        self,
        required: Array,
        _motions: Motions | None,
        start: Pressures | None,
        tolerance: float,
    ) -> Pressures:
        if required.max() <= 0.0:
            return Pressures(np.zeros(required.shape), np.zeros(0), 0.0, 0, 0)
        return self._grown(self._box(required), required, _pressure(start), None, tolerance)

    def _by_turning(
        self,
        required: Array,
        motions: Motions | None,
        start: Pressures | None,
        tolerance: float,
    ) -> Pressures:
        whole = Box.whole(required.shape)
        return self._on(whole, required, _pressure(start), motions, tolerance)

    def _by_force(
        self,
        required: Array,
        motions: Motions | None,
        start: Pressures | None,
        tolerance: float,
    ) -> Pressures:
        assert motions is not None
        top = float(required.max())
        level = required - top  # from here on the approach counts from first touch of a cell
        first, reach = None, np.inf
        if start is not None and start.pressure.any():
            first, reach = start.pressure, _MARGIN * (float(start.motion[0]) + top)
        elif not self.grids.periodic:
            reach = _MARGIN * self._estimate(level, motions)
        while True:
            box = self._box(level + max(reach, float(np.finfo(float).tiny)))
            found = self._grown(box, level, first, motions, tolerance)
            approach = float(found.motion[0])
            if approach <= reach or box.shape == required.shape:
                return found._replace(motion=found.motion - top)
            first, reach = found.pressure, _MARGIN * approach

    def _estimate(self, required: Array, motions: Motions) -> float:
        """Estimate the approach on a coarse grid: its summits are lower, it errs upwards."""
        factors = [
            1 << max(0, (n - 1).bit_length() - _FEW_CELLS.bit_length() + 1) for n in required.shape
        ]
        spacing = (self.spacing[0] * factors[0], self.spacing[1] * factors[1])
        coarse = coarse_pressure(
            self.grids,
            coarsened(required, factors),
            spacing,
            motions=motions.coarsened(factors),
            upper=self.upper,
            tolerance=1e-2,
            corner=(0.0, 0.0),
        )
        return float(coarse.motion[0])

    def _box(self, required: Array) -> Box:
        whole = self.grids.periodic or not np.isfinite(required).all()
        return Box.around(np.ones(required.shape, bool) if whole else required > 0.0)

    def _grown(
        self,
        box: Box,
        required: Array,
        start: Array | None,
        motions: Motions | None,
        tolerance: float,
    ) -> Pressures:
        """Solve on a box, and on a larger one while the body lifts cells outside into contact."""
        found = self._on(box, required, start, motions, tolerance)
        while self.grids.body is not None and box.shape != required.shape:
            nearer = required if motions is None else required + motions.displacement(found.motion)
            lifted = self._lifted(box, nearer, found)
            if lifted is None:
                break
            box = lifted
            again = self._on(box, required, found.pressure, motions, tolerance)
            found = again._replace(iterations=found.iterations + again.iterations)
        return found

    def _lifted(self, box: Box, nearer: Array, found: Pressures) -> Box | None:
        """Return a box that also holds the cells lifted into contact; None where there are none.

        The half-space's part only lowers cells, so that they are few at most whose displacement by
        the body alone calls for a look at the whole.
        """
        outside = np.ones(nearer.shape, bool)
        outside[box] = False
        whole = Box.whole(nearer.shape)
        risen = self.grids.risen(found.pressure, self.spacing)
        if not np.any(outside & (risen < nearer)):
            return None
        grid = self.grids.at(nearer.shape, self.spacing, whole)
        touched = outside & (grid.displacement(found.pressure) < nearer)
        if not touched.any():
            return None
        return Box.around((found.pressure > 0.0) | (nearer > 0.0) | touched)

    def _on(
        self,
        box: Box,
        required: Array,
        start: Array | None,
        motions: Motions | None,
        tolerance: float,
    ) -> Pressures:
        part = np.ascontiguousarray(required[box])
        free = None if motions is None else motions.on(box)
        first = None if start is None else start[box]
        if first is None or not first.any():
            found = nested_pressure(
                self.grids,
                part,
                self.spacing,
                motions=free,
                upper=self.upper,
                tolerance=tolerance,
                box=box,
            )
        else:
            grid = self.grids.at(part.shape, self.spacing, box)
            found = contact_pressure(
                grid, part, first, motions=free, upper=self.upper, tolerance=tolerance
            )
        pressure = np.zeros(required.shape)
        pressure[box] = found.pressure
        return found._replace(pressure=pressure)


def _pressure(found: Pressures | None) -> Array | None:
    return None if found is None else found.pressure
