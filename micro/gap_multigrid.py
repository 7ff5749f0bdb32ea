"""Multigrid for flows through maps of cells whose conductivities differ by many powers of ten.

Every second cell along both sides is a cell of the next coarser grid; what lies between takes the
mean of those beside it, weighted by the links to them (black-box multigrid: Alcouffe, Brandt, Dendy
& Painter 1981, doi 10.1137/0902035; Dendy 1982, doi 10.1016/0021-9991(82)90057-2), and coarser
grids have the operator that follows. Pools of fluid between contact that no coarse cell lies in,
or that are linked to one by a narrow link alone, would be lost so: cells have a small link to both
sides besides (`_SHARE`), by which a coarse cell in contact can stand for the pool beside it.

On one coarse grid pools can be corrected besides (`gap_pools`).

One cycle, in single precision, preconditions `gap_iteration`. Flows in several directions are
solved together, as arrays whose first axis is the direction.

Cells are stored by the parity (even or odd) of their two indices, as arrays without strides. All
maps continue over their sides; walls are links of 0.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.micro.gap_pools import Pools
from patchlaw.support import Array

Offset = tuple[int, int]
Parts = dict[Offset, NDArray[np.floating]]
Shape = tuple[int, int, int]

PARITIES: tuple[Offset, ...] = ((0, 0), (1, 1), (0, 1), (1, 0))
"""Order in which cells are relaxed: those of the first two and of the last two, on the finest grid,
have no links among themselves."""
_HALF = ((1, 0), (0, 1), (1, 1), (-1, 1))
"""Half of the neighbours of a cell; links to the others are the same, seen from there."""
_SHARE = 1e-5
"""Links to both sides besides, over the sum of all links of a cell. Eight flows through maps of
256² and 512² cells, 2 and 20 % in contact, took 7 to 12 iterations with 10⁻⁵, 7 to 18 with 10⁻⁴ and
7 to 21 with 10⁻³; some took more than 40 without."""
COARSEST = 8
"""Cells of the coarsest grid along its longer side at most, whose inverse is made."""
_WITH_POOLS = 2
"""Number of the grid, 0 for the finest, whose pools are corrected besides. Smaller pools have cells
of their own until there; larger ones took 22 iterations in place of 18 where it was the third."""
_LEAST = 1e-26
"""Sum of a cell's links, over the largest link, below which it counts as closed: single precision
holds what `_inverse` makes of it."""


def shifted(values: NDArray[Any], offset: Offset) -> NDArray[Any]:
    """Return what lies at an offset from each cell."""
    i, j = offset
    if i:
        values = np.concatenate((values[..., i:, :], values[..., :i, :]), -2)
    if j:
        values = np.concatenate((values[..., j:], values[..., :j]), -1)
    return values


def _wide(values: NDArray[Any]) -> NDArray[Any]:
    """Return values with a line of those beyond each side, shape (n, nx + 2, ny + 2)."""
    values = np.concatenate((values[:, -1:], values, values[:, :1]), 1)
    return np.concatenate((values[..., -1:], values, values[..., :1]), 2)


def _halves(x: int, y: int) -> tuple[Offset, Offset]:
    """Return the parity of an offset, and the cells of the next coarser grid that it is away."""
    return (x % 2, y % 2), (x // 2, y // 2)


def padded(values: Array) -> Array:
    """Return maps of cells, shape (n, nx, ny), with a line of 0 at two sides, in one row each."""
    count, nx, ny = values.shape
    found = np.zeros((count, nx + 1, ny + 1))
    found[:, :nx, :ny] = values
    return found.reshape(count, -1)


class Cells:
    """Values of cells by parity, with a line of those beyond the side that others look at.

    Those of one parity and their neighbours are parts of arrays without strides, at an offset, so
    that operations take one loop. What they leave in the place of lines is renewed by `wrap`.

    Args:
        shape: Directions and cells of one parity along both sides.
        dtype: Type of numbers.
        values: Values of all cells, shape (n, nx, ny), 0 when not given.

    Attributes:
        own: Values of cells of each parity, as `padded` ones.
    """

    def __init__(self, shape: Shape, dtype: type, values: Array | None = None) -> None:
        count, nx, ny = shape
        self._shape, self._size, self._wide = shape, count * (nx + 1) * (ny + 1), ny + 1
        self._whole: NDArray[Any] = np.zeros((len(PARITIES), self._size + ny + 2), dtype)
        self._maps = self._whole[:, : self._size].reshape(-1, count, nx + 1, ny + 1)
        self.own = {one: self.seen(one, (0, 0)) for one in PARITIES}
        if values is not None:
            for (i, j), own in self.own.items():
                inside(own, shape)[:] = values[:, i::2, j::2]
                self.wrap((i, j))

    def seen(self, parity: Offset, offset: Offset) -> NDArray[Any]:
        """Return values at an offset from cells of a parity, as `padded` ones."""
        ways = zip(parity, offset, strict=True)
        row, column = (one if to == 0 else (to + 1) // 2 for one, to in ways)
        other = PARITIES.index(_halves(parity[0] + offset[0], parity[1] + offset[1])[0])
        values = self._whole[other, row * self._wide + column :]
        return values[: self._size].reshape(self._shape[0], -1)

    @cached_property
    def beside(self) -> dict[Offset, Parts]:
        """What `seen` returns, by parity and offset."""
        offsets = list(product((-1, 0, 1), (-1, 0, 1)))
        return {one: {key: self.seen(one, key) for key in offsets} for one in PARITIES}

    def single(self) -> Cells:
        """Return the same in single precision."""
        found = Cells(self._shape, np.float32)
        found._whole[:] = self._whole
        return found

    def wrap(self, parity: Offset) -> None:
        """Renew the line beyond the side."""
        values = self._maps[PARITIES.index(parity)]
        to, of = (0, -1) if parity[0] else (-1, 0)
        values[:, to] = values[:, of]
        to, of = (0, -1) if parity[1] else (-1, 0)
        values[:, :, to] = values[:, :, of]


def inside(values: NDArray[Any], shape: Shape) -> NDArray[Any]:
    """Return the maps in an array of `padded` ones, which they share.

    Args:
        values: See `padded`.
        shape: Shape of the maps.
    """
    count, nx, ny = shape
    return values.reshape(count, nx + 1, ny + 1)[:, :nx, :ny]


class _Grid:
    """One grid of the hierarchy.

    Args:
        links: Links of cells to neighbours by their offset, 2 or 4 of `_HALF`, and at (0, 0) the
            sum of all links of a cell, shape (n, nx, ny). Emptied, which frees them.

    Attributes:
        links: Those of cells of each parity to all neighbours, as `padded` ones, with anything in
            the lines at their sides.
        diagonal: Sums of all links of cells of each parity, `padded`.
        inverse: Their inverses, 0 in closed cells; kept where it does not relax them.
        right: Where to put a right side for the cycle.
        change: Where a coarser grid reads its right side, and puts what it finds.
    """

    def __init__(self, links: Parts) -> None:
        count, nx, ny = links[0, 0].shape
        self.shape = shape = count, nx // 2, ny // 2
        sums = links.pop((0, 0))
        self.diagonal = {(i, j): padded(sums[:, i::2, j::2]) for i, j in PARITIES}
        del sums
        among = 2 if len(links) == 2 else 1
        self._first, self._last = PARITIES[:among], PARITIES[-among:]
        self._links = [(key, Cells(shape, float, links.pop(key))) for key in list(links)]
        self.links = self._both_ways()
        self.inverse = {one: self._over(1.0, self.diagonal[one], one) for one in PARITIES}
        self.weights = self._weights(self.inverse)

    def relaxes_alone(self, entirely: bool) -> None:
        """Let it relax, in single precision, and free what only coarser grids are made from.

        Args:
            entirely: Whether to free what iterations on the finest grid and pools need, too.
        """
        rows, (count, nx, ny), among = self.diagonal[0, 0].shape, self.shape, len(self._first)
        size = rows[0] * rows[1]
        coarse: NDArray[Any] = np.zeros(size + ny + 2, np.float32)
        self._coarse = coarse[:size].reshape(count, nx + 1, ny + 1)
        self.change = self._coarse[:, :-1, :-1]
        self._weights_of = {
            one: [
                (coarse[i * (ny + 1) + j :][:size].reshape(rows), weight.astype(np.float32))
                for (i, j), weight in self.weights[one].items()
            ]
            for one in PARITIES[1:-among]
        }
        self.weights.clear()
        relaxed = PARITIES[-2:] if among == 2 else PARITIES
        self._inverse = {one: self.inverse.pop(one).astype(np.float32) for one in relaxed}
        self.right: Parts = {one: np.zeros(rows, np.float32) for one in relaxed}
        self._from_others = {
            one: [(_halves(one[0] + i, one[1] + j)[0], link, (i, j)) for (i, j), link in seen]
            for one, seen in ((one, s.items()) for one, s in self._both_ways(single=True).items())
        }
        self.found = Cells(self.shape, np.float32)
        self._total, self._work = (np.empty(rows, np.float32) for _ in range(2))
        if entirely:
            self.links.clear()
            self.diagonal.clear()
        self._links.clear()

    def _both_ways(self, *, single: bool = False) -> dict[Offset, Parts]:
        """Return all links of cells of each parity."""
        found: dict[Offset, Parts] = {one: {} for one in PARITIES}
        for key, cells in self._links:
            values, other = cells.single() if single else cells, (-key[0], -key[1])
            for one, seen in found.items():
                seen |= {key: values.own[one], other: values.seen(one, other)}
        return found

    def inside(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the maps of cells of one parity in an array of `padded` ones."""
        return inside(values, self.shape)

    def _over(self, values: Array | float, by: Array, parity: Offset) -> Array:
        """Return values over others in open cells of a parity, 0 in closed ones."""
        is_open = self.diagonal[parity] > _LEAST
        return np.divide(values, by, out=np.zeros(by.shape), where=is_open)

    def _weights(self, inverse: Parts) -> dict[Offset, Parts]:
        """Return weights of coarse cells in cells of each parity, by how far they are away."""
        found: dict[Offset, Parts] = {(0, 0): {(0, 0): padded(np.ones(self.shape))}}
        for axis, parity in enumerate(((1, 0), (0, 1))):
            links, diagonal = self.links[parity], self.diagonal[parity]
            sides = [
                _SHARE * diagonal + sum(link for key, link in links.items() if key[axis] == side)
                for side in (-1, 1)
            ]
            terminals = np.maximum(diagonal - sum(links.values()), 0.0)
            whole = sides[0] + sides[1] + terminals
            first, second = (self._over(side, whole, parity) for side in sides)
            found[parity] = {(0, 0): first, parity: second}
        middle: Parts = {}
        for key, link in self.links[1, 1].items():
            other, base = _halves(1 + key[0], 1 + key[1])
            for coarse, weight in found[other].items():
                to = base[0] + coarse[0], base[1] + coarse[1]
                beside = padded(shifted(self.inside(weight), base))
                middle[to] = middle.get(to, 0.0) + link * inverse[1, 1] * beside
        found[1, 1] = middle
        return found

    def coarser(self) -> Parts:
        """Return links of the next coarser grid, as it takes them.

        Nothing flows out of cells of parity (1, 1), whose weights are what balances them.
        """
        wide = {
            (one[0] - 2 * i, one[1] - 2 * j): _wide(shifted(self.inside(weight), (-i, -j)))
            for one in PARITIES
            for (i, j), weight in self.weights[one].items()
        }  # weights of each cell of the coarser grid in the cells around it
        found: Parts = {key: np.zeros(self.shape) for key in ((0, 0), *_HALF)}
        (_, nx, ny), work = self.shape, np.empty(self.shape)
        for place, weight in wide.items():
            one, base = _halves(*place)
            if one == (1, 1):
                continue
            rows: Parts = {}  # what flows out of the cell there per potential of coarse cells
            entries = {(0, 0): -self.diagonal[one], **self.links[one]}
            for key, entry in entries.items():
                value = shifted(self.inside(entry), base)
                to = place[0] + key[0], place[1] + key[1]
                for x, y in product(*((0,) if k % 2 == 0 else (-1, 1) for k in to)):
                    i, j = (to[0] - x) // 2, (to[1] - y) // 2
                    if (i, j) in found:
                        beside = wide[x, y][:, 1 + i : 1 + i + nx, 1 + j : 1 + j + ny]
                        if (i, j) in rows:
                            rows[i, j] += np.multiply(value, beside, out=work)
                        else:
                            rows[i, j] = value * beside
            for key, row in rows.items():
                found[key] += np.multiply(weight[:, 1:-1, 1:-1], row, out=row)
        np.negative(found[0, 0], out=found[0, 0])
        return found

    def pools(self) -> Pools:
        """Return its pools, with cells in the order of their parities."""
        count, links = int(np.prod(self.shape)), self.links
        each = np.arange(len(PARITIES) * count, dtype=np.intc).reshape(-1, *self.shape)
        numbers = dict(zip(PARITIES, each, strict=True))

        def beside(one: Offset, key: Offset) -> NDArray[Any]:
            of, base = _halves(one[0] + key[0], one[1] + key[1])
            return shifted(numbers[of], base)

        keys = list(links[0, 0])
        heads = np.array([[beside(one, key) for one in PARITIES] for key in keys])
        widths = np.array([self.flat({one: links[one][key] for one in PARITIES}) for key in keys])
        diagonal = self.flat(self.diagonal)
        open_links = np.where(diagonal > _LEAST, diagonal, 0.0)
        return Pools(heads.reshape(widths.shape), widths, open_links)

    def flat(self, parts: Parts) -> NDArray[np.floating]:
        """Return values of cells in the order of their parities."""
        return np.concatenate([self.inside(parts[one]).ravel() for one in PARITIES])

    def put(self, values: Array, parts: Parts) -> None:
        """Write values of cells, in the order of their parities, into parts."""
        for one, part in zip(PARITIES, np.split(values, len(PARITIES)), strict=True):
            self.inside(parts[one])[:] = part.reshape(self.shape)

    def _from(self, parity: Offset, others: Sequence[Offset]) -> NDArray[np.floating] | None:
        """Return what flows into cells of a parity from others, overwritten next time."""
        beside, out = self.found.beside[parity], self._total
        for other, link, key in self._from_others[parity]:
            if other in others:
                np.multiply(link, beside[key], out=out)
                if out is self._work:
                    self._total += out
                out = self._work
        return None if out is self._total else self._total

    def _relax(self, right: Parts, parity: Offset, others: Sequence[Offset]) -> None:
        """Solve for the cells of a parity, with those of others as they are."""
        into = self._from(parity, others)
        total = right[parity] if into is None else np.add(into, right[parity], out=into)
        np.multiply(total, self._inverse[parity], out=self.found.own[parity])
        self.found.wrap(parity)

    def before(self, right: Parts) -> None:
        """Relax all cells once, from zero, and put the residual where the coarser grid reads it."""
        done: list[Offset] = []
        for parity in right:
            self._relax(right, parity, () if parity in self._first else done)
            done.append(parity)
        coarse = self._coarse
        for count, parity in enumerate(PARITIES[: -len(self._last)]):
            residual = self._from(parity, PARITIES[count + 1 :])  # as later ones came after it
            assert residual is not None
            if parity == (0, 0):
                coarse[:] = residual.reshape(coarse.shape)
                coarse[:, -1] = coarse[..., -1] = 0.0
                continue
            for beside, weight in self._weights_of[parity]:
                beside += np.multiply(weight, residual, out=self._work)
        coarse[:, 0] += coarse[:, -1]
        coarse[..., 0] += coarse[..., -1]

    def after(self, right: Parts) -> None:
        """Add the change that a coarser grid found, and relax all cells once in reverse order."""
        coarse = self._coarse
        coarse[:, -1] = coarse[:, 0]
        coarse[..., -1] = coarse[..., 0]
        for parity in PARITIES[: -len(self._last)]:  # others are relaxed first, whatever they are
            own = self.found.own[parity]
            if parity not in right:
                own[:] = 0.0
            if parity == (0, 0):
                own += coarse.reshape(own.shape)
            else:
                for beside, weight in self._weights_of[parity]:
                    own += np.multiply(weight, beside, out=self._work)
            self.found.wrap(parity)
        for parity in reversed(right):
            self._relax(right, parity, PARITIES)


class Cycle:
    """A V-cycle of all grids, symmetric.

    Args:
        links: See `_Grid`.
    """

    def __init__(self, links: Parts) -> None:
        self.grids = [_Grid(links)]
        self._pools: Pools | None = None
        while max(self.grids[-1].shape[1:]) > COARSEST:
            coarser = self.grids[-1].coarser()
            self.grids[-1].relaxes_alone(len(self.grids) - 1 not in (0, _WITH_POOLS))
            self.grids.append(_Grid(coarser))
        self._inverse = _inverse(self.grids[-1].coarser()).astype(np.float32)
        self.grids[-1].relaxes_alone(len(self.grids) - 1 not in (0, _WITH_POOLS))

    def with_pools(self) -> bool:
        """Let cycles correct pools, too; return whether they do so from here on."""
        if self._pools or len(self.grids) <= _WITH_POOLS:
            return False
        self._pools = self.grids[_WITH_POOLS].pools()
        return True

    def __call__(self, right: Parts, depth: int = 0) -> Parts:
        """Return an approximate solution, which is overwritten next time.

        Args:
            right: Right side by parity, in single precision.
            depth: Number of the grid, 0 for the finest.
        """
        grid, pools = self.grids[depth], self._pools if depth == _WITH_POOLS else None
        if pools:
            changes, left = pools.changes(grid.flat(right))
            grid.put(left, right)
        grid.before(right)
        if depth + 1 < len(self.grids):
            coarser = self.grids[depth + 1]
            for (i, j), part in coarser.right.items():
                coarser.inside(part)[:] = grid.change[:, i::2, j::2]
            for (i, j), part in self(coarser.right, depth + 1).items():
                grid.change[:, i::2, j::2] = coarser.inside(part)
        else:
            flat = grid.change.reshape(len(grid.change), -1, 1)
            grid.change[:] = (self._inverse @ flat).reshape(grid.change.shape)
        grid.after(right)
        found = grid.found.own
        if pools:
            grid.put(pools.balanced(grid.flat(found), changes), found)
        return found


def _inverse(links: Parts) -> Array:
    """Return inverses of matrices of small grids, shape (n, m, m), from what `_Grid` takes."""
    diagonal = links.pop((0, 0))
    count, size = len(diagonal), diagonal[0].size
    index, flat = np.arange(size).reshape(diagonal.shape[1:]), diagonal.reshape(count, -1)
    is_open, matrix = flat > _LEAST, np.zeros((count, size, size))
    scale = 1.0 / np.sqrt(np.where(is_open, flat, 1.0))
    for key, link in links.items():
        ends = index.ravel(), shifted(index, key).ravel()
        for places in (ends, ends[::-1]):
            np.subtract.at(matrix, (slice(None), *places), link.reshape(count, -1))
    matrix *= scale[:, :, None] * scale[:, None, :]
    matrix[:, index.ravel(), index.ravel()] += 1.0 + 1e-12  # where rounding left no link outwards
    scale = np.where(is_open, scale, 0.0)
    inverse = np.linalg.inv(matrix) * scale[:, :, None] * scale[:, None, :]
    return 0.5 * (inverse + inverse.swapaxes(1, 2))
