"""Maps of cells as networks: links between cells and terminals, pools, and widest paths.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.support import Array, Flags, Indices
from patchlaw.support.network import Network, Numbers, joined, narrowest_link

_LEVELS = 32
"""Links of a map whose conductances are tried for that of the narrowest one of a path; others lie
between two of them."""


def turned(
    gap: Array, lengths: tuple[float, float], axis: int
) -> tuple[Array, tuple[float, float]]:
    """Return a map and its sides with the flow along the first axis."""
    return (gap.T, (lengths[1], lengths[0])) if axis else (gap, lengths)


def link_ends(values: NDArray[Any]) -> list[tuple[NDArray[Any], NDArray[Any]]]:
    """Return the values at the tails and heads of all links along x, and of those along y.

    Args:
        values: Values of the cells, between lines of those of the terminals, shape (nx + 2, ny).
    """
    inner = values[1:-1]
    return [(values[:-1], values[1:]), (inner, np.roll(inner, -1, axis=1))]


def cell_links(
    conductivity: Array,
    lengths: tuple[float, float],
    *,
    across: Array | None = None,
    periodic: bool = False,
) -> tuple[Array, Array]:
    """Return the conductances of links along x and along y, 0 of closed ones.

    Args:
        conductivity: See `cell_network`.
        lengths: Likewise.
        across: Likewise.
        periodic: Likewise.

    Returns:
        From the inlet at x = 0 through all cells to the outlet, shape (nx + 1, ny); and from each
        cell to the next one, from the last to the first, shape (nx, ny).
    """
    nx, ny = conductivity.shape
    width = (lengths[1] / ny) / (lengths[0] / nx)
    # half of a link between two cells lies in each of them; those to a side end there
    with np.errstate(divide="ignore"):
        half = 0.5 / conductivity
        half_across = half if across is None else 0.5 / across
    along_x = width / np.concatenate([half[:1], half[:-1] + half[1:], half[-1:]])
    along_y = 1.0 / (width * (half_across + np.roll(half_across, -1, axis=1)))
    if not periodic:
        along_y[:, -1] = 0.0
    return along_x, along_y


def cell_network(
    conductivity: Array,
    lengths: tuple[float, float],
    *,
    across: Array | None = None,
    periodic: bool = False,
) -> Network:
    """Return the network of the cells of a map, whose inlet is at x = 0 and outlet at x = Lx.

    Cell [ix, iy] is node ix ny + iy.

    Args:
        conductivity: Conductivity of the cells, 0 where closed, shape (nx, ny). That of a gap is
            g³ [mm³].
        lengths: Sides of the map [mm].
        across: Their conductivity along y, where it is another one than along x.
        periodic: Whether the map continues over the sides y = 0 and y = Ly.
    """
    nx, ny = conductivity.shape
    links = cell_links(conductivity, lengths, across=across, periodic=periodic)
    conductance = np.concatenate([one.ravel() for one in links])
    cells = np.arange((nx + 2) * ny).reshape(nx + 2, ny) - ny
    cells[0], cells[-1] = nx * ny, nx * ny + 1
    (tail, head), is_open = zip(*link_ends(cells), strict=True), conductance > 0.0
    return Network(
        count=nx * ny,
        tail=np.concatenate([one.ravel() for one in tail])[is_open],
        head=np.concatenate([one.ravel() for one in head])[is_open],
        conductance=conductance[is_open],
    )


def joined_pools(pools: Numbers, count: int, axis: int) -> Numbers:
    """Return the number of the connected pools that each pool is one of, 0 for contact.

    Pools are connected where paths over the sides of the map join them.

    Args:
        pools: Number of the pool that a cell belongs to, 0 for contact, shape (nx, ny).
        count: How many there are.
        axis: Axis along which the map continues over its sides.
    """
    pairs = np.stack([pools.take(0, axis), pools.take(-1, axis)])
    tail, head = pairs[:, pairs.all(axis=0)]
    found = 1 + joined(tail, head, count + 1)
    found[0] = 0
    return found


class WidestPaths:
    """Paths between opposite sides of a map of gaps whose narrowest link is as wide as possible.

    Cell [ix, iy] is number ix ny + iy; inlet and outlet of a flow along an axis come last.

    Args:
        gap: Gaps of the cells, 0 where closed, shape (nx, ny) [mm].
        lengths: Sides of the map [mm].
        axes: Axes along which paths lead from side to side.
        periodic: Whether the map continues over the sides along a path.
    """

    def __init__(
        self, gap: Array, lengths: tuple[float, float], axes: Sequence[int], *, periodic: bool
    ) -> None:
        self._gap, self._axes, self._periodic = gap, axes, periodic
        width = (lengths[1] / gap.shape[1]) / (lengths[0] / gap.shape[0])
        self._widths = width, 1.0 / width

    @cached_property
    def narrowest(self) -> dict[int, Indices]:
        """Cells at both ends of the narrowest link of the path along each axis, (2,) each.

        Cells that are joined by wider links than it are taken together, as pools. Whether such a
        path of wider links leads from side to side is told by pools at one level for all axes.
        """
        half = _half(self._gap)
        links = [one / (a + b) for one, (a, b) in zip(self._widths, _sides(half), strict=True)]
        stride = 2 * half.size // _LEVELS | 1
        levels = np.unique(np.concatenate([one.ravel()[::stride] for one in links]))
        levels = np.concatenate(([np.finfo(float).tiny], levels[levels > 0.0], [np.inf]))
        low, high = (dict.fromkeys(self._axes, one) for one in (0, len(levels) - 1))
        beyond = dict.fromkeys(self._axes, self.pools(np.zeros(half.shape, bool)))
        while left := [axis for axis in self._axes if high[axis] - low[axis] > 1]:
            middle = (low[left[0]] + high[left[0]]) // 2
            level = levels[middle]
            # all links between cells of such pools are as wide as the level, by more than rounding
            pools = self.pools(half <= 0.5 / 1.01 * min(self._widths) / level)
            for axis in left:
                if low[axis] < middle < high[axis]:
                    *_, ends, tail, head, count = self._graph(axis, links, level, pools)
                    first, second = joined(tail, head, count)[list(ends)]
                    if first == second:
                        low[axis] = middle
                    else:
                        high[axis], beyond[axis] = middle, pools
        places = {}
        for axis in self._axes:
            cells, conductance, ends, tail, head, _ = self._graph(
                axis, links, levels[low[axis]], beyond[axis]
            )
            places[axis] = cells[:, narrowest_link(tail, head, conductance, ends)]
        return places

    def pools(self, some: Flags) -> tuple[Numbers, int]:
        """Return the pool that each of some cells is in, not over the sides, and their count.

        Returns:
            Numbers of the pools, 0 of others and of terminals, shape (nx ny + 2,).
        """
        from scipy import ndimage  # flows without constrictions do without

        found: Numbers = np.zeros(some.size + 2, np.intc)
        return found, ndimage.label(some, output=found[:-2].reshape(some.shape))

    def links(self, axis: int, inner: Sequence[Flags]) -> tuple[Indices, Array]:
        """Return cells at the tails and heads of links, shape (2, m), and their conductances.

        Args:
            axis: Axis of a flow, all whose links to terminals and over the sides are among them.
            inner: Which of those between cells along x are, shape (nx - 1, ny), and along y.
        """
        size, (_, ny) = self._gap.size, self._gap.shape
        cells, gap = np.arange(size).reshape(-1, ny), np.append(self._gap, (np.inf, np.inf))
        ends, conductances = [], []
        for way, some in enumerate(inner):
            tail, first, last = np.flatnonzero(some), cells.take(0, way), cells.take(-1, way)
            if way:
                tail += tail // (ny - 1)
            pairs = [(tail, tail + (1 if way else ny))]
            if way == axis:
                pairs += [(np.full_like(first, size), first), (last, np.full_like(last, size + 1))]
            elif self._periodic:
                pairs.append((last, first))
            ends.append(np.concatenate(pairs, axis=1))
            conductances.append(self._widths[way] / _half(gap[ends[-1]]).sum(axis=0))
        return np.concatenate(ends, axis=1), np.concatenate(conductances)

    def _graph(
        self, axis: int, links: Sequence[Array], least: float, pools: tuple[Numbers, int]
    ) -> tuple[Indices, Array, tuple[int, int], Numbers, Numbers, int]:
        """Return links that are wide enough between cells that are not of one pool.

        Args:
            axis: Axis of the path.
            links: Conductances of those between cells along x and y.
            least: The least conductance that is wide enough.
            pools: What `pools` returns.

        Returns:
            Cells at their ends, shape (2, m), conductances, (m,), the terminals' nodes, those at
            the tails and heads of links, (m,) each, and a number above all nodes.
        """
        of, count = pools
        beside = _sides(of[:-2].reshape(self._gap.shape) > 0)
        inner = [(one >= least) & ~(a & b) for one, (a, b) in zip(links, beside, strict=True)]
        ends, conductance = self.links(axis, inner)
        ends, conductance = ends[:, conductance >= least], conductance[conductance >= least]
        cells = np.append(ends, (len(of) - 2, len(of) - 1))
        alone = cells[of[cells] == 0]
        of[alone] = np.arange(len(alone)) + count + 1
        tail, head = of[ends]
        terminals = int(of[-2]), int(of[-1])
        of[alone] = 0
        return ends, conductance, terminals, tail, head, count + len(alone) + 1


def _sides(values: NDArray[Any]) -> list[tuple[NDArray[Any], NDArray[Any]]]:
    """Return the values at both ends of links between cells along x, and along y."""
    return [(values[:-1], values[1:]), (values[:, :-1], values[:, 1:])]


def _half(gap: Array) -> Array:
    """Return the resistances of half of the way through cells as long as they are wide."""
    with np.errstate(divide="ignore"):
        return 0.5 / (gap * gap * gap)
