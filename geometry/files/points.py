"""Heights from lists of points x, y, z on a regular grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.files.content import FileContent
from support.checks import LARGEST
from support.errors import InputError

Array = NDArray[np.float64]

_PLACE_TOLERANCE = 0.01
"""Distance of a point from its place on a regular grid that is accepted [cells]."""
_FEWEST = 0.5
"""Least share of a grid's places that points must take: with fewer it is hardly their grid."""

_FEWEST_POINTS, _MOST_COLUMNS = 16, 12
"""Rows and columns between which a matrix may be a list of points with more than heights."""


def heights_of_points(points: Array) -> FileContent:
    """Return the heights of points on a regular grid, in any order; not a number where none is.

    Args:
        points: Rows x, y, z [mm], z in the unit of the file.

    Raises:
        InputError: When there are not three columns, or the points lie on no regular grid.
    """
    if points.shape[1] != 3:
        raise InputError(
            "a point list needs three columns x, y, z",
            value=points.shape[1],
            allowed="3 columns; a list of x, z is a profile, not a surface",
        )
    if not np.all(np.abs(points[:, :2]) <= LARGEST):
        raise InputError(f"some coordinates x, y are not finite, or beyond {LARGEST:g} mm")
    (ix, dx), (iy, dy) = _places(points[:, 0], "x"), _places(points[:, 1], "y")
    nx, ny = int(ix.max()) + 1, int(iy.max()) + 1
    taken, times = np.unique(ix * ny + iy, return_counts=True)
    if taken.size < _FEWEST * nx * ny or np.any(times != 1):
        raise InputError(
            f"the points do not fill a regular grid of {nx} × {ny}: "
            f"{nx * ny - taken.size} places are empty, "
            f"{np.count_nonzero(times > 1)} taken more than once"
        )
    heights = np.full((nx, ny), np.nan)
    heights[ix, iy] = points[:, 2]
    return FileContent(heights=heights, lengths=(nx * dx, ny * dy))


def lists_points(matrix: Array) -> bool:
    """Tell whether the first two columns of a matrix are the places of a whole regular grid.

    Args:
        matrix: A matrix of three or more columns.
    """
    if len(matrix) < _FEWEST_POINTS or matrix.shape[1] > _MOST_COLUMNS:
        return False
    try:
        return heights_of_points(matrix[:, :3]).heights.size == len(matrix)
    except InputError:
        return False


def _places(coordinate: Array, axis: str) -> tuple[NDArray[np.intp], float]:
    """Return the index of every coordinate on an even division, and the division's step [mm]."""
    lowest, span = coordinate.min(), float(np.ptp(coordinate))
    gaps = np.diff(np.sort(coordinate))
    if not span:
        raise InputError(f"all points have the same {axis}, they are a profile, not a surface")
    count = round(span / float(np.median(gaps[gaps > 0.3 * gaps.max()])))  # without rounding noise
    step = span / count
    place = (coordinate - lowest) / step
    index = np.rint(place).astype(np.intp)
    if np.max(np.abs(place - index)) > _PLACE_TOLERANCE:
        raise InputError(f"the points are not evenly spaced along {axis}")
    return index, step
