"""Passes between the islands and the displacements that they cause, until both agree."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.regions.island_shapes import Islands, islands
from micro.regions.relief import Relief
from micro.relaxation import Relaxation

Array = NDArray[np.float64]

TOLERANCE = 1e-6
"""Largest change of a displacement in a pass, relative to the greatest height above the plane."""

_FREE_PASSES = 10
_MOST_PASSES = 200


class Settled(NamedTuple):
    """Islands that agree with the displacements that they cause.

    Attributes:
        islands: The islands.
        height: Heights of the n peaks above their own levels, negative below, shape (n,) [mm].
        iterations: Passes made.
        residual: Last change of a displacement relative to the greatest height above the plane.
    """

    islands: Islands
    height: Array
    iterations: int
    residual: float


def settle(relief: Relief, level: float) -> Settled:
    """Cut the surface, let the islands displace each other, cut it again at the new levels.

    Every pass goes a part of the way to the displacements by the islands it found; the part
    follows from the last two changes. From the tenth pass on, regions can fall
    apart but not grow together again: a pair that does both in turn would never settle.

    Args:
        relief: Catchments of what rises above the level.
        level: Height of the plane [mm].

    Raises:
        NotConverged: When the displacements do not settle.
    """
    above = relief.z - level
    deepest = float(above.max(initial=0.0))
    reached = above > 0.0
    linked = relief.open_passes(np.full(len(relief), level))
    region, relaxed = relief.regions(linked), Relaxation()
    lift: Array = np.zeros(len(relief))
    for number in range(_MOST_PASSES):
        now = relief.open_passes(level + lift)
        now &= linked | (number < _FREE_PASSES)
        if np.any(now != linked):
            linked, region = now, relief.regions(now)
            relaxed.forget()
        found = islands(relief, above - lift, region)
        change = np.where(reached, found.lift(relief.x, relief.y) - lift, 0.0)
        residual = float(np.abs(change).max(initial=0.0)) / (deepest or 1.0)
        if residual <= TOLERANCE:
            return Settled(found, above - lift, number + 1, residual)
        lift = relaxed.next(lift, change)
    raise NotConverged(
        f"the passes between islands and their displacements at height {level:.6g} mm",
        reason="MAX_ITERATIONS",
        iterations=_MOST_PASSES,
        remedy='lower load.approach, or choose micro.model = "half-space"',
    )
