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
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from scipy.ndimage import distance_transform_edt

from geometry.meshes.block import BlockShape
from geometry.meshes.refined_block import RefinedShape
from geometry.rigid_plane import RigidPlane
from geometry.surface import Surface
from support.arrays import Array
from support.errors import InputError

Shape: TypeAlias = BlockShape | RefinedShape
Cells: TypeAlias = Literal["tetrahedra", "hexahedra"]

EDGES = 3.0
"""Edges along the radius of a typical contact in the finest tetrahedra, by default."""


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
    factors = [2.0 ** (k / max(count - 1, 1)) for k in reversed(range(count))]
    if mesh == "hexahedra":
        return _hexahedra(surface, height, cells, factors, grading=grading, element=element or "Q1")
    if mesh != "tetrahedra":
        raise InputError(
            "these cells are unknown", value=mesh, allowed=", ".join(map(repr, get_args(Cells)))
        )
    radius = radius or contact_radius(surface, approach, tilt=tilt)
    smallest = radius / EDGES if fine is None else fine
    if not 0.0 < smallest < math.inf:
        raise InputError("the finest edge length is out of range", value=fine, allowed="> 0 mm")

    def member(fine: float) -> RefinedShape:
        """Return a shape, whose sizes all follow from the edges along a contact's radius."""
        edges = radius / fine
        coarse = min(*surface.lengths, height) / max(2.0, 2.0 * edges)
        return RefinedShape(
            interface=surface.lengths,
            height=height,
            places=places_in_reach(surface, approach, spacing=fine, tilt=tilt),
            fine=fine,
            coarse=max(coarse, fine),
            growth=1.2 / edges,
            element=element or "P2",
        )

    return tuple(member(smallest * factor) for factor in factors)


def _hexahedra(
    surface: Surface,
    height: float,
    cells: tuple[int, int, int] | None,
    factors: list[float],
    **options: Any,
) -> tuple[BlockShape, ...]:
    """Return a family of hexahedra whose cells become smaller along all axes."""
    if cells is None:
        raise InputError("hexahedra need their number along x, y and z", allowed="cells")
    if options["element"] not in ("Q1", "Q2"):
        raise InputError("not an element of hexahedra", value=options["element"], allowed="Q1, Q2")
    finest = BlockShape(interface=surface.lengths, height=height, cells=cells, **options)
    counts = np.maximum(1, np.rint(np.outer(1.0 / np.array(factors), finest.cells))).astype(int)
    family = tuple(replace(finest, cells=tuple(row)) for row in counts)
    sizes = [characteristic_size(shape) for shape in family]
    if len(family) > 1 and (np.any(counts[0] == counts[-1]) or np.any(np.diff(sizes) >= 0.0)):
        raise InputError(
            f"too few hexahedra for {len(family)} meshes that differ along x, y and z",
            value=finest.cells,
            allowed="more cells, or fewer meshes",
        )
    return family


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


def places_in_reach(
    surface: Surface,
    approach: float,
    *,
    spacing: float,
    tilt: tuple[float, float] = (0.0, 0.0),
) -> Array:
    """Return the places that the plane can touch: where the undeformed surface interferes with it.

    Under pressure a half-space only moves away from the plane, so that contact occurs nowhere else.

    Args:
        surface: The rough surface.
        approach: Largest approach at the middle of the surface [mm].
        spacing: Distance between places [mm].
        tilt: Slopes of the approach along x and y.

    Returns:
        Points of a square lattice, shape (n, 2) [mm]; at least that of the largest depth.
    """
    x, y = (
        np.linspace(0.0, length, max(2, math.ceil(length / spacing) + 1))
        for length in surface.lengths
    )
    lattice = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    top = np.array([surface.highest_point])
    depth = np.concatenate(
        [
            depth_below_plane(surface, x[:, None], y[None, :], approach, tilt).ravel(),
            depth_below_plane(surface, top[:, 0], top[:, 1], approach, tilt),
        ]
    )
    return np.vstack([lattice, top])[depth >= min(0.0, float(depth.max()))]


def depth_below_plane(
    surface: Surface, x: Array, y: Array, approach: float, tilt: tuple[float, float] = (0.0, 0.0)
) -> Array:
    """Return the interference of the undeformed surface and the rigid plane [mm].

    Args:
        surface: The rough surface.
        x: Abscissae [mm].
        y: Ordinates, broadcast with the abscissae [mm].
        approach: Approach at the middle of the surface, from first touch of a level plane [mm].
        tilt: Slopes of the approach along x and y.

    Returns:
        Interference at every place; negative where there is a gap.

    Raises:
        InputError: When a value is not finite.
    """
    plane = RigidPlane.above(surface, approach, tilt)
    return surface.height_at(x, y) - surface.highest + plane.at(x, y)


def contact_radius(
    surface: Surface, approach: float, *, tilt: tuple[float, float] = (0.0, 0.0)
) -> float:
    """Estimate the radius of a typical contact from the surface alone [mm].

    The surface behind the undeformed plane consists of caps. In a disc of radius r the mean
    distance from the edge is r / 3, which is used for caps of any form. The contact of a cap has
    1/√2 of the cap's radius (Hertz). Where more than a twentieth of the surface lies behind the
    plane, contacts merge and bear the plane together: only the highest twentieth counts then.

    Args:
        surface: The rough surface.
        approach: Approach at the middle of the surface [mm].
        tilt: Slopes of the approach along x and y.

    Returns:
        The radius, at least the distance of the surface's samples.

    Raises:
        InputError: When a value is not finite.
    """
    x, y = (
        np.linspace(0.0, length, min(max(256, 2 * n), 1024) + 1)
        for length, n in zip(surface.lengths, surface.grid, strict=True)
    )
    depth = depth_below_plane(surface, x[:, None], y[None, :], approach, tilt)
    level = float(np.quantile(depth, 0.95))
    inside = depth >= level if level > 0.0 else depth > 0.0
    least = max(surface.spacing)
    if not inside.any():
        return least
    if inside.all():
        return 0.5 * min(surface.lengths)
    step = (x[1], y[1])
    # a point lies on average half a step further inside than its distance from those outside
    distance = distance_transform_edt(inside, sampling=step)[inside] - 0.5 * min(step)
    return max(3.0 * float(distance.mean()) / math.sqrt(2.0), least)
