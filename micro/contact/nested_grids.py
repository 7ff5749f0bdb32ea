"""Start on a grid from the solution on a grid half as fine, and so on down to a small one.

The set of cells in contact is then found on the coarse grids, where that costs little, and only
its edge is left to the fine one (full multigrid: Zhao, Vollebregt & Oosterlee 2014,
doi 10.3846/13926292.2014.909899).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.compliance.bounding_box import Box
from micro.compliance.elastic_grid import ElasticGrid, ElasticGrids
from micro.contact.problem import Pressures, contact_pressure
from micro.contact.rigid_motions import Motions

Array = NDArray[np.float64]

_FEW_CELLS = 32
"""Cells per side on which a solution from nothing costs nothing."""
_ROUGH = 2e-2
"""Residual on the coarse grids; their discretisation errs by more."""


def nested_pressure(
    grids: ElasticGrids,
    interference: Array,
    spacing: tuple[float, float],
    *,
    motions: Motions | None = None,
    upper: float = np.inf,
    tolerance: float,
    box: Box,
) -> Pressures:
    """Find the pressures under a rigid body from nothing but its shape.

    Args:
        grids: Elastic bodies.
        interference: Displacement that the body asks for, shape (nx, ny) [mm].
        spacing: Sides of a cell [mm].
        motions: Free motions of the body and their loads; none when not given.
        upper: Upper bound of the pressures / E*.
        tolerance: Largest residual.
        box: Place of the cells.

    Returns:
        As `contact_pressure`; the iterations on coarse grids are not counted.

    Raises:
        NotConverged: When the residual stays above the tolerance on one of the grids.
    """
    start = coarse_start(grids, interference, spacing, motions, upper, _corner(box, spacing))
    grid = grids.at(interference.shape, spacing, box)
    return contact_pressure(
        grid, interference, start, motions=motions, upper=upper, tolerance=tolerance
    )


def coarse_pressure(
    grids: ElasticGrids,
    interference: Array,
    spacing: tuple[float, float],
    *,
    motions: Motions | None = None,
    upper: float = np.inf,
    tolerance: float,
    corner: tuple[float, float],
) -> Pressures:
    """Find the pressures on a coarse grid whose first cell has a given corner [mm].

    See `nested_pressure`.
    """
    start = coarse_start(grids, interference, spacing, motions, upper, corner)
    grid: ElasticGrid = grids.coarse(interference.shape, spacing, corner)
    return contact_pressure(
        grid, interference, start, motions=motions, upper=upper, tolerance=tolerance
    )


def coarse_start(
    grids: ElasticGrids,
    interference: Array,
    spacing: tuple[float, float],
    motions: Motions | None,
    upper: float,
    corner: tuple[float, float],
) -> Array:
    """Return pressures to start from, by a grid half as fine; even ones on a small grid."""
    halved = [n > _FEW_CELLS for n in interference.shape]
    total = 0.0 if motions is None else float(np.abs(motions.loads).max())
    if not any(halved):
        return np.full(interference.shape, total / interference.size)
    factors = [1 + h for h in halved]
    try:
        rough = coarse_pressure(
            grids,
            coarsened(interference, factors),
            (spacing[0] * factors[0], spacing[1] * factors[1]),
            motions=None if motions is None else motions.coarsened(factors),
            upper=upper,
            tolerance=_ROUGH,
            corner=corner,
        )
    except NotConverged:  # a start is a matter of time alone
        return np.full(interference.shape, total / interference.size)
    return refined(rough.pressure, factors)[: interference.shape[0], : interference.shape[1]]


def _corner(box: Box, spacing: tuple[float, float]) -> tuple[float, float]:
    return box.rows.start * spacing[0], box.columns.start * spacing[1]


def coarsened(field: Array, factors: list[int]) -> Array:
    """Average blocks of cells; an incomplete last block is filled with its last cells."""
    spare = [(0, -n % factor) for n, factor in zip(field.shape, factors, strict=True)]
    full = np.pad(field, spare, mode="edge")
    rows, columns = (n // factor for n, factor in zip(full.shape, factors, strict=True))
    return full.reshape(rows, factors[0], columns, factors[1]).mean(axis=(1, 3))


def refined(field: Array, factors: list[int]) -> Array:
    """Repeat cells."""
    return np.repeat(np.repeat(field, factors[0], axis=0), factors[1], axis=1)
