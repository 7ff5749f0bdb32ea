"""Families of meshes of a rough block, coarse to fine, whose results can be extrapolated.

All sizes of a family fall together. Where contact can occur the finest tetrahedra have a stated
number of edges along the radius of a typical contact. That radius is estimated from the surface
alone: of a cap that the plane can touch, Hertz's contact takes half the area, whatever its
curvature.

The force converges from above. Curved quadratic tetrahedra with n edges along a contact's radius
err like 1/n³: by 1.4 and 2.0 % with n = 1.5 and by 0.2 and 0.3 % with n = 3, on two surfaces of
Set 1 (Waddad et al. 2016, table 1) at an approach of 8 µm, heights × 0.1, against concurrent
coupling corrected for the 0.28 % of finite slopes that remain there. Single meshes scatter by
where their nodes happen to lie, so that an order observed on three of them does too. Linear
tetrahedra err by 3.4 % with n = 6, at the cost of quadratic ones with n = 2.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from geometry.meshes.block import BlockShape
from geometry.meshes.expected_contact import contact_radius, places_in_reach
from geometry.meshes.refined_block import RefinedShape
from geometry.surface import Surface
from support.errors import InputError

Array = NDArray[np.float64]
Shape: TypeAlias = BlockShape | RefinedShape
Cells: TypeAlias = Literal["tetrahedra", "hexahedra"]

EDGES = 3.0
"""Edges along the radius of a typical contact in the finest tetrahedra, by default."""

_SPAN = 2.0
"""Ratio of the coarsest size of a family to the finest."""

_GROWTH = 1.2
"""Increase of the edge length per distance, with one edge along a contact's radius."""


def reference_shapes(
    surface: Surface,
    approach: float,
    height: float,
    *,
    count: int,
    fine: float | None = None,
    tilt: tuple[float, float] = (0.0, 0.0),
    mesh: Cells = "tetrahedra",
    cells: tuple[int, int, int] | None = None,
    grading: float = 8.0,
    element: str | None = None,
    radius: float | None = None,
) -> tuple[Shape, ...]:
    """Return blocks to mesh, coarse to fine, all of whose sizes fall together.

    Two or more meshes span a factor of 2 in size, in equal ratios; hexahedra as near to it as
    whole numbers of cells come (see `characteristic_size`).

    Args:
        surface: The rough surface, which covers the block's top.
        approach: Largest approach that the meshes are for [mm].
        height: Height of the block [mm].
        count: Number of meshes.
        fine: Edge length of the finest tetrahedra where contact can occur [mm]; by default
            `suggested_fine`.
        tilt: Slopes of the approach along x and y.
        mesh: ``"tetrahedra"``, small where contact can occur, or ``"hexahedra"`` everywhere.
        cells: Hexahedra of the finest mesh along x, y and over the height.
        grading: Height of the bottom layer of hexahedra relative to the top layer.
        element: ``P1`` or ``P2`` (default) tetrahedra; ``Q1`` (default) or ``Q2`` hexahedra.
        radius: The `contact_radius` at this approach where it is known [mm].

    Raises:
        InputError: When a value is out of its range, hexahedra come without their number, or they
            are too few for a family.
    """
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise InputError("a family has at least one mesh", value=count, allowed="1, 2, 3 …")
    factors = [_SPAN ** (k / max(count - 1, 1)) for k in reversed(range(count))]
    if mesh == "hexahedra":
        finest = _hexahedra(surface, height, cells, grading, element or "Q1")
        counts = np.maximum(1, np.rint(np.outer(1.0 / np.array(factors), finest.cells))).astype(int)
        return _all_finer(tuple(replace(finest, cells=tuple(row)) for row in counts))
    if mesh != "tetrahedra":
        raise InputError(
            "these cells are unknown", value=mesh, allowed=", ".join(map(repr, get_args(Cells)))
        )
    radius = radius or contact_radius(surface, approach, tilt=tilt)
    smallest = radius / EDGES if fine is None else fine
    if not 0.0 < smallest < math.inf:
        raise InputError("the finest edge length is out of range", value=fine, allowed="> 0 mm")
    return tuple(
        _tetrahedra(surface, approach, tilt, height, radius, smallest * factor, element or "P2")
        for factor in factors
    )


def characteristic_size(shape: Shape) -> float:
    """Return the edge length of a mesh where contact occurs, by which results are extrapolated.

    Args:
        shape: A block to mesh.

    Returns:
        Length [mm]; of hexahedra, that of the edges of the finest cells, averaged over x, y and z.
    """
    if isinstance(shape, RefinedShape):
        return shape.fine
    x, y, z = shape.ticks
    return float(np.cbrt(np.diff(x).min() * np.diff(y).min() * np.diff(z).min()))


def suggested_fine(
    surface: Surface,
    approach: float,
    *,
    tilt: tuple[float, float] = (0.0, 0.0),
    edges: float = EDGES,
) -> float:
    """Return an edge length that resolves typical contacts [mm].

    Args:
        surface: The rough surface.
        approach: Largest approach [mm].
        tilt: Slopes of the approach along x and y.
        edges: Edges along the radius of a typical contact.

    Raises:
        InputError: When the number of edges is not positive.
    """
    if not 0.0 < edges < math.inf:
        raise InputError("edges along a contact's radius", value=edges, allowed="> 0")
    return contact_radius(surface, approach, tilt=tilt) / edges


def _tetrahedra(
    surface: Surface,
    approach: float,
    tilt: tuple[float, float],
    height: float,
    radius: float,
    fine: float,
    element: str,
) -> RefinedShape:
    """Return one member, whose sizes all follow from the edges along a contact's radius."""
    edges = radius / fine
    coarse = min(*surface.lengths, height) / max(2.0, 2.0 * edges)
    return RefinedShape(
        interface=surface.lengths,
        height=height,
        places=places_in_reach(surface, approach, spacing=fine, tilt=tilt),
        fine=fine,
        coarse=max(coarse, fine),
        growth=_GROWTH / edges,
        element=element,
    )


def _hexahedra(
    surface: Surface,
    height: float,
    cells: tuple[int, int, int] | None,
    grading: float,
    element: str,
) -> BlockShape:
    """Return the finest member."""
    if cells is None:
        raise InputError("hexahedra need their number along x, y and z", allowed="cells")
    if element not in ("Q1", "Q2"):
        raise InputError("not an element of hexahedra", value=element, allowed="Q1, Q2")
    return BlockShape(
        interface=surface.lengths, height=height, cells=cells, grading=grading, element=element
    )


def _all_finer(family: tuple[BlockShape, ...]) -> tuple[BlockShape, ...]:
    """Refuse a family whose cells do not become smaller along all axes."""
    cells, sizes = np.array([shape.cells for shape in family]), map(characteristic_size, family)
    if len(family) > 1 and (np.any(cells[0] == cells[-1]) or np.any(np.diff([*sizes]) >= 0.0)):
        raise InputError(
            f"too few hexahedra for {len(family)} meshes that differ along x, y and z",
            value=family[-1].cells,
            allowed="more cells, or fewer meshes",
        )
    return family
