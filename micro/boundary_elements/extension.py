"""Extension of displacements from the cells in contact to all cells, at low elastic energy.

With the compliance C of a half-space and displacements u of the cells A in contact, the pressures
on A are C_AA⁻¹ u. The energy of that is the least of all displacements of the whole surface that
are u on A. So C_AA⁻¹ = Eᵀ C⁻¹ E, where E is the extension of least energy, and any other extension
makes an approximate inverse whose energy is larger. Extension by zeros, which cuts C⁻¹ down to A,
makes it too large by a factor that grows with the logarithm of the size of a contact over that of a
cell, and with the size of the grid over the distance of the contacts.

Around a contact of size a the least energy has a displacement that falls as a/r, until other
contacts are near. A pyramid of grids, each half as fine, imitates that. Weights say how much a cell
knows: 1 in contact and 0 elsewhere on the finest grid. On the next one they are a share of the sum
over the four cells below, and 1 at most, so that those of a lone contact fall with the size of the
cells. On the way back every cell takes what it does not know from the next coarser grid.

A cell that bears its load on a spring of its own, in series with the half-space, moves more than
the surface does. Its weight on the finest grid is less than 1 (`micro.friction.free_inverse`).

Theory: docs/theory.md, section 4.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from micro.boundary_elements.half_space_grid import Cells
from support.arrays import Array
from support.cores import BLOCK, CELLS, blocks, in_threads

Field = NDArray[np.float32]

_SHARE = 0.32
"""Weight of a coarse cell over the sum of the weights of its four cells. On 33 rough contacts of
512² cells, 2 to 97 % of which touch, solutions took 17.8 products with 0.4, 16.4 with 0.35, 16.1
with 0.3 and 17.1 with 0.25."""
_NONE = 1e-20
"""Weights up to which a cell knows nothing; quotients of smaller ones are inaccurate."""
_SMALLEST = 2
"""Cells along the shorter side of the coarsest grid."""


class Extension:
    """Extension of values on some cells to all cells of a period, and its transpose.

    Args:
        cells: The n cells.
        period: Cells (mx, my) of the period, which holds them.
        weights: How much each cell knows, from 0 to 1, shape (n,); all 1 when not given.

    Attributes:
        place: Rows and columns of the cells.
    """

    def __init__(self, cells: Cells, period: tuple[int, int], weights: Array | None = None) -> None:
        self.place = rows, columns = np.empty_like(cells.row), cells.column
        shape = _halved(period)
        self._block = np.empty_like(rows)

        def locate(some: slice) -> None:
            rows[some] = cells.rows[cells.row[some]]
            self._block[some] = (rows[some] >> 1) * shape[1] + (columns[some] >> 1)

        in_threads(locate, blocks(len(rows), CELLS))
        sums = np.bincount(self._block, weights, minlength=shape[0] * shape[1])
        weight = sums.reshape(shape).astype(np.float32)
        self._scales: list[Field] = []  # from sums over four cells to a level's weighted values
        self._unknown: list[Field] = []  # of each level but the finest, what it does not know
        while True:
            limited = _limited(weight)
            self._scales.append(weight)
            self._unknown.append(np.float32(1.0) - limited)
            if min(shape) <= _SMALLEST:
                break
            weight = _sums(limited)
            shape = _halved(shape)

    def extended(self, values: Array, out: Field) -> None:
        """Extend values that the cells know whole.

        Args:
            values: Of the cells, shape (n,).
            out: Overwritten by their extension, shape (mx, my).
        """
        self.interpolated(values, out)
        rows, columns = self.place

        def put(some: slice) -> None:
            out[rows[some], columns[some]] = values[some]

        in_threads(put, blocks(len(values), CELLS))

    def gathered(self, field: Field) -> Array:
        """Return the transpose of `extended` times a field.

        Args:
            field: Shape (mx, my); overwritten.

        Returns:
            Shape (n,).
        """
        rows, columns = self.place
        own = np.empty(len(rows))

        def take(some: slice) -> None:
            place = rows[some], columns[some]
            own[some] = field[place]
            field[place] = 0.0

        in_threads(take, blocks(len(own), CELLS))
        own += self.collected(field)
        return own

    def interpolated(self, weighted: Array, out: Field) -> None:
        """Interpolate from coarser grids to all cells, those that know values among them.

        Args:
            weighted: Values of the cells times their weights, shape (n,).
            out: Overwritten by the interpolation, shape (mx, my).
        """
        scales = self._scales
        sums = np.bincount(self._block, weighted, minlength=scales[0].size)
        known = [sums.reshape(scales[0].shape).astype(np.float32) * scales[0]]
        for scale in scales[1:]:
            known.append(scale * _sums(known[-1]))
        field = known.pop()
        for mine, unknown in zip(reversed(known), self._unknown[-2::-1], strict=True):
            finer = np.empty_like(mine)
            _interpolate(field, finer, unknown, mine)
            field = finer
        _interpolate(field, out)

    def collected(self, field: Field) -> Array:
        """Return the transpose of `interpolated` times a field.

        Args:
            field: Shape (mx, my).

        Returns:
            Shape (n,).
        """
        levels = [_collected(field)]
        for unknown in self._unknown[:-1]:
            levels.append(_collected(levels[-1], unknown))
        total = levels.pop() * self._scales[-1]
        for scale, level in zip(self._scales[-2::-1], reversed(levels), strict=True):
            total = _scaled_sum(level, total, scale)
        flat, found = total.ravel(), np.empty(len(self._block))

        def take(some: slice) -> None:
            found[some] = flat[self._block[some]]

        in_threads(take, blocks(len(found), CELLS))
        return found


def _halved(shape: tuple[int, int]) -> tuple[int, int]:
    """Return the shape of the next coarser grid."""
    return (shape[0] + 1) // 2, (shape[1] + 1) // 2


def _limited(weight: Field) -> Field:
    """Return a share of sums of weights, at most 1, and leave its ratio to these in their place."""
    limited = np.empty_like(weight)

    def work(rows: slice) -> None:
        here, most = weight[rows], limited[rows]
        np.minimum(np.float32(_SHARE) * here, np.float32(1.0), out=most)
        np.divide(most, here, out=here, where=here > _NONE)

    in_threads(work, blocks(len(weight), BLOCK // (8 * weight.shape[1])))
    return limited


def _sums(fine: Field) -> Field:
    """Return sums over the cells of the next coarser grid."""
    odd = [(0, n % 2) for n in fine.shape]
    full = np.pad(fine, odd) if odd != [(0, 0), (0, 0)] else fine
    rows = full[0::2] + full[1::2]
    return np.asarray(rows[:, 0::2] + rows[:, 1::2])


def _scaled_sum(fine: Field, coarse: Field, scale: Field) -> Field:
    """Add to fine cells the value of the coarse one that covers them, `_sums` transposed; scale.

    Args:
        fine: Values of the fine cells; overwritten by the result.
        coarse: Values of the coarse cells.
        scale: What the sums are multiplied by, of the fine shape.
    """
    height, width = fine.shape

    def work(here: slice) -> None:
        rows = np.repeat(coarse[here], 2, axis=1)[:, :width]
        for below in (0, 1):
            part = fine[2 * here.start + below : 2 * here.stop : 2]
            part += rows[: len(part)]
        some = slice(2 * here.start, 2 * here.stop)
        fine[some] *= scale[some]

    in_threads(work, blocks(-(-height // 2), BLOCK // (16 * width)))
    return fine


def _interpolate(
    coarse: Field, out: Field, factors: Field | None = None, terms: Field | None = None
) -> None:
    """Interpolate linearly, and periodically, from the middles of coarse cells to fine ones.

    Args:
        coarse: Values of the coarse cells.
        out: Overwritten by those of the fine cells.
        factors: What these are multiplied by, of the same shape; 1 when not given.
        terms: What is added then; nothing when not given.
    """
    (rows, columns), (_, width) = coarse.shape, out.shape

    def work(here: slice) -> None:
        near = coarse[np.arange(here.start - 1, here.stop + 1) % rows]
        quarter = np.float32(0.25) * near
        middle = near[1:-1] - quarter[1:-1]
        across = np.empty((2 * len(middle), columns + 2), np.float32)
        inner = across[:, 1:-1]
        np.add(middle, quarter[:-2], out=inner[0::2])
        np.add(middle, quarter[2:], out=inner[1::2])
        across[:, 0], across[:, -1] = across[:, -2], across[:, 1]
        quarter = np.float32(0.25) * across
        middle = across[:, 1:-1] - quarter[:, 1:-1]
        fine = out[2 * here.start : 2 * here.stop]
        some = slice(len(fine))
        np.add(middle[some], quarter[some, :-2], out=fine[:, 0::2])
        odd = width // 2
        np.add(middle[some, :odd], quarter[some, 2 : odd + 2], out=fine[:, 1::2])
        if factors is not None:
            fine *= factors[2 * here.start : 2 * here.stop]
        if terms is not None:
            fine += terms[2 * here.start : 2 * here.stop]

    in_threads(work, blocks(rows, BLOCK // (16 * width)))


def _collected(fine: Field, factors: Field | None = None) -> Field:
    """Return the transpose of `_interpolate` times a field.

    Args:
        fine: The field.
        factors: What it is multiplied by first, of the same shape; 1 when not given.
    """
    height, width = fine.shape
    rows, columns = _halved((height, width))
    result = np.empty((rows, columns), np.float32)

    def along(rows: slice | list[int]) -> Field:
        """Collect in some rows."""
        part = fine[rows] if factors is None else fine[rows] * factors[rows]
        even = np.empty((len(part), columns + 1), np.float32)
        odd = np.zeros_like(even)
        even[:, :-1], odd[:, 1 : width // 2 + 1] = part[:, 0::2], part[:, 1::2]
        even[:, -1], odd[:, 0] = even[:, 0], odd[:, -1]
        quarter = even[:, 1:] + odd[:, :-1]
        quarter -= even[:, :-1]
        quarter -= odd[:, 1:]
        quarter *= np.float32(0.25)
        quarter += even[:, :-1]
        quarter += odd[:, 1:]
        return quarter

    def work(here: slice) -> None:
        count = here.stop - here.start
        even, odd = np.zeros((2, count + 1, columns), np.float32)
        found = along(slice(2 * here.start, 2 * here.stop))
        even[:-1], odd[1 : 1 + len(found) // 2] = found[0::2], found[1::2]
        even[-1] = along([2 * (here.stop % rows)])[0]
        before = 2 * ((here.start - 1) % rows) + 1
        if before < height:
            odd[0] = along([before])[0]
        quarter = even[1:] + odd[:-1]
        quarter -= even[:-1]
        quarter -= odd[1:]
        quarter *= np.float32(0.25)
        quarter += even[:-1]
        quarter += odd[1:]
        result[here] = quarter

    in_threads(work, blocks(rows, BLOCK // (16 * width)))
    return result
