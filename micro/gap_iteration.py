"""Flows through maps of cells whose conductivities differ by many powers of ten.

Every second cell, as on a chess board, has links to the others alone. They are eliminated, and
conjugate gradients in double precision solve for the others, preconditioned by one cycle of
multigrid. Flows in several directions are solved together, as arrays whose first axis is the
direction.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy import ndimage

from patchlaw.micro.gap_cells import cell_links, joined_pools, turned
from patchlaw.micro.gap_multigrid import COARSEST, PARITIES, Cells, Cycle, Offset, Parts, shifted
from patchlaw.support import Array

_BETWEEN, _SOLVED = PARITIES[:2], PARITIES[2:]
"""Cells that are eliminated, and those that are solved for."""
_MOST_TOGETHER = 192**2
"""Cells up to which directions are solved together. More than that of one fill a core's cache."""
_MOST_ITERATIONS = 100
"""Iterations end when the last quarter of them, two at least, changed the flow by the tolerance of
it. With 10⁻⁷ that left, begun with no pressure, 2 · 10⁻¹³ of the flow in the median of 228 on 73²
to 140² cells, 5 to 62 % in contact, and 8 · 10⁻¹⁰ in 95 %; by the last two changes alone 2 · 10⁻¹¹
and 6 · 10⁻⁸, and 3 · 10⁻⁵ on a map that took 51 iterations."""
_MOST_PER_CELL = 0.3
"""How many of them at most per cell along the shorter side. Factors take as long as half of that.
Of 48 gaps on 73² to 140² cells both flows took 3.3 s of CPU so, 3.6 s without; of 30 others, whose
g³ differ by many powers of ten, 2.9 and 5.9 s."""
_IMBALANCE = 3.0
"""What enters and leaves cells may differ by so many times the root of the tolerance, times the
flow, then, summed over all of them. The flow errs by as much at most, as potentials lie between
those of the terminals, and by about its square as a rule. Iterations can stand still with a pool at
a wrong pressure, though: 34 flows through drawn gaps with 10⁻⁴ erred by 2 · 10⁻⁵ at most so, in 16
iterations in the mean, and in 13 by up to 3 % where the imbalance was allowed to be the flow."""
_PATIENCE = 5.0
"""Pools are corrected besides from where more iterations would be needed, if the imbalance went on
to fall as in the last two. That costs as much as two or three."""


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
    size, levels, flowing = float(gap.max(initial=0.0)), [], []
    pools, count = ndimage.label(gap > 0.0)
    for axis in axes:
        joined = joined_pools(pools, count, 1 - axis) if periodic else np.arange(count + 1)
        ends = [joined[np.unique(pools.take(side, axis))] for side in (0, -1)]
        by_pool, through = np.full(count + 1, np.nan), np.intersect1d(*ends)
        for one, value in zip(ends, (1.0, 0.0), strict=True):
            by_pool[np.isin(joined, one)] = value
        by_pool[0] = np.nan
        levels.append(by_pool)
        flowing.append(np.isin(joined, through[through > 0])[pools])
    flows, ways = np.zeros(len(axes)), [k for k, cells in enumerate(flowing) if cells.any()]
    found = {k: one[pools] for k, one in enumerate(levels) if k not in ways}
    for some in filter(None, [[k] for k in ways] if gap.size > _MOST_TOGETHER else [ways]):
        maps = [_links(gap / size * flowing[k], lengths, axes[k], periodic) for k in some]
        ends = [one.pop() for one in maps]
        links = [np.array([one.pop() for one in maps]) for _ in range(2)][::-1]
        solved = potentials(links, ends, [axes[k] for k in some], tolerance)
        if solved is None:
            return None
        flows[some] = solved[1] * size**3
        for k, potential in zip(some, solved[0], strict=True):
            found[k] = np.clip(potential, 0.0, 1.0, out=potential)
            np.copyto(potential, levels[k][pools], where=~flowing[k])
    return [(found[k], flow) for k, flow in enumerate(flows.tolist())]


def _links(gap: Array, lengths: tuple[float, float], axis: int, periodic: bool) -> list[Array]:
    """Return links along x and y, and those to source and sink, as `potentials` takes them."""
    gap, lengths = turned(gap, lengths, axis)
    along, across = cell_links(gap * gap * gap, lengths, periodic=periodic)
    ends = along[[0, -1]]
    along[-1] = 0.0
    return [*((across.T, along[1:].T) if axis else (along[1:], across)), ends]


def potentials(
    links: list[Array], ends: list[Array], axes: Sequence[int], tolerance: float
) -> tuple[Array, Array] | None:
    """Return potentials of cells, and the flows between two terminals of potential 1 and 0.

    The flow is the power that the potentials dissipate, whose error is of second order in theirs.

    Args:
        links: Links of each cell to the next one along x, from the last to the first, and the same
            along y, for n directions of flow shape (n, nx, ny) each. 1 is about the largest.
            Emptied, which frees them.
        ends: For each direction links of its first cells to the terminal of potential 1, and of its
            last ones to that of 0, shape (2, cells across the flow).
        axes: Axis of each direction, 0 for x.
        tolerance: Error of the flows that does no harm, relative to them.

    Returns:
        Potentials, any where no link leads, shape (n, nx, ny), and flows, shape (n,); None where
        iterations do not converge.
    """
    kept = _even(links, ends, axes)
    fewest = int(_MOST_PER_CELL * min(links[0].shape[1:]))
    start = [_in_series(links[axis][k], ends[k], axis) for k, axis in enumerate(axes)]
    least = np.array([1e-15 * one[0].sum() for one in ends])  # what rounding leaves of the flow
    parts = {(0, 1): links.pop(), (1, 0): links.pop()}
    parts[0, 0] = sum(link + shifted(link, (-i, -j)) for (i, j), link in parts.items())
    for sums, axis, one in zip(parts[0, 0], axes, ends, strict=True):
        np.moveaxis(sums, axis, 0)[[0, -1]] += one
    cycle = Cycle(parts)
    iteration = _Iteration(cycle, list(zip(ends, axes, strict=True)), start)
    most, worst = _IMBALANCE * np.sqrt(tolerance), list[float]()
    for count in range(min(_MOST_ITERATIONS, fewest)):
        changes = iteration.step()
        left = np.maximum(changes / tolerance, iteration.imbalance / most)
        if count and (left <= np.maximum(iteration.flow, least)).all():
            found, flow, imbalance = iteration.found()
            if (imbalance > most * flow).any():  # as rounding has added up in that of iterations
                return None
            return found[:, kept[0]][:, :, kept[1]], flow
        worst.append(float((iteration.imbalance / np.maximum(iteration.flow, least)).max()) / most)
        if _are_slow(worst) and cycle.with_pools():
            iteration.begins_anew()
    return None


def _in_series(links: Array, ends: Array, axis: int) -> Array:
    """Return one potential for each line across the flow, shape (nx, 1) or (1, ny).

    They are those of flows from line to line in series, exact where gaps depend on one axis alone.

    Args:
        links: Along the axis, those of the last line 0.
        ends: Links to source and sink, shape (2, cells across).
        axis: Axis of the flow.
    """
    between = links.sum(1 - axis, keepdims=True).take(range(links.shape[axis] - 1), axis)
    first, last = (np.full((1, 1), each.sum()) for each in ends)
    drops = np.cumsum(1.0 / np.concatenate((first, between, last), axis), axis)
    return 1.0 - (drops / drops.max()).take(range(links.shape[axis]), axis)


def _are_slow(imbalances: list[float]) -> bool:
    """Return whether iterations will go on for longer than it takes to make pools.

    Args:
        imbalances: After each of them, over the largest that is allowed.
    """
    if len(imbalances) < 5 or imbalances[-1] <= 1.0:  # the first three spread out from the sides
        return False
    falls = 0.5 * np.log(imbalances[-3] / imbalances[-1])
    return bool(np.log(imbalances[-1]) > _PATIENCE * falls)


def _even(links: list[Array], ends: list[Array], axes: Sequence[int]) -> list[Any]:
    """Let sides become such that can be halved until the coarsest grid; return which cells stay.

    Rows that are added lie, evenly spread, in the links from some to the next, which they divide.
    Many between two others would be chains side by side without links, of which coarser grids lose
    every second one.

    Args:
        links: See `potentials`.
        ends: Likewise.
        axes: Likewise.
    """
    halvings = int(np.ceil(np.log2(max(*links[0].shape[1:], COARSEST) / COARSEST)))
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
        for k, own in enumerate(axes):
            if own + 1 != axis:
                ends[k] = ends[k][:, order] * kept[-1]
    return kept


class _Iteration:
    """Conjugate gradients for the potentials of every second cell.

    The cells between, of the first two parities, have links to these and to terminals alone, and
    their potentials are those that balance them.

    Args:
        cycle: Preconditioner, whose finest grid is the problem.
        ends: For each direction links to terminals and its axis, see `potentials`.
        start: Potentials to begin from, for each direction, of shapes that extend to (nx, ny).

    Attributes:
        flow: Flows that potentials dissipate, to rounding of the sum of all links to the source.
        imbalance: Sum of the absolute differences of what enters and leaves all cells, to rounding
            that adds up over iterations, shape (n,).
    """

    def __init__(self, cycle: Cycle, ends: list[tuple[Array, int]], start: Sequence[Array]) -> None:
        self._cycle, self._grid, self._ends = cycle, cycle.grids[0], ends
        shape = self._grid.shape
        self._along = Cells(shape, float)
        self._work = np.empty(self._along.own[0, 0].shape)
        self._beyond = shape[0], shape[1] + 1, shape[2] + 1
        for k, values in enumerate(start):
            for (i, j), own in self._along.own.items():
                self._grid.inside(own)[k] = values[i % len(values) :: 2, j % values.shape[1] :: 2]
        for one in _SOLVED:
            self._along.wrap(one)
        self._potential = {one: self._along.own[one].copy() for one in _SOLVED}
        self._balance(with_source=True)
        self.flow: Array = np.array([one[0].sum() for one, _ in ends])
        for one, own in self._along.own.items():
            for k, links, cells in self._beside_source(one, own):
                self.flow[k] -= links @ cells
        self._residual = {one: self._left(one, with_source=True) for one in _SOLVED}
        self.flow -= self._product(self._residual, self._potential)
        self.imbalance = self._sum(self._residual)
        self._right = {one: self._grid.right[one] for one in _SOLVED}
        self._before, self._changes = np.zeros(len(ends)), list[Array]()

    def _into(self, parity: Offset, with_source: bool) -> Array:
        """Return what flows into cells of a parity from others and a source, themselves at 0."""
        beside, links = self._along.beside[parity], iter(self._grid.links[parity].items())
        key, link = next(links)
        total: Array = link * beside[key]
        for key, link in links:
            total += np.multiply(link, beside[key], out=self._work)
        if with_source:
            for _, terminals, cells in self._beside_source(parity, total):
                cells += terminals
        return total

    def _beside_source(self, parity: Offset, values: Array) -> Iterator[tuple[int, Array, Array]]:
        """Yield directions, links of cells of a parity to sources, and values of these cells."""
        for k, (ends, axis) in enumerate(self._ends):
            if parity[axis] == 0:
                cells = np.moveaxis(self._grid.inside(values)[k], axis, 0)[0]
                yield k, ends[0, parity[1 - axis] :: 2], cells

    def _left(self, parity: Offset, *, with_source: bool = False) -> Array:
        """Return what potentials leave of the balance of cells of a parity."""
        total = self._into(parity, with_source)
        total -= np.multiply(self._grid.diagonal[parity], self._along.own[parity], out=self._work)
        maps = total.reshape(self._beyond)
        maps[:, -1] = maps[..., -1] = 0.0
        return total

    def _balance(self, *, with_source: bool = False) -> None:
        """Let potentials between those of the others balance what flows, and comes from sources."""
        for one in _BETWEEN:
            into = self._into(one, with_source)
            np.multiply(into, self._grid.inverse[one], out=self._along.own[one])
            self._along.wrap(one)

    def begins_anew(self) -> None:
        """Let the next direction be that of the preconditioner, which is another one, alone."""
        self._before[:] = 0.0

    def step(self) -> Array:
        """Iterate once, and return what the last iterations changed the flows by."""
        residual, along = self._residual, self._along
        scale = self.imbalance[:, None] + np.finfo(float).tiny
        for one, right in self._right.items():
            np.multiply(residual[one], 1.0 / scale, out=right, casting="same_kind")
        guess = self._cycle(self._right)
        now = self._product(residual, guess) * scale[:, 0]
        again = np.divide(now, self._before, out=np.zeros_like(now), where=self._before > 0.0)
        self._before = now
        for one in _SOLVED:
            own = along.own[one]
            own *= again[:, None]
            own += np.multiply(guess[one], scale, out=self._work)
            along.wrap(one)
        self._balance()
        out = {one: self._left(one) for one in _SOLVED}
        power = -self._product(out, along.own)
        length = np.divide(now, power, out=np.zeros_like(now), where=power > 0.0)
        for one in _SOLVED:
            by = length[:, None]
            self._potential[one] += np.multiply(along.own[one], by, out=self._work)
            residual[one] += np.multiply(out[one], by, out=self._work)
        self._changes.append(np.asarray(length * now))
        self.flow = self.flow - self._changes[-1]
        self.imbalance = self._sum(residual)
        last = max(2, len(self._changes) // 4)
        return np.asarray(np.sum(self._changes[-last:], axis=0))

    def found(self) -> tuple[Array, Array, Array]:
        """Return the potential of all cells, the power it dissipates, and the imbalance it leaves.

        Iterations end by that.

        Returns:
            Shapes (n, nx, ny), (n,) and (n,).
        """
        grid = self._grid
        for one, values in self._potential.items():
            self._along.own[one][:] = values
            self._along.wrap(one)
        self._balance(with_source=True)
        found = np.empty((grid.shape[0], 2 * grid.shape[1], 2 * grid.shape[2]))
        for (i, j), values in self._along.own.items():
            found[:, i::2, j::2] = grid.inside(values)
        flow = np.zeros(len(found))
        for k, (ends, axis) in enumerate(self._ends):
            first, last = np.moveaxis(found[k], axis, 0)[[0, -1]]
            flow[k] = ends[0] @ (1.0 - first) ** 2 + ends[1] @ last**2
        for one in _BETWEEN:  # which all links lead from
            own = self._along.own[one]
            for key, link in grid.links[one].items():
                drop = grid.inside(own - self._along.beside[one][key])
                flow += np.einsum("nxy,nxy,nxy->n", grid.inside(link), drop, drop)
        parts = ({one: self._left(one, with_source=True)} for one in PARITIES)
        return found, flow, np.asarray(sum(map(self._sum, parts)))

    @staticmethod
    def _sum(parts: Parts) -> Array:
        """Return sums of absolute values, shape (n,)."""
        return np.asarray(sum(np.abs(one).sum(axis=1) for one in parts.values()))

    @staticmethod
    def _product(first: Parts, second: Parts) -> Array:
        """Return inner products of values of the cells that are solved for, shape (n,)."""
        return np.asarray(sum(np.einsum("nx,nx->n", first[one], second[one]) for one in _SOLVED))
