"""Transmissivity of a rough face over its mean separation, from periodic samples.

What a separation lets through along x and along y is found from the gaps of the samples under a
plane there, on their cells and on half as many a side, whose difference is the error.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from geometry import Control
from micro import HalfSpaceModel
from multiscale.gap_flows import flow_solver, solved_gap_flow
from support.arrays import Array
from support.collective import shared

_ROWS = 25
"""Separations from first touch to 0; those after the first that is closed are left out."""
_FEWEST_CELLS = 16
"""Cells along a side below which half of them are not tried."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Transmissivity:
    """Transmissivity along x and y over the mean separation, the mean of some samples.

    Between rows the hydraulic gap T^(1/3) is interpolated monotonically. Beyond first touch it
    grows as the separation.

    Attributes:
        separation: Mean separations, rising, shape (m,) [mm].
        hydraulic_gap: T^(1/3) along x and y, 0 where closed, shape (m, 2) [mm].
    """

    separation: Array
    hydraulic_gap: Array

    def at(self, separation: Array) -> Array:
        """Return the transmissivities along x and y at mean separations, shape (n, 2) [mm³].

        Args:
            separation: Mean separations, shape (n,) [mm].
        """
        first, last = self.separation[[0, -1]]
        within = np.clip(separation, first, last)
        gap = PchipInterpolator(self.separation, self.hydraulic_gap)(within)
        return np.asarray((gap + np.maximum(separation - last, 0.0)[:, None]) ** 3)


def transmissivities(
    models: Sequence[HalfSpaceModel], comm: Any = None
) -> tuple[Transmissivity, Transmissivity]:
    """Tabulate the transmissivity of periodic samples, on their cells and on half as many a side.

    Args:
        models: The periodic models of the samples, which count by their areas.
        comm: MPI communicator, whose ranks share the samples; None for this process alone.

    Returns:
        The transmissivity, and that on half the cells; the same on every rank.

    Raises:
        NotConverged: When a contact problem or a flow cannot be solved.

    Note:
        Collective.
    """
    flow_solver(max(model.surface.heights.size for model in models))  # PETSc starts on all ranks
    largest = max(_separation(model, model.first_touch) for model in models)
    separations = largest * np.linspace(1.0, 0.0, _ROWS) ** 2
    grids = [grid for model in models for grid in (model.surface.grid, _half(model.surface.grid))]
    own = [model for model in models for _ in (0, 1)]
    rows = shared(comm, len(grids), lambda k: _rows(own[k], grids[k], separations))
    weights = [model.surface.area for model in models]
    fine, coarse = (np.average(rows[k::2], axis=0, weights=weights) for k in (0, 1))
    return _table(separations, fine), _table(separations, coarse)


def _table(separations: Array, found: Array) -> Transmissivity:
    """Return the table of transmissivities at separations that fall, one closed row at most."""
    is_open = found.max(axis=1) > 0.0
    kept = slice(0, int(is_open.sum()) + 1)
    return Transmissivity(
        separation=separations[kept][::-1].copy(), hydraulic_gap=np.cbrt(found[kept][::-1])
    )


def _half(grid: tuple[int, int]) -> tuple[int, int]:
    """Return half of the cells along both sides where that leaves enough."""
    return grid if min(grid) < _FEWEST_CELLS else (grid[0] // 2, grid[1] // 2)


def _separation(model: HalfSpaceModel, approach: float) -> float:
    """Return the mean separation of a periodic sample at an approach [mm]."""
    return model.reference_height - model.surface.mean_height - approach


def _rows(model: HalfSpaceModel, grid: tuple[int, int], separations: Array) -> Array:
    """Return T along x and y at separations that fall, shape (m, 2) [mm³]."""
    if grid != model.surface.grid:
        model = model.resampled(grid)
    found, start = np.zeros((len(separations), 2)), None
    for row, separation in enumerate(separations[:-1]):  # the last one is full contact
        approach = _separation(model, 0.0) - float(separation)
        if approach <= model.first_touch:
            gap = separation + model.surface.mean_height - model.surface.heights
            gap = np.maximum(gap, 0.0)
        else:
            state = model.press(Control(approach=approach), start=start)
            start, gap = state.guess, state.open_gap
        for axis, direction in enumerate("xy"):
            flow = solved_gap_flow(gap, model.surface.lengths, direction, periodic=True)
            found[row, axis] = flow.transmissivity
        if not found[row].any():
            break
    return found
