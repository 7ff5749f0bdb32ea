"""Maps of cells as networks: links between cells and terminals, and pools connected over sides.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.support import Array
from patchlaw.support.network import Network, Numbers, joined


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
