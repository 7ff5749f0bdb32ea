"""Parts of a grid: the box of cells that a rigid body can touch, and the cells in contact."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.intp]


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

    def corner(self, spacing: tuple[float, float]) -> tuple[float, float]:
        """Return the corner of the first cell, of sides (dx, dy), on the whole grid [mm]."""
        return self.rows.start * spacing[0], self.columns.start * spacing[1]

    @classmethod
    def whole(cls, grid: tuple[int, ...]) -> Box:
        """Return the box of all cells."""
        return cls(slice(0, grid[0]), slice(0, grid[1]))

    @classmethod
    def around(cls, cells: NDArray[np.bool_]) -> Box:
        """Return a box around some cells, at least one.

        Its sides are rounded up to 2^k or 3 · 2^(k−1) cells, as far as the grid has them. Few sizes
        then occur along a load path, and their kernels and work arrays are used again.
        """
        rows, columns = (np.logical_or.reduce(cells, axis=axis) for axis in (1, 0))
        return cls(_span(rows), _span(columns))


def _span(used: NDArray[np.bool_]) -> slice:
    first, last = (int(at) for at in np.flatnonzero(used)[[0, -1]])
    count = last - first + 1
    power = 1 << max(count - 1, 7).bit_length()
    rounded = 3 * power // 4 if count <= 3 * power // 4 else power
    size = min(rounded, used.size)
    start = min(first, used.size - size)
    return slice(start, start + size)


class Cells(NamedTuple):
    """Some cells of a grid.

    Attributes:
        flat: Their flat indices, ascending, shape (n,).
        rows: The rows that they lie in, shape (r,).
        place: Their flat indices in an array of these rows alone, shape (n,).
        columns: Number of columns of the grid.
    """

    flat: Indices
    rows: Indices
    place: Indices
    columns: int

    @classmethod
    def of(cls, flat: Indices, grid: tuple[int, ...]) -> Cells:
        """Return cells of a grid (nx, ny) by their flat indices, ascending."""
        rows, at = np.unique(flat // grid[1], return_inverse=True)
        return cls(flat, rows, at.ravel() * grid[1] + flat % grid[1], grid[1])
