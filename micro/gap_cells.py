"""Maps of cells as networks: links between cells and terminals, pools, and widest paths.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.support import Array, Flags, Indices
from patchlaw.support.network import Network, Numbers, joined, narrowest_link

_FEW = 64**2
"""Cells up to which all links are searched for the narrowest one of a path. Larger maps try first
those next to that of every second cell along both sides."""
_NEAR = 1.2
"""How much wider and narrower these are, and the power by which that grows if they are not it: the
narrowest link on every second cell of 128² to 512² was 0.94 to 1.2 times that on all."""


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


class WidestPath:
    """The path between opposite sides of a map of gaps whose narrowest link is as wide as possible.

    Cell [ix, iy] is number ix ny + iy; inlet and outlet come last.

    Args:
        gap: Gaps of the cells, 0 where closed, shape (nx, ny) [mm].
        lengths: Sides of the map [mm].
        axis: Axis along which it leads from side to side.
        periodic: Whether the map continues over the sides along it.
    """

    def __init__(
        self, gap: Array, lengths: tuple[float, float], axis: int, *, periodic: bool
    ) -> None:
        self._gap, self._lengths, self._axis, self._periodic = gap, lengths, axis, periodic
        width = (lengths[1] / gap.shape[1]) / (lengths[0] / gap.shape[0])
        self._widths: tuple[float, float] = (width, 1.0 / width)

    def narrowest(self) -> tuple[Indices, float] | None:
        """Return the cells at both ends of its narrowest link, (2,), and the conductance of that.

        None where no path leads from side to side.
        """
        low, high, factor = 0.0, np.inf, _NEAR
        if not self._gap.any():
            return None
        if self._gap.size > _FEW:
            coarse = self._gap[::2, ::2]
            found = WidestPath(coarse, self._lengths, self._axis, periodic=self._periodic)
            known = found.narrowest()
            guess = known[1] if known else float(np.median(self._gap[self._gap > 0.0])) ** 3
            low, high = guess / factor, guess * factor
        while True:
            ends, conductance, terminals, tail, head = self._between(low, high)
            link = narrowest_link(tail, head, conductance, terminals)
            if link is not None and conductance[link] < high:
                return ends[:, link], float(conductance[link])
            if link is None and low == 0.0:
                return None
            factor **= 3
            if link is None:
                low, high = (low / factor if factor < 1e6 else 0.0), low
            else:
                low, high = high, (high * factor if factor < 1e6 else np.inf)

    def pools(self, some: Flags) -> tuple[Numbers, int]:
        """Return the pool that each of some cells is in, not over the sides, and their count.

        Returns:
            Numbers of the pools, 0 of others and of terminals, shape (nx ny + 2,).
        """
        from scipy import ndimage  # flows without constrictions do without

        found: Numbers = np.zeros(some.size + 2, np.intc)
        return found, ndimage.label(some, output=found[:-2].reshape(some.shape))

    def links(self, inner: Sequence[Flags]) -> tuple[Indices, Array]:
        """Return cells at the tails and heads of links, shape (2, m), and their conductances.

        Those to terminals and over the sides are among them.

        Args:
            inner: Which of those between cells along x are, shape (nx - 1, ny), and along y.
        """
        size, (_, ny) = self._gap.size, self._gap.shape
        cells, gap = np.arange(size).reshape(-1, ny), np.append(self._gap, (np.inf, np.inf))
        ends, conductances = [], []
        for way, some in enumerate(inner):
            tail: Indices = np.flatnonzero(some)
            if way:
                tail += tail // (ny - 1)
            first, last = (np.asarray(cells.take(line, way)) for line in (0, -1))
            pairs = [(tail, tail + (1 if way else ny))]
            if way == self._axis:
                pairs += [(np.full_like(first, size), first), (last, np.full_like(last, size + 1))]
            elif self._periodic:
                pairs.append((last, first))
            ends.append(np.concatenate(pairs, axis=1))
            wide = gap[ends[-1]]
            with np.errstate(divide="ignore"):
                half = 0.5 / (wide * wide * wide)
            conductances.append(self._widths[way] / half.sum(axis=0))
        return np.concatenate(ends, axis=1), np.concatenate(conductances)

    def _between(
        self, low: float, high: float
    ) -> tuple[Indices, Array, tuple[int, int], Numbers, Numbers]:
        """Return links, without those narrower than low and some of those that high ones join.

        Returns:
            Cells at their ends, shape (2, m), conductances, (m,), the terminals' nodes, and those
            at the tails and heads of links, (m,) each.
        """
        # a link has one to two times the narrower of its cells; 1.01 for rounding
        some = self._gap > float(np.cbrt(low / (2.02 * max(self._widths))))
        wide = self._gap >= float(np.cbrt(1.01 * high / min(self._widths)))
        of, count = self.pools(wide)
        both = zip(_sides(some), _sides(wide), strict=True)
        ends, conductance = self.links([a & b & ~(c & d) for (a, b), (c, d) in both])
        those = np.flatnonzero(conductance >= max(low, float(np.finfo(float).tiny)))
        ends, conductance = ends[:, those], conductance[those]
        cells = np.append(ends, (len(of) - 2, len(of) - 1))
        alone = cells[of[cells] == 0]
        of[alone] = np.arange(len(alone)) + count + 1
        tail, head = of[ends]
        return ends, conductance, (int(of[-2]), int(of[-1])), tail, head


def _sides(values: NDArray[Any]) -> list[tuple[NDArray[Any], NDArray[Any]]]:
    """Return the values at both ends of links between cells along x, and along y."""
    return [(values[:-1], values[1:]), (values[:, :-1], values[:, 1:])]
