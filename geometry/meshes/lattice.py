"""Lattices of boxes between graded grid lines, made by all ranks at once.

A rank makes the cells of its own part of the lattice, and an even share of the nodes, without
asking another. Node numbers are those of the whole lattice.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from support.arrays import Array

Numbers = NDArray[np.int64]
Counts: TypeAlias = tuple[int, int, int]
Part: TypeAlias = tuple[range, range, range]

_CORNERS = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)])
"""Vertices of a box in the order of dolfinx: x runs first."""

_TETRAHEDRA = np.array(
    [(0, 1, 2, 4), (1, 3, 2, 4), (2, 3, 6, 4), (1, 5, 3, 4), (3, 5, 6, 4), (3, 5, 7, 6)]
)
"""Six positively oriented tetrahedra in a box, cut as gmsh cuts transfinite volumes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A straight piece of a grid line, divided geometrically.

    Args:
        start: First coordinate [mm].
        end: Last coordinate [mm].
        cells: Number of cells.
        growth: Size of the last cell relative to the first.
    """

    start: float
    end: float
    cells: int
    growth: float = 1.0

    @property
    def narrowest(self) -> float:
        """Size of the smallest cell [mm], without making the others."""
        length, count = abs(self.end - self.start), self.cells
        steepness = abs(math.log(self.growth))
        if count == 1 or steepness == 0.0:
            return length / count
        per_cell = steepness / (count - 1)
        return length * math.expm1(per_cell) / math.expm1(count * per_cell)

    @property
    def ticks(self) -> NDArray[np.float64]:
        """Coordinates of the grid planes, shape (cells + 1,) [mm]."""
        ratio = self.growth ** (1.0 / (self.cells - 1)) if self.cells > 1 else 1.0
        sizes = ratio ** np.arange(self.cells)
        share = np.concatenate([[0.0], np.cumsum(sizes) / sizes.sum()])
        return self.start + (self.end - self.start) * share


def lattice_part(cells: Counts, ranks: int, rank: int) -> Part:
    """Return the box of cells that is a rank's part of a lattice.

    The ranks are halved again and again, and the lattice with them, in proportion, across the axis
    with the most cells, which cuts the fewest of them. Parts differ by rounding to whole layers;
    they are empty only where layers are fewer than ranks.

    Args:
        cells: Cells of the lattice along x, y and z.
        ranks: Number of parts.
        rank: Which part.

    Returns:
        Which cells along x, y and z.

    Source:
        Recursive bisection: Berger, Bokhari, IEEE Transactions on Computers C-36 (1987) 570,
        doi 10.1109/TC.1987.1676942.
    """
    x, y, z = map(range, cells)
    part = [x, y, z]
    while ranks > 1:
        few = ranks // 2
        longest = max(part, key=len)
        axis = part.index(longest)
        cut = (2 * len(longest) * few + ranks) // (2 * ranks)  # to the nearest layer
        if rank < few:
            part[axis], ranks = longest[:cut], few
        else:
            part[axis], ranks, rank = longest[cut:], ranks - few, rank - few
    return part[0], part[1], part[2]


def cells_beyond(cells: Counts, ranks: int, part: Part) -> tuple[Numbers, Numbers]:
    """Return which of a part's cells share faces with those of other ranks.

    Args:
        cells: Cells of the lattice along x, y and z.
        ranks: Number of parts.
        part: The part of one of them.

    Returns:
        Numbers of cells in the part, in the order of `lattice_cells`, and the ranks beyond their
        faces, shapes (n,); cells at edges of the part come more than once, with different ranks.
    """
    numbers = np.arange(np.prod([len(of) for of in part])).reshape([len(of) for of in part])
    beside, others = [numbers[:0].ravel()], [numbers[:0].ravel()]
    for rank in range(ranks):
        beyond = lattice_part(cells, ranks, rank)
        steps = [*np.eye(3, dtype=int), *-np.eye(3, dtype=int)] if beyond != part else []
        for step in steps:
            near = tuple(map(_common, part, beyond, step))
            beside.append(numbers[near].ravel())
            others.append(np.full(len(beside[-1]), rank))
    return np.concatenate(beside), np.concatenate(others)


def _common(one: range, other: range, step: int) -> slice:
    """Return which cells of one range, counted from its first, come a step before the other's."""
    first, last = max(one.start, other.start - step), min(one.stop, other.stop - step)
    return slice(first - one.start, max(first, last) - one.start)


def lattice_cells(cells: Counts, part: Part, *, hexahedra: bool) -> Numbers:
    """Return the nodes of the cells of a part, by their numbers in the whole lattice.

    The node where the planes i, j, k meet has the number (i (ny + 1) + j) (nz + 1) + k.

    Args:
        cells: Cells of the lattice along x, y and z.
        part: Which of them, along x, y and z.
        hexahedra: Hexahedra, or six tetrahedra in the place of each.

    Returns:
        Numbers in the order of dolfinx, shape (cells of the part, 8), or (6 times as many, 4).
    """
    strides = np.array([(cells[1] + 1) * (cells[2] + 1), cells[2] + 1, 1])
    along = [
        stride * np.arange(of.start, of.stop) for stride, of in zip(strides, part, strict=True)
    ]
    first = (along[0][:, None, None] + along[1][:, None] + along[2]).ravel()
    corners = _CORNERS @ strides
    offsets = corners if hexahedra else corners[_TETRAHEDRA].ravel()
    return (first[:, None] + offsets).reshape(-1, 8 if hexahedra else 4)


def node_planes(cells: Counts, numbers: Numbers) -> NDArray[np.intp]:
    """Return which planes across x, y and z meet at nodes.

    Args:
        cells: Cells of the lattice along x, y and z.
        numbers: Numbers of the nodes, shape (n,).

    Returns:
        Indices of the planes, shape (n, 3).
    """
    planes = np.unravel_index(numbers, [count + 1 for count in cells])
    return np.stack(planes, axis=1)


def node_share(ticks: Sequence[Array], ranks: int, rank: int) -> Array:
    """Return the places of an even share of a lattice's nodes, consecutive in number.

    Args:
        ticks: Coordinates of the planes across x, y and z [mm].
        ranks: Number of shares.
        rank: Which share.

    Returns:
        Points, shape (n, 3) [mm].
    """
    cells = (len(ticks[0]) - 1, len(ticks[1]) - 1, len(ticks[2]) - 1)
    count = len(ticks[0]) * len(ticks[1]) * len(ticks[2])
    planes = node_planes(cells, np.arange(count * rank // ranks, count * (rank + 1) // ranks))
    return np.stack([of[planes[:, k]] for k, of in enumerate(ticks)], axis=1)
