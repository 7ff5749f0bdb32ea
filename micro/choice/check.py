"""Checks a micro model at one load against the half-space model on grids of the surface."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry import PatchGrid, Surface, patch_means
from geometry.errors import NotConverged
from micro.choice.candidates import Option, half_space
from micro.choice.expected_errors import grid_error
from micro.choice.measures import contact_measures
from micro.model import MicroModel

_FINER = (1.0, 1.5, 2.0, 3.0)
"""Grids that checks are made against, relative to the surface's own."""

_SURER = 3.0
"""How many times smaller than the tolerance the expected error of a check should be."""

_MOST_CHECKED = 2**21
"""Cells of the largest grid, finer than the surface's own, that a check is made on."""


class Check:
    """Compares forces at one load with those of half-space models on grids of the surface.

    Args:
        surface: The surface.
        contact_modulus: E* [MPa].
        approach: Approach of the plane [mm].
        tolerance: Relative error that models shall keep.
        periodic: Whether surface and pressures continue periodically.
    """

    def __init__(
        self,
        surface: Surface,
        *,
        contact_modulus: float,
        approach: float,
        tolerance: float,
        periodic: bool,
    ) -> None:
        self._surface, self._modulus, self._periodic = surface, contact_modulus, periodic
        self._approach = approach
        self.measures = contact_measures(surface, approach, periodic=periodic)
        good = [grid_error(self.measures, f) <= tolerance / _SURER for f in _FINER]
        self._least = good.index(True) if any(good) else len(good) - 1
        self._grids = [self._cells(factor) for factor in _FINER]
        self._forces: dict[tuple[int, int], float] = {}

    def difference(self, option: Option, model: MicroModel) -> tuple[float | None, str]:
        """Return the relative difference of a model's force, and what it differs from."""
        cells = self._grid(option.cells)
        if cells is None:
            return None, ""
        if cells not in self._forces:
            fine = half_space(self._surface, cells, self._modulus, self._periodic)
            self._forces[cells] = self._force(fine)
        truth = self._forces[cells]
        try:
            force = self._force(model)
        except NotConverged:
            force = np.inf
        error = abs(force / truth - 1.0) if truth else float(force > 0.0)
        return float(error), f"the half-space solution on {cells[0]} × {cells[1]} cells"

    def _grid(self, taken: tuple[int, int] | None) -> tuple[int, int] | None:
        """Return the coarsest grid that is fine enough, finer than the one taken, if any."""
        finer = [g for g in self._grids if taken is None or min(g) > min(taken)]
        able = [g for g in finer if g == self._surface.grid or np.prod(g) <= _MOST_CHECKED]
        enough = [g for g in able if g in self._grids[self._least :]]
        return enough[0] if enough else able[-1] if able else None

    def _force(self, model: MicroModel) -> float:
        whole = self._whole
        response = model.respond([self._approach], patches=whole[0], mean_heights=whole[1])
        return float(response.force[0])

    @cached_property
    def _whole(self) -> tuple[PatchGrid, NDArray[np.float64]]:
        whole = PatchGrid(grid=(1, 1), lengths=self._surface.lengths)
        return whole, patch_means(self._surface, whole)

    def _cells(self, factor: float) -> tuple[int, int]:
        return round(factor * self._surface.grid[0]), round(factor * self._surface.grid[1])
