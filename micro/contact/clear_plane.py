"""Where a body that may turn about a given point stands clear of a surface, or what holds it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from micro.contact.rigid_motions import Motions

Array = NDArray[np.float64]

_MOST_CONDITIONS = 500
_MOST_MOTION = 100.0
"""Bound of the motions, relative to the largest interference; it counts while cells are few."""
_ROUNDING = 1e-13


class Clearance(NamedTuple):
    """The free motions that make the largest interference as small as possible.

    Attributes:
        motion: The motions, shape (k,) [mm].
        interference: Largest interference then [mm]; the body is clear where it is not positive.
        support: Shares of the force of the cells that hold the body there, which have no load along
            any motion, shape (nx, ny).
    """

    motion: Array
    interference: float
    support: Array


def clearance(interference: Array, motions: Motions) -> Clearance:
    """Find how far a body can come clear of a surface by its free motions.

    It is a linear programme in the motions and the largest interference, with one condition for
    every cell. Cells that violate the motions found so far most are added one by one. The start of
    a plane on few peaks (`micro.interaction.plane_on_peaks`) is the same programme with all
    conditions at once.

    Args:
        interference: Interference where the motions are 0, shape (nx, ny) [mm].
        motions: Free motions; the approach is not among them.
    """
    count = len(motions.loads)
    size = float(np.abs(interference).max()) or 1.0
    scaled = interference / size  # the programme's tolerances are absolute
    cells: list[int] = []
    motion, shares, bound = np.zeros(count), np.zeros(0), -np.inf
    limits = [(-_MOST_MOTION, _MOST_MOTION)] * count + [(None, None)]
    for _ in range(_MOST_CONDITIONS):
        now = scaled + motions.displacement(motion)
        worst = int(np.argmax(now))
        if worst in cells or now.ravel()[worst] <= bound + _ROUNDING:
            break
        cells.append(worst)
        levers = motions.levers_of(np.array(cells)).T
        found = linprog(
            np.append(np.zeros(count), 1.0),
            A_ub=np.column_stack((levers, -np.ones(len(cells)))),
            b_ub=-scaled.ravel()[cells],
            bounds=limits,
            method="highs-ds",
        )
        motion, bound = np.asarray(found.x[:count]), float(found.x[count])
        shares = np.maximum(-np.asarray(found.ineqlin.marginals), 0.0)
    support = np.zeros(interference.shape)
    support.ravel()[cells[: len(shares)]] = shares
    motion = size * motion
    largest = float((interference + motions.displacement(motion)).max())
    return Clearance(motion, largest, support)
