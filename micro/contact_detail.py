"""One solved contact in detail: its spots, and pressures and gaps at points where they are known.

Every micro model returns the same record. Models on cells know the fields, those of separate
ellipses the spots alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactDetail:
    """The m connected spots of a contact, and its fields at points of the surface.

    The points are the centres of nx × ny cells, or n points anywhere.

    Args:
        place: Where the pressure of each spot is largest, shape (m, 2) [mm].
        area: Real contact areas of the spots, shape (m,) [mm²].
        force: Their forces, shape (m,) [N].
        peak_pressure: Their largest pressures, shape (m,) [MPa].
        x: Abscissae of the points, shape (nx,) or (n,) [mm]; none where no fields are known.
        y: Their ordinates, shape (ny,) or (n,) [mm].
        pressure: Contact pressures, shape (nx, ny) or (n,) [MPa].
        gap: Distances of the displaced surface from the plane, shape (nx, ny) or (n,) [mm]; in
            contact 0 up to the residual of the solution.
        plastic_depth: Plastic depth that loads so far have left, shape (nx, ny) [mm]; none without
            a hardness.
    """

    place: Array
    area: Array
    force: Array
    peak_pressure: Array
    x: Array | None = None
    y: Array | None = None
    pressure: Array | None = None
    gap: Array | None = None
    plastic_depth: Array | None = None


def peaks_of(group: NDArray[np.integer], values: Array, count: int) -> NDArray[np.intp]:
    """Return the index of the largest value in each of some groups, shape (count,).

    Args:
        group: Number 0 … count − 1 of the group of every value, shape (n,); none is empty.
        values: The values, shape (n,).
        count: Number of groups.
    """
    rising = np.argsort(values, kind="stable")
    found = np.zeros(count, np.intp)
    found[group[rising]] = rising  # the last, largest one stays
    return found
