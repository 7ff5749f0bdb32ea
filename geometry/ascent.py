"""Summits of the interpolant inside or on the border of the surface, many at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from geometry.surface import Surface

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]

_MOST_STEPS = 200
_SHORTEST = 1e-10  # step that ends a climb, in cells
_ROUNDING = 4.0 * np.finfo(float).eps  # of the largest height: what is no gain
_COINCIDENT = 1e-3  # cells


def constrained_summits(
    surface: Surface, start: Array, lean: Surface | None = None, *, bounded: bool = True
) -> Array:
    """Return the summits of the closed rectangle that the surface rises to from given points.

    Newton's method on the smooth interpolant in steps of at most a cell, uphill also where the
    surface is not concave, none of which loses height. A coordinate that lies on the border with
    the slope pointing outward stays there, so that the result is a summit, a maximum along an
    edge, or a corner. Samples on a ridge that is oblique to the grid are higher than their
    neighbours without being summits: from there the climb follows the ridge, many cells if need
    be. A point that gains no height stays where it was.

    Args:
        surface: The surface; its border counts also when it is periodic.
        start: Points near the maxima, shape (n, 2) [mm].
        lean: Surface on the same rectangle whose heights add to those of the first.
        bounded: Whether the border ends the surface; a periodic one goes on otherwise.

    Returns:
        The maxima, shape (n, 2) [mm].
    """
    climb = _Climb([surface] if lean is None else [surface, lean], bounded)
    point = np.array(start, float)
    on, longest = np.arange(len(point)), np.ones(len(point))
    for _ in range(_MOST_STEPS):
        if not on.size:
            break
        here = point[on]
        moved = climb.moved(here, longest[on])
        before, after = climb.height(here), climb.height(moved)
        size = np.abs((moved - here) / climb.cell).max(axis=1)
        gained = after - before > climb.rounding
        # the last steps of Newton's method are right though the height does not show it
        taken = gained | ((size < _COINCIDENT) & (before - after <= climb.rounding))
        point[on[taken]] = moved[taken]
        longest[on] = np.where(taken, np.minimum(2.0 * longest[on], 1.0), 0.25 * size)
        on = on[(size > _SHORTEST) & (longest[on] > _SHORTEST)]
    gained = climb.height(point) - climb.height(start) > climb.rounding
    return np.where(gained[:, None], point, start)


def coincident(surface: Surface, point: Array) -> Indices:
    """Return a number for each point, the same for points at one place, shape (n,).

    Args:
        surface: The surface, whose cells tell what is one place.
        point: Points, shape (n, 2) [mm].
    """
    pairs = cKDTree(point / surface.spacing).query_pairs(_COINCIDENT, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=2 * (len(point),))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.intp)


class _Climb:
    """Steps uphill on the sum of some surfaces."""

    def __init__(self, parts: Sequence[Surface], bounded: bool) -> None:
        self._parts, self._bounded = parts, bounded
        self.cell, self._limit = np.array(parts[0].spacing), np.array(parts[0].lengths)
        self.rounding = _ROUNDING * sum(float(np.abs(part.heights).max()) for part in parts)

    def height(self, point: Array, dx: int = 0, dy: int = 0) -> Array:
        """Return heights, or a derivative of them."""
        parts = [part.interpolant(*point.T, dx=dx, dy=dy) for part in self._parts]
        return np.asarray(np.sum(parts, axis=0))

    def moved(self, point: Array, longest: Array) -> Array:
        """Return points after a step of at most ``longest`` cells, shape (n,)."""
        h = self.height
        slope = np.stack([h(point, 1, 0), h(point, 0, 1)], axis=1) * self.cell
        xx, xy, yy = h(point, 2, 0), h(point, 1, 1), h(point, 0, 2)
        curvature = np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2)
        curvature = curvature * np.multiply.outer(self.cell, self.cell)
        if self._bounded:
            low, high = point <= 0.0, point >= self._limit
            held = (low & (slope < 0.0)) | (high & (slope > 0.0))
            slope = np.where(held, 0.0, slope)
            curvature = np.where(held[:, :, None] | held[:, None, :], 0.0, curvature)
        step = _ascent(slope, curvature)
        size = np.abs(step).max(axis=1, initial=0.0)
        step *= np.divide(longest, size, out=np.ones_like(size), where=size > longest)[:, None]
        moved = point + step * self.cell
        return np.clip(moved, 0.0, self._limit) if self._bounded else moved


def _ascent(slope: Array, curvature: Array) -> Array:
    """Return Newton's steps where the surface is concave; uphill along convex directions."""
    bend, axes = np.linalg.eigh(curvature)
    along = np.einsum("nij,ni->nj", axes, slope)
    flat = np.abs(bend) < np.abs(along)  # a step of more than a cell: as long as it may be
    step = np.where(flat, np.sign(along), along / np.where(flat, 1.0, np.abs(bend) + (bend == 0.0)))
    return np.asarray(np.einsum("nij,nj->ni", axes, step))
