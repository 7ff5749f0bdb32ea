"""Size of a typical contact, estimated from the surface alone.

Of a cap in reach of the plane Hertz' contact takes half the area, whatever its curvature.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import distance_transform_edt

from geometry.errors import InputError
from geometry.surface import Surface

EDGES = 3.0
"""Edges along the radius of a typical contact, of the finest tetrahedra unless stated."""

_MERGING = 0.05
"""Share of the surface in reach above which contacts merge instead of growing wider."""


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
