"""Which cells of a surface belong to a patch, whose borders may run through them."""

from __future__ import annotations

from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from geometry import PatchGrid, Surface
from micro.cells.half_space_curve import TIE

_FEWEST = 4  # heights along a side of a surface


def cells_outside(surface: Surface, within: PatchGrid) -> NDArray[np.bool_]:
    """Return which cells have their centres outside patches, shape (nx, ny).

    Args:
        surface: The surface.
        within: The patches.
    """
    edges = within.borders_x, within.borders_y
    x, y = (
        (centres >= border[0] - TIE * side) & (centres < border[-1] - TIE * side)
        for centres, border, side in zip(
            (surface.x, surface.y), edges, surface.spacing, strict=True
        )
    )
    return ~(x[:, None] & y)


def whole_cells(interval: tuple[float, float], side: float, count: int) -> tuple[float, float]:
    """Return the whole cells, as many as a surface needs, that an interval lies in [mm].

    Args:
        interval: Its ends [mm].
        side: Side of a cell [mm].
        count: Cells of the surface along it.
    """
    first, last = floor(interval[0] / side + TIE), ceil(interval[1] / side - TIE)
    first = max(min(first, count - _FEWEST), 0) if last - first < _FEWEST else first
    return first * side, max(last, first + _FEWEST) * side
