"""The flat block under the contact interface: its shape and grid lines."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import numpy as np

from geometry.meshes.lattice import Segment
from geometry.patches import PatchGrid
from support.arrays import Array
from support.checks import cell_counts, positive_lengths
from support.errors import InputError
from support.fields import Count, Length, Limits, PositiveLength, check_limits

Element = Literal["Q1", "Q2", "P1", "P2"]
ELEMENTS = get_args(Element)

LEAST_MARGIN = 1e-3
"""Narrowest margin, relative to the shorter side of the interface. Measured on a cube of
20 × 20 × 12 cells: at 1e-5 solves take five times as long, at 1e-7 they are 2 % wrong or fail."""

LEAST_MARGIN_CELL = 1e-5
"""Narrowest cell of a margin, relative to the same."""


@dataclass(frozen=True, kw_only=True)
class BlockMeshing:
    """What of a block's mesh does not depend on the size of the block.

    Args:
        element: Element of the block's mesh: hexahedra Q or tetrahedra P, six in each hexahedron,
            linear or quadratic.
        grading: Height of the lowest layer of cells over that of the highest.
        margin: Width of the block beyond the rough interface, on all four sides [mm].
        margin_cells: Cells of the mesh across the margin.
        margin_grading: Width of the outermost cells of the margin over that of the innermost.
    """

    element: str = "Q1"
    grading: Annotated[float, Limits(ge=1, le=1e6)] = 1.0
    margin: Annotated[Length, Limits(ge=0)] = 0.0
    margin_cells: Count = 8
    margin_grading: Annotated[float, Limits(ge=1, le=1e6)] = 1.0


@dataclass(frozen=True, kw_only=True)
class BlockShape(BlockMeshing):
    """A block whose top face z = 0 holds the interface [0, Lx] × [0, Ly], and its division.

    The block occupies [−margin, Lx + margin] × [−margin, Ly + margin] × [−height, 0].

    Args:
        interface: Sides (Lx, Ly) of the contact interface [mm].
        height: Height of the block [mm].
        cells: Hexahedra (nx, ny) over the interface and nz over the height.

    Raises:
        InputError: When a value is out of its range.
    """

    interface: tuple[float, float]
    height: PositiveLength
    cells: tuple[int, int, int]

    def __post_init__(self) -> None:
        object.__setattr__(self, "interface", positive_lengths(self.interface, "the interface"))
        object.__setattr__(self, "cells", cell_counts(self.cells, "the block", dimension=3))
        check_limits(self)
        if self.element not in ELEMENTS:
            raise InputError(
                "this element is unknown", value=self.element, allowed=", ".join(ELEMENTS)
            )
        if self.margin:
            self._check_margin()

    @property
    def hexahedral(self) -> bool:
        """Whether the cells are hexahedra."""
        return self.element.startswith("Q")

    @property
    def degree(self) -> int:
        """Polynomial degree of the element."""
        return int(self.element[1])

    @property
    def ticks(self) -> tuple[Array, Array, Array]:
        """Coordinates of the grid planes along x, y and z, ascending [mm]."""
        growth = 1.0 / self.grading
        depth = Segment(start=-self.height, end=0.0, cells=self.cells[2], growth=growth)
        return self._across(0), self._across(1), depth.ticks

    @property
    def cell_count(self) -> int:
        """Number of hexahedra or tetrahedra."""
        boxes = math.prod(len(ticks) - 1 for ticks in self.ticks)
        return boxes if self.hexahedral else 6 * boxes

    def _check_margin(self) -> None:
        side = min(self.interface)
        if self.margin < LEAST_MARGIN * side:
            raise InputError(
                "the block's margin is too narrow to be meshed",
                value=self.margin,
                allowed=f"0, or at least {LEAST_MARGIN * side:g} mm",
            )
        across = Segment(
            start=0.0, end=self.margin, cells=self.margin_cells, growth=self.margin_grading
        )
        narrowest = across.narrowest
        if narrowest < LEAST_MARGIN_CELL * side:
            raise InputError(
                f"the block's margin has cells of {narrowest:.3g} mm, too narrow to be meshed",
                value=(self.margin, self.margin_cells, self.margin_grading),
                allowed=f"cells of at least {LEAST_MARGIN_CELL * side:g} mm: fewer margin_cells, "
                "a smaller margin_grading or a wider margin",
            )

    def _across(self, axis: int) -> Array:
        """Return the grid planes along x or y, margins included [mm]."""
        length, count, growth = self.interface[axis], self.margin_cells, self.margin_grading
        inner = Segment(start=0.0, end=length, cells=self.cells[axis]).ticks
        if not self.margin:
            return inner
        before = Segment(start=-self.margin, end=0.0, cells=count, growth=1.0 / growth)
        after = Segment(start=length, end=length + self.margin, cells=count, growth=growth)
        return np.concatenate([before.ticks[:-1], inner, after.ticks[1:]])


def require_inside(interface: tuple[float, float], patches: PatchGrid) -> None:
    """Refuse patches that reach beyond a contact interface.

    Args:
        interface: Sides (Lx, Ly) of the interface, which begins at the origin [mm].
        patches: The patches.

    Raises:
        InputError: When they do.
    """
    low, high = np.array(patches.origin), np.array(patches.origin) + patches.lengths
    slack = 1e-9 * np.array(interface)
    if np.any(low < -slack) or np.any(high > interface + slack):
        raise InputError(
            "the patches reach beyond the top of the block",
            value=(patches.origin, patches.lengths),
            allowed=f"inside the interface {interface} mm",
        )


def misalignment(shape: BlockShape, patches: PatchGrid) -> str:
    """Say where the borders of patches cut elements.

    Args:
        shape: The block.
        patches: Patches on its interface.

    Returns:
        A sentence; empty where all borders of patches lie on borders of elements.

    Raises:
        InputError: When a patch reaches beyond the interface.
    """
    require_inside(shape.interface, patches)
    parts = []
    for axis, borders in enumerate((patches.borders_x, patches.borders_y)):
        cells, letter = shape.cells[axis], "xy"[axis]
        position = borders / shape.interface[axis] * cells
        if not np.allclose(position, np.round(position), rtol=0.0, atol=1e-6):
            parts.append(f"{letter} ({patches.grid[axis]} patches on {cells} cells)")
    if not parts:
        return ""
    return (
        f"patch borders cut elements along {' and '.join(parts)}; "
        "a multiple of the number of patches would align them"
    )
