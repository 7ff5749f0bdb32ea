"""The part of a grid that a rigid body can touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Box(NamedTuple):
    """A rectangle of cells.

    Attributes:
        rows: Cells along x.
        columns: Cells along y.
    """

    rows: slice
    columns: slice

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of cells (nx, ny)."""
        return self.rows.stop - self.rows.start, self.columns.stop - self.columns.start

    @classmethod
    def whole(cls, grid: tuple[int, ...]) -> Box:
        """Return the box of all cells."""
        return cls(slice(0, grid[0]), slice(0, grid[1]))

    @classmethod
    def around(cls, cells: NDArray[np.bool_]) -> Box:
        """Return a box around some cells, at least one.

        Its sides are rounded up to 2^k or 3 · 2^(k−1) cells, as far as the grid has them: along
        a load path few sizes occur, whose kernels and work arrays serve again.
        """
        rows, columns = (np.logical_or.reduce(cells, axis=axis) for axis in (1, 0))
        return cls(_span(rows), _span(columns))


def _span(used: NDArray[np.bool_]) -> slice:
    first, last = np.flatnonzero(used)[[0, -1]]
    size = min(_rounded(int(last - first) + 1), used.size)
    start = min(int(first), used.size - size)
    return slice(start, start + size)


def _rounded(count: int) -> int:
    power = 1 << max(count - 1, 7).bit_length()
    return 3 * power // 4 if count <= 3 * power // 4 else power
