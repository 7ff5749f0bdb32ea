"""Pressures to start from, by the solution on a grid half as fine, and so on down to a small one.

The set of cells in contact is then found on the coarse grids, where that costs little, and only
its edge is left to the fine one (full multigrid: Zhao, Vollebregt & Oosterlee 2014,
doi 10.3846/13926292.2014.909899).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.compliance.grid_compliance import Compliance
from micro.contact.active_set import solve
from micro.contact.problem import ContactPressures, ContactProblem
from micro.contact.rigid_motions import Motions

Array = NDArray[np.float64]

_FEW_CELLS = 32
"""Cells per side on which a solution from nothing costs nothing."""
_ROUGH = 2e-2
"""Residual on the coarse grids; their discretisation errs by more."""


def nested_start(
    compliance: Compliance,
    interference: Array,
    spacing: tuple[float, float],
    corner: tuple[float, float],
    motions: Motions | None = None,
    upper: float = np.inf,
) -> Array:
    """Return pressures / E* to start from on a grid, shape (nx, ny).

    They come from a grid half as fine. On a small grid they are uniform and meet the loads.

    Args:
        compliance: The elastic body.
        interference: Overlap of the undeformed bodies, shape (nx, ny) [mm].
        spacing: Sides of a cell [mm].
        corner: Corner of the first cell on the surface [mm].
        motions: Free motions of the body and their loads; none when not given.
        upper: Upper bound of the pressures / E*.
    """
    factors = [1 + (n > _FEW_CELLS) for n in interference.shape]
    total = 0.0 if motions is None else float(np.abs(motions.loads).max())
    uniform = np.full(interference.shape, total / interference.size)
    if max(factors) == 1:
        return uniform
    try:
        found = solve_coarse(
            compliance, interference, spacing, corner, motions, upper, factors, _ROUGH
        )
    except NotConverged:  # a bad start only costs time
        return uniform
    return refined(found.pressure, factors)[: interference.shape[0], : interference.shape[1]]


def solve_coarse(
    compliance: Compliance,
    interference: Array,
    spacing: tuple[float, float],
    corner: tuple[float, float],
    motions: Motions | None,
    upper: float,
    factors: Sequence[int],
    tolerance: float,
) -> ContactPressures:
    """Solve on coarse cells.

    Args:
        compliance: The elastic body.
        interference: As for `nested_start`, on the fine cells.
        spacing: Sides of a fine cell [mm].
        corner: Corner of the first cell on the surface [mm].
        motions: Free motions of the body; none when not given.
        upper: Upper bound of the pressures / E*.
        factors: Fine cells in a coarse one along x and y.
        tolerance: Largest residual.

    Raises:
        NotConverged: As for `solve`.
    """
    coarse = coarsened(interference, factors)
    sides = spacing[0] * factors[0], spacing[1] * factors[1]
    free = None if motions is None else motions.coarsened(factors)
    start = nested_start(compliance, coarse, sides, corner, free, upper)
    problem = ContactProblem(
        compliance=compliance.on_coarse(coarse.shape, sides, corner),
        interference=coarse,
        motions=free,
        upper=upper,
    )
    return solve(problem, start, tolerance)


def coarsened(field: Array, factors: Sequence[int]) -> Array:
    """Average blocks of cells; an incomplete last block is filled with its last cells."""
    missing = [(0, -n % factor) for n, factor in zip(field.shape, factors, strict=True)]
    full = np.pad(field, missing, mode="edge")
    rows, columns = (n // factor for n, factor in zip(full.shape, factors, strict=True))
    return full.reshape(rows, factors[0], columns, factors[1]).mean(axis=(1, 3))


def refined(field: Array, factors: Sequence[int]) -> Array:
    """Repeat cells."""
    return np.repeat(np.repeat(field, factors[0], axis=0), factors[1], axis=1)
