"""Time that micro models take for one solution, started from a solution nearby.

The numbers are fits to times on one core of an Intel Xeon (Rocket Lake, 3 GHz), for Set 1 of Waddad
et al. 2016 and for bands of 1 to 6 and 2 to 32 waves, 64² to 512² heights, 2 to 20 µm of approach.
They hold within a factor of 1.5.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_LOADS = (0.25, 0.5, 0.75, 1.0)
"""Loads relative to the largest; their mean stands for the loads of a run."""


def contact_box_share(interference: NDArray[np.float64]) -> float:
    """Return the part of the surface in the bounding box of its contacts, in the mean over loads.

    The half-space is solved on this part of its grid.

    Args:
        interference: How far the undeformed surface lies above the plane at the largest load,
            negative where it lies below, shape (nx, ny) [mm].
    """
    largest, shares = float(interference.max()), []
    for load in _LOADS:
        i, j = np.nonzero(interference > (1.0 - load) * largest)
        touches = i.size and largest > 0.0
        shares.append(float((np.ptp(i) + 1) * (np.ptp(j) + 1)) if touches else 1.0)
    return float(np.mean(shares)) / interference.size


def solution_seconds(kind: str, cells: int, *, box: float, summits: int) -> float:
    """Return the time of one solution of a micro model [s].

    Args:
        kind: Its name; ``scaled`` for asperities with curvatures at the scale of the contact.
        cells: Cells of the half-space's grid; heights of the surface for other models.
        box: Part of the surface in the bounding box of its contacts, see `contact_box_share`.
        summits: Summits in contact; asperities interact each with each.
    """
    if kind == "half-space":
        padded = 4.0 * max(box * cells, 1.0)
        # 20 to 30 iterations of two products by transforms on a box of twice the sides
        return 3.1e-3 + 33e-9 * cells + 15e-9 * padded * float(np.log2(padded))
    if kind == "islands":
        return 15.6e-3 + 44e-9 * cells
    asperities = 1.0e-3 + 13e-6 * summits + 28e-9 * summits**2
    return asperities + (4.7e-3 if kind == "scaled" else 0.0)
