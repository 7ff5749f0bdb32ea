"""Where a body that may turn about a given point stands clear of a surface, or what holds it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from micro.contact.rigid_motions import Motions

Array = NDArray[np.float64]

_MOST_CUTS = 500
_MOST_MOTION = 100.0
"""Of the largest displacement asked for; it bounds the programme while cells are few."""
_ROUNDING = 1e-13


class Clearance(NamedTuple):
    """The free motions that leave most room.

    Attributes:
        motion: The motions, shape (k,) [mm].
        overlap: Largest overlap of body and surface then [mm]; clear where it is not positive.
        support: Shares of the cells that keep it from more, which have no load along any motion,
            shape (nx, ny).
    """

    motion: Array
    overlap: float
    support: Array


def clearance(required: Array, motions: Motions) -> Clearance:
    """Find how far a body can come clear of a surface by its free motions.

    A linear programme in the motions and the largest overlap, with one condition for every cell;
    those that the motions found so far violate most are added one by one.

    Args:
        required: Displacements asked for where the motions are 0, shape (nx, ny) [mm].
        motions: Free motions; the approach is not among them.
    """
    count = len(motions.loads)
    size = float(np.abs(required).max()) or 1.0
    asked = required / size  # the programme's tolerances are absolute
    levers = np.empty((0, count))
    cells: list[int] = []
    motion, shares = np.zeros(count), np.zeros(0)
    bound = -np.inf
    for _ in range(_MOST_CUTS):
        overlap = asked + motions.nearer(motion)
        worst = int(np.argmax(overlap))
        if worst in cells or overlap.ravel()[worst] <= bound + _ROUNDING:
            break
        cells.append(worst)
        levers = np.vstack((levers, motions.among(np.array([worst])).T))
        limits = [(-_MOST_MOTION, _MOST_MOTION)] * count + [(None, None)]
        found = linprog(
            np.append(np.zeros(count), 1.0),
            A_ub=np.column_stack((levers, -np.ones(len(cells)))),
            b_ub=-asked.ravel()[cells],
            bounds=limits,
            method="highs-ds",
        )
        motion, bound = np.asarray(found.x[:count]), float(found.x[count])
        shares = np.maximum(-np.asarray(found.ineqlin.marginals), 0.0)
    support = np.zeros(required.shape)
    support.ravel()[cells[: len(shares)]] = shares
    motion = size * motion
    nearest = float((required + motions.nearer(motion)).max())
    return Clearance(motion, nearest, support)
