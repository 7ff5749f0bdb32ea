"""Passes between the islands, the displacements that they cause and the plane, until all agree."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.islands.shapes import Islands, islands
from micro.islands.volumes import Relief
from micro.relaxation import Relaxation

Array = NDArray[np.float64]

TOLERANCE = 1e-6
"""Largest change of a displacement in a pass, relative to the greatest height above the plane."""

_FREE_PASSES = 10
_MOST_PASSES = 200


class Answer(NamedTuple):
    """What islands of given shapes do.

    Attributes:
        lift: By how much the n peaks are lower than above the first plane, (n,) [mm].
        motion: Approach and slopes of the plane, shape (3,).
        islands: The islands under that plane, as deep as their shapes let them be.
    """

    lift: Array
    motion: Array
    islands: Islands


class Settled(NamedTuple):
    """Islands that agree with the displacements that they cause.

    Attributes:
        islands: The islands.
        motion: Approach and slopes of the plane, shape (3,).
        height: Heights of the n peaks above their own levels, negative below, shape (n,) [mm].
        iterations: Passes made.
        residual: Last change of a displacement relative to the greatest height above the plane.
    """

    islands: Islands
    motion: Array
    height: Array
    iterations: int
    residual: float


def settle(
    relief: Relief, level: Array, motion: Array, answer: Callable[[Islands, Array], Answer]
) -> Settled:
    """Cut the surface, let the islands displace each other, cut it again at the new levels.

    Every pass goes a part of the way to the displacements by the islands it found; the part
    follows from the last two changes. From the tenth pass on, regions can fall
    apart but not grow together again: a pair that does both in turn would never settle.

    Args:
        relief: Catchments of what rises above the plane.
        level: Heights of the first plane over the n peaks, shape (n,) [mm].
        motion: Approach and slopes of the first plane, shape (3,).
        answer: Returns what islands do that were found under a plane (3,).

    Raises:
        NotConverged: When the displacements do not settle.
    """
    above = relief.z - level
    linked = relief.open_passes(level)
    region, relaxed = relief.regions(linked), Relaxation()
    lift: Array = np.zeros(len(relief))
    for number in range(_MOST_PASSES):
        now = relief.open_passes(level + lift)
        now &= linked | (number < _FREE_PASSES)
        if np.any(now != linked):
            linked, region = now, relief.regions(now)
            relaxed.forget()
        height = above - lift
        found = islands(relief, height, region)
        goal, motion, exact = answer(found, motion)
        # peaks below the plane before and after the pass count for nothing
        change = np.where((above > 0.0) | (height > 0.0) | (above > goal), goal - lift, 0.0)
        deepest = float(above.max(initial=0.0)) or float(height.max(initial=0.0)) or 1.0
        residual = float(np.abs(change).max(initial=0.0)) / deepest
        if residual <= TOLERANCE:
            return Settled(exact, motion, height, number + 1, residual)
        lift = relaxed.next(lift, change)
    raise NotConverged(
        f"the passes between islands and their displacements at an approach of {motion[0]:.6g} mm",
        reason="MAX_ITERATIONS",
        iterations=_MOST_PASSES,
        remedy='lower load.approach, or choose micro.model = "half-space"',
    )
