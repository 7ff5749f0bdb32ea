"""Start on a grid from the solution on a grid half as fine, and so on down to a small one.

The set of cells in contact is then found on the coarse grids, where that costs little, and only
its edge is left to the fine one (full multigrid: Zhao, Vollebregt & Oosterlee 2014,
doi 10.3846/13926292.2014.909899).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from micro.cells.contact_pressure import Pressures, contact_pressure
from micro.cells.elastic_grid import ElasticGrids
from micro.cells.reach import Box

Array = NDArray[np.float64]

_FEW_CELLS = 32
"""Cells per side on which a solution from nothing costs nothing."""
_ROUGH = 2e-2
"""Residual on the coarse grids; their discretisation errs by more."""


def nested_pressure(
    grids: ElasticGrids,
    required: Array,
    spacing: tuple[float, float],
    *,
    total: float | None = None,
    tolerance: float,
    box: Box | None = None,
) -> Pressures:
    """Find the pressures under a rigid body from nothing but its shape.

    Args:
        grids: Elastic half-spaces.
        required: Displacement that the body asks for, shape (nx, ny) [mm].
        spacing: Sides of a cell [mm].
        total: Sum of pressures / E* over the cells when the force is given.
        tolerance: Largest residual.
        box: Place of the cells, where free sides matter; coarse grids go without.

    Returns:
        As `contact_pressure`; the iterations on coarse grids are not counted.

    Raises:
        NotConverged: When the residual stays above the tolerance on one of the grids.
    """
    halved = [n > _FEW_CELLS for n in required.shape]
    if any(halved):
        factors = [1 + h for h in halved]
        rough = nested_pressure(
            grids,
            coarsened(required, factors),
            (spacing[0] * factors[0], spacing[1] * factors[1]),
            total=None if total is None else total / (factors[0] * factors[1]),
            tolerance=max(_ROUGH, tolerance),
        )
        start = refined(rough.pressure, factors)[: required.shape[0], : required.shape[1]]
    else:
        start = np.full(required.shape, 0.0 if total is None else total / required.size)
    grid = grids.at(required.shape, spacing, box)
    return contact_pressure(grid, required, start, total=total, tolerance=tolerance)


def coarsened(field: Array, factors: list[int]) -> Array:
    """Average blocks of cells; an incomplete last block is filled with its last cells."""
    spare = [(0, -n % factor) for n, factor in zip(field.shape, factors, strict=True)]
    full = np.pad(field, spare, mode="edge")
    rows, columns = (n // factor for n, factor in zip(full.shape, factors, strict=True))
    return full.reshape(rows, factors[0], columns, factors[1]).mean(axis=(1, 3))


def refined(field: Array, factors: list[int]) -> Array:
    """Repeat cells."""
    return np.repeat(np.repeat(field, factors[0], axis=0), factors[1], axis=1)
