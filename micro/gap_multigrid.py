"""Multigrid for flows through maps of cells whose conductivities differ by many powers of ten.

Every second cell along both sides is a cell of the next coarser grid; what lies between takes the
mean of those beside it, weighted by the links to them (black-box multigrid: Alcouffe, Brandt, Dendy
& Painter 1981, doi 10.1137/0902035; Dendy 1982, doi 10.1016/0021-9991(82)90057-2), and coarser
grids have the operator that follows. Pools of fluid between contact that no coarse cell lies in,
or that are linked to one by a narrow link alone, would be lost so: cells have a small link to both
sides besides (`_SHARE`), by which a coarse cell in contact can stand for the pool beside it.

One cycle, in single precision, preconditions conjugate gradients in double precision. Flows in
several directions are solved together, as arrays whose first axis is the direction.

Cells are stored by the parity (even or odd) of their two indices, as arrays without strides. All
maps continue over their sides; walls are links of 0.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse import csgraph

from patchlaw.support import Array

Offset = tuple[int, int]
Parts = dict[Offset, NDArray[np.floating]]

_PARITIES: tuple[Offset, ...] = ((0, 0), (1, 1), (0, 1), (1, 0))
"""Order in which cells are relaxed: those of the first two and of the last two, on the finest grid,
have no links among themselves."""
_BETWEEN, _SOLVED = _PARITIES[:2], _PARITIES[2:]
_HALF = ((1, 0), (0, 1), (1, 1), (-1, 1))
"""Half of the neighbours of a cell; links to the others are the same, seen from there."""
_SHARE = 1e-5
"""Links to both sides besides, over the sum of all links of a cell. Eight flows through maps of
256² and 512² cells, 2 and 20 % in contact, took 7 to 12 iterations with 10⁻⁵, 7 to 18 with 10⁻⁴ and
7 to 21 with 10⁻³; some took more than 40 without."""
_COARSEST = 8
"""Cells of the coarsest grid along its longer side at most, whose inverse is made."""
_LEAST = 1e-30
"""Sum of a cell's links, over the largest link, below which it counts as closed."""
_MOST_TOGETHER = 192**2
"""Cells up to which directions are solved together. More than that of one fill a core's cache."""
_MOST_ITERATIONS = 100
"""Iterations end when the last quarter of them, two at least, changed the flow by the tolerance of
it. With 10⁻⁷ that left 2 · 10⁻¹³ of the flow in the median of 228 on 73² to 140² cells, 5 to 62 %
in contact, and 8 · 10⁻¹⁰ in 95 %; by the last two changes alone 2 · 10⁻¹¹ and 6 · 10⁻⁸, and
3 · 10⁻⁵ on a map that took 51 iterations. With 10⁻⁴ it left 10⁻⁸ of 375 flows in the median and
6 · 10⁻⁷ in 95 %, 5 · 10⁻⁵ at most of ridges and of cells of unlike gaps. Beside conductivities so
unlike that the flow is 10⁻⁸ of that through the widest cell, rounding leaves 10⁻⁶ to 3 · 10⁻⁵ of
it, and 10⁻⁴ beside 10⁻¹⁰."""
_IMBALANCE, _MOST_IMBALANCE = 300.0, 1.0
"""What enters and leaves cells may differ by so many times the root of the tolerance, times the
flow, then, and by so much at most, summed over all of them. The flow errs by as much at most, as
potentials lie between those of the terminals, and by about its square as a rule. By changes alone,
iterations that stood still ended at up to 10⁹ times the flow, all with an imbalance above 1."""


def cell_flows(
    gap: Array,
    lengths: tuple[float, float],
    axes: Sequence[int],
    *,
    periodic: bool,
    tolerance: float = 1e-7,
) -> list[tuple[Array, float]] | None:
    """Return fluid pressures of cells and flows along axes between pressures of 1 and 0.

    Args:
        gap: Gaps of the cells, 0 in contact, shape (nx, ny) [mm].
        lengths: Sides of the map [mm].
        axes: 0 for a flow along x, 1 along y.
        periodic: Whether the map continues over the sides along the flow.
        tolerance: See `potentials`.

    Returns:
        For each axis pressures, shape (nx, ny), NaN where no path from a side leads, and the flow
        [mm³]; None where iterations do not converge.
    """
    size, pressures, flowing = float(gap.max(initial=0.0)), [], []
    pools, count = ndimage.label(gap > 0.0)
    for axis in axes:
        joined = _joined(pools, count, 1 - axis) if periodic else np.arange(count + 1)
        ends = [joined[np.unique(pools.take(side, axis))] for side in (0, -1)]
        by_pool, through = np.full(count + 1, np.nan), np.intersect1d(*ends)
        for one, value in zip(ends, (1.0, 0.0), strict=True):
            by_pool[np.isin(joined, one)] = value
        by_pool[0] = np.nan
        pressures.append(by_pool[pools])
        flowing.append(np.isin(joined, through[through > 0])[pools])
    flows, ways = np.zeros(len(axes)), [k for k, cells in enumerate(flowing) if cells.any()]
    for some in filter(None, [[k] for k in ways] if gap.size > _MOST_TOGETHER else [ways]):
        maps = [_links(gap / size * flowing[k], lengths, axes[k], periodic) for k in some]
        links = [np.array(one) for one in zip(*maps, strict=True)]
        maps.clear()
        solved = potentials(links, tolerance)
        if solved is None:
            return None
        flows[some] = solved[1] * size**3
        for k, potential in zip(some, solved[0], strict=True):
            pressures[k][flowing[k]] = np.clip(potential[flowing[k]], 0.0, 1.0)
    return list(zip(pressures, flows.tolist(), strict=True))


def _joined(pools: NDArray[np.integer], count: int, axis: int) -> NDArray[np.integer]:
    """Return a number for each pool that those share which paths over sides join, 0 for contact.

    Args:
        pools: Number of the pool that a cell belongs to, 0 for contact, shape (nx, ny).
        count: How many there are.
        axis: Axis along which the map continues over its sides.
    """
    pairs = np.stack([pools.take(0, axis), pools.take(-1, axis)])
    pairs = np.unique(pairs[:, pairs.all(axis=0)], axis=1)
    graph = sparse.coo_matrix((np.ones(pairs.shape[1]), pairs), (count + 1, count + 1))
    joined = 1 + csgraph.connected_components(graph, False)[1]
    joined[0] = 0
    return np.asarray(joined)


def _links(
    gap: Array, lengths: tuple[float, float], axis: int, periodic: bool
) -> list[Array]:
    """Return links along x and y, to the source and to the sink, as `potentials` takes them."""
    shape = gap.shape
    wide = lengths[1] / shape[1] / (lengths[0] / shape[0])
    widths = wide, 1.0 / wide
    with np.errstate(divide="ignore"):
        half = 0.5 / (gap * gap * gap)  # of the way between centres lies in each of two cells
    found = []
    for along in (0, 1):
        links = widths[along] / (half + np.roll(half, -1, along))
        if along == axis or not periodic:
            np.moveaxis(links, along, 0)[-1] = 0.0
        found.append(links)
    for side in (0, -1):
        links = np.zeros(shape)
        np.moveaxis(links, axis, 0)[side] = widths[axis] / half.take(side, axis)
        found.append(links)
    return found


def potentials(given: list[Array], tolerance: float) -> tuple[Array, Array] | None:
    """Return potentials of cells, and the flows between two terminals of potential 1 and 0.

    The flow is the power that the potentials dissipate, whose error is of second order in theirs.

    Args:
        given: Links of each cell to the next one along x, from the last to the first, the same
            along y, links to the terminal of potential 1 and to that of 0; for n directions of flow
            shape (n, nx, ny) each. 1 is about the largest. Emptied, which frees them.
        tolerance: Error of the flows that does no harm, relative to them.

    Returns:
        Potentials, 0 where no link leads, shape (n, nx, ny), and flows, shape (n,); None where
        iterations do not converge.
    """
    (along_x, along_y, source, sink), kept = _even(given)
    given.clear()
    links = {(1, 0): along_x, (0, 1): along_y}
    diagonal = sum(link + _at(link, (-i, -j)) for (i, j), link in links.items()) + source + sink
    cycle = _Cycle(links, diagonal)
    del along_x, along_y, links, diagonal  # which the cycle has as it needs them
    iteration = _Iteration(cycle, source)
    least = 1e-15 * source.sum(axis=(1, 2))  # what rounding leaves of the flow
    most = min(_IMBALANCE * np.sqrt(tolerance), _MOST_IMBALANCE)
    for count in range(_MOST_ITERATIONS):
        changes = iteration.step()
        left = np.maximum(changes / tolerance, iteration.imbalance / most)
        if count and (left <= np.maximum(iteration.flow, least)).all():
            found, flow = iteration.found(sink)
            if (left <= flow).all():
                return found[:, kept[0]][:, :, kept[1]], flow
    return None


def _even(links: list[Array]) -> tuple[list[Array], list[Any]]:
    """Return the same with sides that can be halved until the coarsest grid, and which cells stay.

    Rows that are added lie, evenly spread, in the links from some to the next, which they divide.
    Many between two others would be chains side by side without links, of which coarser grids lose
    every second one.

    Args:
        links: Those along x and y, to the source and to the sink, as `potentials` takes them.
    """
    halvings = int(np.ceil(np.log2(max(*links[0].shape[1:], _COARSEST) / _COARSEST)))
    kept: list[Any] = []
    for axis, count in enumerate(links[0].shape[1:], start=1):
        most = count + -count % 2 ** max(halvings, 1)
        if most == count:
            kept.append(slice(None))
            continue
        order = np.arange(most) * count // most
        kept.append(np.diff(order, prepend=-1) > 0)
        times = np.bincount(order)[order]  # links in series in place of one
        for k, values in enumerate(links):
            factor = times if k + 1 == axis else kept[-1]
            wide = values.take(order, axis)
            links[k] = wide * (factor[:, None] if axis == 1 else factor)
    return links, kept


def _at(values: NDArray[Any], offset: Offset) -> NDArray[Any]:
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


class _Cells:
    """Values of cells by parity, with a line of those beyond the side that others look at.

    Args:
        shape: Directions and cells of one parity along both sides.
        dtype: Type of numbers.
    """

    def __init__(self, shape: tuple[int, ...], dtype: type) -> None:
        count, nx, ny = shape
        self._all: Parts = {one: np.zeros((count, nx + 1, ny + 1), dtype) for one in _PARITIES}

        def seen(parity: int, offset: int, cells: int) -> slice:
            first = parity if offset == 0 else (offset + 1) // 2
            return slice(first, first + cells)

        self.beside: dict[Offset, Parts] = {one: {} for one in _PARITIES}
        for one, i, j in product(_PARITIES, (-1, 0, 1), (-1, 0, 1)):
            offset = i, j
            other = _halves(one[0] + i, one[1] + j)[0]
            cut = (seen(*each) for each in zip(one, offset, (nx, ny), strict=True))
            self.beside[one][offset] = self._all[other][:, *cut]
        self.own = {one: self.beside[one][0, 0] for one in _PARITIES}

    def wrap(self, parity: Offset) -> None:
        """Renew the line beyond the side."""
        values = self._all[parity]
        to, of = (0, -1) if parity[0] else (-1, 0)
        values[:, to] = values[:, of]
        to, of = (0, -1) if parity[1] else (-1, 0)
        values[:, :, to] = values[:, :, of]


def _both_ways(half: dict[Offset, Parts]) -> dict[Offset, Parts]:
    """Return all links of cells of each parity, from half of them by offset and parity."""
    found: dict[Offset, Parts] = {one: {} for one in _PARITIES}
    for one, ((i, j), parts) in product(_PARITIES, half.items()):
        other, base = _halves(one[0] - i, one[1] - j)
        found[one] |= {(i, j): parts[one], (-i, -j): _at(parts[other], base)}
    return found


class _Grid:
    """One grid of the hierarchy.

    Args:
        links: Links of cells to neighbours by their offset, 2 or 4 of `_HALF`, shape (n, nx, ny).
        diagonal: Sum of all links of a cell.
    """

    def __init__(self, links: Parts, diagonal: Array) -> None:
        def split(values: Array) -> Parts:
            return {(i, j): np.ascontiguousarray(values[:, i::2, j::2]) for i, j in _PARITIES}

        self.diagonal, half = split(diagonal), {key: split(one) for key, one in links.items()}
        self.links = _both_ways(half)
        self.shape = self.diagonal[0, 0].shape
        self.inverse = {one: self._over(1.0, self.diagonal[one], one) for one in _PARITIES}
        self.weights = self._weights(self.inverse)
        self.found, self._work = _Cells(self.shape, np.float32), np.empty(self.shape, np.float32)
        self._inverse = {one: values.astype(np.float32) for one, values in self.inverse.items()}
        low = {
            key: {one: link.astype(np.float32) for one, link in parts.items()}
            for key, parts in half.items()
        }
        self._low = {
            one: [
                (_halves(one[0] + key[0], one[1] + key[1])[0], link, key)
                for key, link in seen.items()
            ]
            for one, seen in _both_ways(low).items()
        }
        self._low_weights = {
            one: [(key, weight.astype(np.float32)) for key, weight in self.weights[one].items()]
            for one in _PARITIES
        }
        among = 2 if len(links) == 2 else 1
        self._first, self._last = _PARITIES[:among], _PARITIES[-among:]

    def _over(self, values: Array | float, by: Array, parity: Offset) -> Array:
        """Return values over others in open cells of a parity, 0 in closed ones."""
        is_open = self.diagonal[parity] > _LEAST
        return np.divide(values, by, out=np.zeros(self.shape), where=is_open)

    def _weights(self, inverse: Parts) -> dict[Offset, Parts]:
        """Return weights of coarse cells in cells of each parity, by how far they are away."""
        found: dict[Offset, Parts] = {(0, 0): {(0, 0): np.ones(self.shape)}}
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
                middle[to] = middle.get(to, 0.0) + link * inverse[1, 1] * _at(weight, base)
        found[1, 1] = middle
        return found

    def coarser(self) -> tuple[Parts, Array]:
        """Return links and diagonal of the next coarser grid.

        Nothing flows out of cells of parity (1, 1), whose weights are what balances them.
        """
        weights = {
            (one[0] - 2 * key[0], one[1] - 2 * key[1]): _at(weight, (-key[0], -key[1]))
            for one in _PARITIES
            for key, weight in self.weights[one].items()
        }  # of each cell of the coarser grid in the cells around it
        wide = {key: _wide(one) for key, one in weights.items()}
        found: Parts = {key: np.zeros(self.shape) for key in ((0, 0), *_HALF)}
        (_, nx, ny), work = self.shape, np.empty(self.shape)
        for place, weight in weights.items():
            one, base = _halves(*place)
            if one == (1, 1):
                continue
            rows: Parts = {}  # what flows out of the cell there per potential of coarse cells
            entries = {(0, 0): -self.diagonal[one], **self.links[one]}
            for key, entry in entries.items():
                value, to = _at(entry, base), (place[0] + key[0], place[1] + key[1])
                for x, y in product(*((0,) if k % 2 == 0 else (-1, 1) for k in to)):
                    i, j = (to[0] - x) // 2, (to[1] - y) // 2
                    if (i, j) in found:
                        beside = wide[x, y][:, 1 + i : 1 + i + nx, 1 + j : 1 + j + ny]
                        if (i, j) in rows:
                            rows[i, j] += np.multiply(value, beside, out=work)
                        else:
                            rows[i, j] = value * beside
            for key, row in rows.items():
                found[key] += np.multiply(weight, row, out=row)
        return found, -found.pop((0, 0))

    def relaxes_alone(self, entirely: bool) -> None:
        """Free what only coarser grids are made from, and iterations on the finest one need."""
        self.weights.clear()
        if entirely:
            for values in (self.links, self.diagonal, self.inverse):
                values.clear()

    def _from(self, parity: Offset, others: Sequence[Offset]) -> NDArray[np.floating] | None:
        """Return what flows into cells of a parity from others, themselves at 0."""
        total, beside = None, self.found.beside[parity]
        for other, link, key in self._low[parity]:
            if other in others:
                if total is None:
                    total = link * beside[key]
                else:
                    total += np.multiply(link, beside[key], out=self._work)
        return total

    def _relax(self, right: Parts, parity: Offset, others: Sequence[Offset]) -> None:
        """Solve for the cells of a parity, with those of others as they are."""
        into = self._from(parity, others)
        total = right[parity] if into is None else np.add(into, right[parity], out=into)
        np.multiply(total, self._inverse[parity], out=self.found.own[parity])
        self.found.wrap(parity)

    def before(self, right: Parts) -> NDArray[np.floating]:
        """Relax all cells once, from zero, and return the residual of the next coarser grid."""
        done: list[Offset] = []
        for parity in right:
            self._relax(right, parity, () if parity in self._first else done)
            done.append(parity)
        coarse = None
        for count, parity in enumerate(_PARITIES[: -len(self._last)]):
            residual = self._from(parity, _PARITIES[count + 1 :])  # as later ones came after it
            assert residual is not None
            if coarse is None:
                coarse = residual
                continue
            for (i, j), weight in self._low_weights[parity]:
                coarse += _at(np.multiply(weight, residual, out=self._work), (-i, -j))
        assert coarse is not None
        return coarse

    def after(self, right: Parts, change: NDArray[np.floating]) -> None:
        """Add the change that a coarser grid found, and relax all cells once in reverse order."""
        wide, (_, nx, ny) = _wide(change), self.shape
        for parity in _PARITIES[: -len(self._last)]:  # others are relaxed first, whatever they are
            own = self.found.own[parity]
            if parity not in right:
                own[:] = 0.0
            for (i, j), weight in self._low_weights[parity]:
                beside = wide[:, 1 + i : 1 + i + nx, 1 + j : 1 + j + ny]
                own += np.multiply(weight, beside, out=self._work)
            self.found.wrap(parity)
        for parity in reversed(right):
            self._relax(right, parity, _PARITIES)


class _Cycle:
    """A V-cycle of all grids, symmetric.

    Args:
        links: See `_Grid`.
        diagonal: Likewise.
    """

    def __init__(self, links: Parts, diagonal: Array) -> None:
        self.grids = [_Grid(links, diagonal)]
        while max(self.grids[-1].shape[1:]) > _COARSEST:
            coarser = self.grids[-1].coarser()
            self.grids[-1].relaxes_alone(len(self.grids) > 1)
            self.grids.append(_Grid(*coarser))
        self._inverse = _inverse(*self.grids[-1].coarser()).astype(np.float32)

    def __call__(self, right: Parts, depth: int = 0) -> Parts:
        """Return an approximate solution, which is overwritten next time.

        Args:
            right: Right side by parity, in single precision.
            depth: Number of the grid, 0 for the finest.
        """
        grid = self.grids[depth]
        coarse = grid.before(right)
        change = np.empty_like(coarse)
        if depth + 1 < len(self.grids):
            parts = {(i, j): np.ascontiguousarray(coarse[:, i::2, j::2]) for i, j in _PARITIES}
            for (i, j), part in self(parts, depth + 1).items():
                change[:, i::2, j::2] = part
        else:
            flat = coarse.reshape(len(coarse), -1, 1)
            change[:] = (self._inverse @ flat).reshape(coarse.shape)
        grid.after(right, change)
        return grid.found.own


def _inverse(links: Parts, diagonal: Array) -> Array:
    """Return inverses of matrices of small grids, shape (n, m, m)."""
    count, size = len(diagonal), diagonal[0].size
    index, flat = np.arange(size).reshape(diagonal.shape[1:]), diagonal.reshape(count, -1)
    is_open, matrix = flat > _LEAST, np.zeros((count, size, size))
    scale = 1.0 / np.sqrt(np.where(is_open, flat, 1.0))
    for key, link in links.items():
        ends = index.ravel(), _at(index, key).ravel()
        for places in (ends, ends[::-1]):
            np.subtract.at(matrix, (slice(None), *places), link.reshape(count, -1))
    matrix *= scale[:, :, None] * scale[:, None, :]
    matrix[:, index.ravel(), index.ravel()] += 1.0 + 1e-12  # where rounding left no link outwards
    scale = np.where(is_open, scale, 0.0)
    inverse = np.linalg.inv(matrix) * scale[:, :, None] * scale[:, None, :]
    return 0.5 * (inverse + inverse.swapaxes(1, 2))


class _Iteration:
    """Conjugate gradients for the potentials of every second cell, from 0.

    The cells between, of the first two parities, have links to these and to terminals alone, and
    their potentials are those that balance them.

    Args:
        cycle: Preconditioner, whose finest grid is the problem.
        source: See `potentials`.

    Attributes:
        flow: Flows that potentials dissipate, to rounding of the sum of all links to the source.
    """

    def __init__(self, cycle: _Cycle, source: Array) -> None:
        self._cycle, self._grid = cycle, cycle.grids[0]
        shape = self._grid.shape
        self._all_of_source = source
        self._source = {(i, j): source[:, i::2, j::2] for i, j in _PARITIES}
        self._along, self._work = _Cells(shape, float), np.empty(shape)
        self.flow = source.sum(axis=(1, 2))
        self._balance(self._source)
        for one in _BETWEEN:
            self.flow -= np.einsum("nxy,nxy->n", self._source[one], self._along.own[one])
        self._residual = {one: self._into(one) + self._source[one] for one in _SOLVED}
        self._potential = {one: np.zeros(shape) for one in _SOLVED}
        self._right: Parts = {one: np.empty(shape, np.float32) for one in _SOLVED}
        self._before, self._changes = np.zeros(len(source)), list[Array]()

    def _into(self, parity: Offset) -> Array:
        """Return what flows into cells of a parity from their neighbours, themselves at 0."""
        beside, total = self._along.beside[parity], np.zeros(self._grid.shape)
        for key, link in self._grid.links[parity].items():
            total += np.multiply(link, beside[key], out=self._work)
        return total

    def _balance(self, source: Parts | None = None) -> None:
        """Let potentials between those of the others balance what flows, and comes from sources."""
        for one in _BETWEEN:
            into = self._into(one)
            if source is not None:
                into += source[one]
            np.multiply(into, self._grid.inverse[one], out=self._along.own[one])
            self._along.wrap(one)

    def step(self) -> Array:
        """Iterate once, and return what the last iterations changed the flows by."""
        residual, along = self._residual, self._along
        scale = np.max([np.abs(one).max(axis=(1, 2)) for one in residual.values()], axis=0)
        scale = scale[:, None, None] + np.finfo(float).tiny
        for one, right in self._right.items():
            np.divide(residual[one], scale, out=right, casting="same_kind")
        guess = self._cycle(self._right)
        steps = {one: guess[one] * scale for one in _SOLVED}
        now = _product(residual, steps)
        again = np.divide(now, self._before, out=np.zeros_like(now), where=self._before > 0.0)
        self._before = now
        for one, step in steps.items():
            own = along.own[one]
            own *= again[:, None, None]
            own += step
            along.wrap(one)
        self._balance()
        out = {one: self._grid.diagonal[one] * along.own[one] - self._into(one) for one in _SOLVED}
        power = _product(out, along.own)
        length = np.divide(now, power, out=np.zeros_like(now), where=power > 0.0)
        for one in _SOLVED:
            by = length[:, None, None]
            self._potential[one] += np.multiply(along.own[one], by, out=self._work)
            residual[one] -= np.multiply(out[one], by, out=self._work)
        self._changes.append(length * now)
        self.flow = self.flow - self._changes[-1]
        last = max(2, len(self._changes) // 4)
        return np.asarray(np.sum(self._changes[-last:], axis=0))

    @property
    def imbalance(self) -> Array:
        """Sum of the absolute differences of what enters and leaves all cells, shape (n,)."""
        return np.asarray(sum(np.abs(one).sum(axis=(1, 2)) for one in self._residual.values()))

    def found(self, sink: Array) -> tuple[Array, Array]:
        """Return the potential of all cells, shape (n, nx, ny), and the power it dissipates, (n,).

        Args:
            sink: See `potentials`.
        """
        grid, along = self._grid, self._along
        self._along = _Cells(grid.shape, float)
        for one, values in self._potential.items():
            self._along.own[one][:] = values
            self._along.wrap(one)
        self._balance(self._source)
        found = np.empty((grid.shape[0], 2 * grid.shape[1], 2 * grid.shape[2]))
        for (i, j), values in self._along.own.items():
            found[:, i::2, j::2] = values
        source = self._all_of_source
        flow = np.einsum("nxy,nxy->n", source, (1.0 - found) ** 2)
        flow += np.einsum("nxy,nxy,nxy->n", sink, found, found)
        for one in _BETWEEN:  # which all links lead from
            own = self._along.own[one]
            for key, link in grid.links[one].items():
                drop = np.subtract(own, self._along.beside[one][key], out=self._work)
                flow += np.einsum("nxy,nxy,nxy->n", link, drop, drop)
        self._along = along
        return found, flow


def _product(first: Parts, second: Parts) -> Array:
    """Return inner products of values of the cells that are solved for, shape (n,)."""
    return np.asarray(sum(np.einsum("nxy,nxy->n", first[one], second[one]) for one in _SOLVED))
