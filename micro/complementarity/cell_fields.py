"""Fields on the cells of a surface: boxes of cells and coarser cells."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from patchlaw.support.arrays import Array, Flags
from patchlaw.support.cores import on_rows

Box = tuple[slice, slice]
"""Rows and columns of a rectangle of cells."""


def coarsened(field: Array, factors: Sequence[int]) -> Array:
    """Average blocks of cells; an incomplete last block is filled with its last cells."""
    missing = [(0, -n % factor) for n, factor in zip(field.shape, factors, strict=True)]
    full = np.pad(field, missing, mode="edge") if np.any(missing) else field
    (x, y), found = factors, np.empty([n // m for n, m in zip(full.shape, factors, strict=True)])

    def work(rows: slice) -> None:
        fine = full[x * rows.start : x * rows.stop]
        sums = reduce(np.add, (fine[i::x] for i in range(x)))
        found[rows] = reduce(np.add, (sums[:, j::y] for j in range(y))) / (x * y)

    on_rows(work, (len(found), x * full.shape[1]))
    return found


def refined(field: Array, factors: Sequence[int]) -> Array:
    """Return the value of every coarse cell on each of the finer cells that it covers."""
    x, y = factors
    found = np.empty((x * field.shape[0], y * field.shape[1]), field.dtype)

    def work(rows: slice) -> None:
        for i, j in np.ndindex(x, y):  # a repetition takes three times as long, and in one thread
            found[x * rows.start + i : x * rows.stop : x, j::y] = field[rows]

    on_rows(work, (len(field), x * found.shape[1]))
    return found


def box_around(cells: Flags) -> Box:
    """Return a box around some cells, at least one.

    Its sides are rounded up to 2^k or 3 · 2^(k−1) cells, as far as the grid has them. Few sizes
    then occur along a load path, and their kernels and work arrays are used again.

    Args:
        cells: Which cells, shape (nx, ny).
    """
    rows, columns = (np.logical_or.reduce(cells, axis=axis) for axis in (1, 0))
    return _span(rows), _span(columns)


def _span(used: Flags) -> slice:
    first, last = (int(at) for at in np.flatnonzero(used)[[0, -1]])
    count = last - first + 1
    power = 1 << max(count - 1, 7).bit_length()
    rounded = 3 * power // 4 if count <= 3 * power // 4 else power
    size = min(rounded, used.size)
    start = min(first, used.size - size)
    return slice(start, start + size)
