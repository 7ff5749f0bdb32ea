"""The flat block under the contact interface: its shape, grid lines, and the lattice of its cells.

All ranks make lattices of boxes between graded grid lines at once. A rank makes the cells of its
own part of the lattice, and an even share of the nodes, without asking another. Node numbers are
those of the whole lattice.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias, get_args

import numpy as np

from patchlaw.geometry.patches import PatchGrid
from patchlaw.support import Array, Counts, Indices, InputError, Lengths
from patchlaw.support.arguments import Count, Distance, Limits, PositiveLength, check_fields

CellCounts: TypeAlias = tuple[int, int, int]
Part: TypeAlias = tuple[range, range, range]

_CORNERS = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)])
"""Vertices of a box in the order of dolfinx: x runs first."""

_TETRAHEDRA = np.array(
    [(0, 1, 2, 4), (1, 3, 2, 4), (2, 3, 6, 4), (1, 5, 3, 4), (3, 5, 6, 4), (3, 5, 7, 6)]
)
"""Six positively oriented tetrahedra in a box, cut as gmsh cuts transfinite volumes."""

Element = Literal["Q1", "Q2", "P1", "P2"]
ELEMENTS = get_args(Element)
LEAST_MARGIN = 1e-3
"""Narrowest margin, relative to the shorter side of the interface. Measured on a cube of
20 × 20 × 12 cells: at 1e-5 solves take five times as long, at 1e-7 they are 2 % wrong or fail."""
LEAST_MARGIN_CELL = 1e-5
"""Narrowest cell of a margin, relative to the same."""


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
    def ticks(self) -> Array:
        """Coordinates of the grid planes, shape (cells + 1,) [mm]."""
        ratio = self.growth ** (1.0 / (self.cells - 1)) if self.cells > 1 else 1.0
        sizes = ratio ** np.arange(self.cells)
        share = np.concatenate([[0.0], np.cumsum(sizes) / sizes.sum()])
        return self.start + (self.end - self.start) * share


def lattice_part(cells: CellCounts, ranks: int, rank: int) -> Part:
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


def cells_beyond(cells: CellCounts, ranks: int, part: Part) -> tuple[Counts, Counts]:
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


def lattice_cells(cells: CellCounts, part: Part, *, hexahedra: bool) -> Counts:
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


def node_planes(cells: CellCounts, numbers: Counts) -> Indices:
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
    margin: Distance = 0.0
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

    interface: Lengths
    height: PositiveLength
    cells: tuple[Count, Count, Count]

    def __post_init__(self) -> None:
        check_fields(self)
        if self.element not in ELEMENTS:
            raise InputError(
                "this element is unknown", value=self.element, allowed=", ".join(ELEMENTS)
            )
        if self.margin:
            self._check_margin()

    @property
    def widths(self) -> tuple[float, float]:
        """Sides of the whole block along x and y, margins included [mm]."""
        x, y = self.interface
        return x + 2.0 * self.margin, y + 2.0 * self.margin

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
