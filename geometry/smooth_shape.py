"""The block divided for fields that are smooth but at its edges: quadratic and graded."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.lattice import Axes, Segment
from geometry.meshes import BlockShape

Array = NDArray[np.float64]

ACROSS, IN_DEPTH = 1.5, 2.0
"""Size of a cell relative to the one nearer to a face, across and in depth.

What is left concentrates at the top's edges, where contacts feel free sides, and at those of the
clamped bottom. Along a side, where cells are coarsest in the middle, they must not become much
longer than the rectangles of load either.
"""
LARGEST = 8.0
"""Largest cell relative to the smallest along an axis."""

MOST_UNKNOWNS = 150_000
"""Unknowns of the largest division: its factorisation takes half a minute and 3 GB."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothShape(BlockShape):
    """A block of quadratic hexahedra, finest at its faces, made by `smooth_shape`.

    ``cells`` counts as for trilinear elements with as many nodes: a quadratic cell takes the place
    of two along every axis, rounded up to an even number of quadratic cells without a margin. With
    one, the cells keep the places that its grading gives them. In depth the grading is that of
    this module and not the block's own.
    """

    @property
    def axes(self) -> Axes:
        """Graded pieces of the grid lines along x, y and z."""
        depth = _towards_ends(-self.height, 0.0, self.cells[2], IN_DEPTH)
        return self._pieces(0), self._pieces(1), depth

    @property
    def nodes(self) -> tuple[Array, Array, Array]:
        """Coordinates of the planes of nodes along x, y and z, ascending [mm]."""
        x, y, z = (
            np.insert(ticks, np.arange(1, len(ticks)), 0.5 * (ticks[1:] + ticks[:-1]))
            for ticks in self.ticks
        )
        return x, y, z

    @property
    def unknowns(self) -> int:
        """Number of degrees of freedom."""
        return 3 * math.prod(map(len, self.nodes))

    def _pieces(self, axis: int) -> tuple[Segment, ...]:
        length, cells = self.interface[axis], self.cells[axis]
        if not self.margin:
            return _towards_ends(0.0, length, cells, ACROSS)
        outer, growth = -(-self.margin_cells // 2), self.margin_grading
        end = length + self.margin
        return (
            Segment(start=-self.margin, end=0.0, cells=outer, growth=1.0 / growth),
            Segment(start=0.0, end=length, cells=-(-cells // 2)),
            Segment(start=length, end=end, cells=outer, growth=growth),
        )


def smooth_shape(shape: BlockShape) -> SmoothShape:
    """Return a block with the division that suits its smooth correction.

    Args:
        shape: The block; its element and its grading in depth do not matter.

    Raises:
        InputError: When the cells are more than one factorisation should take.
    """
    given = {field.name: getattr(shape, field.name) for field in fields(BlockShape)}
    smooth = SmoothShape(**given | {"element": "Q2", "grading": 1.0})
    if smooth.unknowns > MOST_UNKNOWNS:
        raise InputError(
            f"{smooth.unknowns} unknowns are too many for the smooth correction of a half-space, "
            "which coarse cells resolve",
            value=list(shape.cells),
            allowed=f"at most {MOST_UNKNOWNS} unknowns; [16, 16, 12] are 11271 in a cube",
        )
    return smooth


def _towards_ends(start: float, end: float, cells: int, growth: float) -> tuple[Segment, ...]:
    middle, half = 0.5 * (start + end), -(-cells // 4)
    ratio = min(growth ** (half - 1), LARGEST)
    return (
        Segment(start=start, end=middle, cells=half, growth=ratio),
        Segment(start=middle, end=end, cells=half, growth=1.0 / ratio),
    )
