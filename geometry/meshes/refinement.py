"""Where a mesh has to be fine, and how fine: judged from the rough surface and the plane alone.

Of a cap that the plane can touch, Hertz's contact takes half the area, whatever its curvature.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from geometry.errors import InputError
from geometry.surface import Surface

Array = NDArray[np.float64]

EDGES = 3.0
"""Edges along the radius of a typical contact, of the finest tetrahedra unless stated."""

_MERGING = 0.05
"""Share of the surface in reach above which contacts merge instead of growing wider."""


def places_in_reach(
    surface: Surface,
    approach: float,
    *,
    spacing: float,
    tilt: tuple[float, float] = (0.0, 0.0),
) -> Array:
    """Return places that the plane can touch: where the surface stands out behind it.

    The half-space only moves away under pressure, so that nothing else can come into contact.

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
    grid = np.vstack([lattice, surface.highest_point])
    depth = depth_below_plane(surface, grid, approach, tilt)
    return grid[depth >= min(0.0, float(depth.max()))]


def depth_below_plane(
    surface: Surface, points: Array, approach: float, tilt: tuple[float, float] = (0.0, 0.0)
) -> Array:
    """Return how far the undeformed surface stands out behind the rigid plane [mm].

    Args:
        surface: The rough surface.
        points: Places on it, shape (…, 2) [mm].
        approach: Approach at the middle of the surface, from first touch of a level plane [mm].
        tilt: Slopes of the approach along x and y.

    Returns:
        Depths, shape (…); negative where there is a gap.
    """
    lean = (points - 0.5 * np.array(surface.lengths)) @ np.array(tilt)
    return surface.height_at(points[..., 0], points[..., 1]) - surface.highest + approach + lean


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


def contact_radius(
    surface: Surface, approach: float, *, tilt: tuple[float, float] = (0.0, 0.0)
) -> float:
    """Estimate the radius of a typical contact from the surface alone [mm].

    In a disc of radius r the mean distance from the edge is r / 3, which also serves patches of
    other forms; the contact of a cap has 1/√2 of its radius (Hertz). Where more than a twentieth
    of the surface is in reach, contacts merge and neighbours hold the plane off: the highest
    twentieth counts.

    Args:
        surface: The rough surface.
        approach: Approach at the middle of the surface [mm].
        tilt: Slopes of the approach along x and y.

    Returns:
        The radius, at least the distance of the surface's samples.

    Raises:
        InputError: When a value is not finite.
    """
    if not np.isfinite([approach, *tilt]).all():
        raise InputError("approach and tilt must be finite", value=(approach, *tilt))
    x, y = (
        np.linspace(0.0, length, min(max(256, 2 * n), 1024) + 1)
        for length, n in zip(surface.lengths, surface.grid, strict=True)
    )
    plane = tilt[0] * (x[:, None] - 0.5 * x[-1]) + tilt[1] * (y - 0.5 * y[-1])
    heights = surface.height_at(x[:, None], y[None, :])
    depth = heights - surface.highest + approach + plane
    level = float(np.quantile(depth, 1.0 - _MERGING))
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
