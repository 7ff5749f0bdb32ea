"""Pressures of a rigid body on an elastic one: p ≥ 0, gap ≥ 0, p · gap = 0 on every cell.

The set of cells in contact is sought step by step (`micro.contact.active_set`). Pressures may be
bounded from above: where p = H the gap may be negative, as material yields. Motions of the body
that are free are unknowns of the same problem (`micro.contact.rigid_motions`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.compliance.elastic_grid import ElasticGrid
from micro.contact.active_set import ContactSearch
from micro.contact.constraints import Limits
from micro.contact.initial_pressure import first_pressure
from micro.contact.rigid_motions import Motions

Array = NDArray[np.float64]

_MOST_PASSES = 200
_TRUSTING_PASSES = 20
"""Passes in which a step may raise the energy when it lowers the residual."""


class Pressures(NamedTuple):
    """Solution on the cells of a grid.

    Attributes:
        pressure: Pressures / E*, shape (nx, ny).
        motion: Free motions of the body counted from where ``interference`` was, shape (k,) [mm].
        residual: Largest violation of the contact conditions over the largest displacement that
            the body asks for.
        iterations: Products of the compliance with pressures.
        passes: Sets of cells tried.
    """

    pressure: Array
    motion: Array
    residual: float
    iterations: int
    passes: int


def contact_pressure(
    grid: ElasticGrid,
    interference: Array,
    start: Array,
    *,
    motions: Motions | None = None,
    upper: float = np.inf,
    tolerance: float,
) -> Pressures:
    """Find the pressures under a rigid body.

    The residual ε bounds the error of the force: the solution is exact for a body whose heights
    differ by no more than ε δ, so the force lies between those at (1 − ε) δ and (1 + ε) δ. Given
    loads are met to round-off.

    Args:
        grid: The elastic body.
        interference: Displacement d that the body asks for, shape (nx, ny) [mm]; negative where it
            is above the surface. Up to free motions of the body.
        start: Pressures / E* to start from, shape (nx, ny), not negative.
        motions: Motions of the body that are free, with their loads; none when not given.
        upper: Upper bound of the pressures / E*.
        tolerance: Largest residual.

    Raises:
        NotConverged: When the residual stays above the tolerance, or no pressures within their
            bounds meet the loads.

    Source:
        Hintermüller, Ito & Kunisch 2002, doi 10.1137/S1052623401383558; Polonsky & Keer 1999,
        doi 10.1016/S0043-1648(99)00113-1.
    """
    used = grid.products
    limits = Limits(motions=motions, upper=upper)
    search = ContactSearch(
        grid, interference, limits, *first_pressure(grid, interference, start, limits)
    )
    for passes in range(_MOST_PASSES):
        if search.residual <= max(tolerance, search.rounding):
            return Pressures(
                search.pressure,
                search.motion,
                search.residual,
                grid.products - used,
                passes,
            )
        search.step(tolerance, cautious=passes >= _TRUSTING_PASSES)
    raise NotConverged(
        f"the contact pressure (residual {search.residual:.1e}, asked {tolerance:.1e})",
        reason="set of cells in contact not found",
        iterations=grid.products - used,
        remedy="raise the tolerance or take smaller steps of the approach",
    )
