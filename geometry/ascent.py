"""Summits of the interpolant inside or on the border of the surface, many at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.surface import Surface

Array = NDArray[np.float64]

_NEWTON_STEPS = 8
_WITHIN = 1.0 - 1e-9


def constrained_summits(surface: Surface, start: Array, lean: Surface | None = None) -> Array:
    """Return the highest points of the closed rectangle next to given ones.

    Newton's method on the smooth interpolant, projected on the rectangle: a coordinate that lies
    on the border with the slope pointing outward stays there, so that the result is a summit, a
    maximum along an edge, or a corner. Where the surface is not concave a coordinate climbs by up
    to a cell. A point whose iteration leaves ±1 cell or gains no height stays where it was.

    Args:
        surface: The surface; its border counts also when it is periodic.
        start: Points near the maxima, shape (n, 2) [mm].
        lean: Surface on the same rectangle whose heights add to those of the first.

    Returns:
        The maxima, shape (n, 2) [mm].
    """
    parts, limit = [surface] if lean is None else [surface, lean], np.array(surface.lengths)

    def h(point: Array, dx: int = 0, dy: int = 0) -> Array:
        return np.sum([part.interpolant(*point.T, dx=dx, dy=dy) for part in parts], axis=0)

    reach, point = np.array(surface.spacing), start.copy()
    for _ in range(_NEWTON_STEPS):
        slope = np.stack([h(point, 1, 0), h(point, 0, 1)], axis=1)
        curvature = np.stack([h(point, 2, 0), h(point, 1, 1), h(point, 0, 2)], axis=1)
        held = ((point <= 0.0) & (slope < 0.0)) | ((point >= limit) & (slope > 0.0))
        step = np.where(held, 0.0, _ascent(slope, curvature, held, reach))
        point = np.clip(point + step, start - reach, start + reach)
        point = np.clip(point, 0.0, limit)
    gained = h(point) > h(start)
    inside = np.all(np.abs(point - start) < _WITHIN * reach, axis=1)
    return np.where((gained & inside)[:, None], point, start)


def _ascent(slope: Array, curvature: Array, held: NDArray[np.bool_], reach: Array) -> Array:
    """Return Newton's steps where the surface is concave, else uphill along each axis."""
    xx, xy, yy = curvature.T
    concave = (xx < 0.0) & (yy < 0.0) & (xx * yy > xy**2) & ~held.any(axis=1)
    det = np.where(concave, xx * yy - xy**2, 1.0)
    together = np.stack([xy * slope[:, 1] - yy * slope[:, 0], xy * slope[:, 0] - xx * slope[:, 1]])
    own = np.stack([xx, yy], axis=1)
    alone = np.where(own < 0.0, -slope / np.where(own < 0.0, own, 1.0), np.sign(slope) * reach)
    return np.where(concave[:, None], together.T / det[:, None], alone)
