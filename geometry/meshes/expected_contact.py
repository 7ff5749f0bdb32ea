"""Where contact can occur and how wide it will be, from the undeformed surface and plane alone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from geometry.rigid_plane import RigidPlane
from geometry.surface import Surface

Array = NDArray[np.float64]

_MERGING = 0.05
"""Share of the surface behind the plane above which contacts merge instead of growing wider."""


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
