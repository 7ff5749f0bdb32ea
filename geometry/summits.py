"""Search for the summits of a surface: maxima of its samples, then a climb on its interpolant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from geometry.surface import Surface

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]

_MOST_STEPS = 200
_SHORTEST = 1e-10
"""Step that ends a climb [cells]."""
_COINCIDENT = 1e-3
"""Distance of summits that are taken for one [cells]."""
_ROUNDING = 4.0 * np.finfo(float).eps
"""Gain of height that is only rounding, relative to the largest height."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GridMaxima:
    """Local maxima of a height map, in the order of their first cells.

    Args:
        position: Index coordinates (ix, iy), the mean of the cells of a plateau, shape (n, 2).
        height: Heights, shape (n,) [mm].
        on_border: Whether a cell of the maximum lies on the border, where not all 8 neighbours
            exist, shape (n,).
    """

    position: Array
    height: Array
    on_border: NDArray[np.bool_]


def grid_maxima(heights: Array, *, periodic: bool) -> GridMaxima:
    """Find the cells, or plateaus of equal cells, that all neighbours stay below.

    Args:
        heights: Heights, shape (nx, ny) [mm].
        periodic: Whether the neighbours are taken across the border.
    """
    mode = "wrap" if periodic else "nearest"
    candidate = heights == scipy.ndimage.maximum_filter(heights, size=3, mode=mode)
    cells = np.argwhere(candidate)
    label = _plateaus(candidate, cells, periodic=periodic)
    # a plateau is no maximum where an equal cell beside it has a higher neighbour
    others = scipy.ndimage.maximum_filter(np.where(candidate, -np.inf, heights), size=3, mode=mode)
    shoulder = np.bincount(label, weights=(others == heights)[candidate]) > 0
    outer = np.any((cells == 0) | (cells == np.array(heights.shape) - 1), axis=1)
    on_border = np.bincount(label, weights=outer & (not periodic)) > 0
    _, first = np.unique(label, return_index=True)
    position = _centroids(cells, label, first, heights.shape)
    height = heights[tuple(cells[first].T)]
    return GridMaxima(
        position=position[~shoulder], height=height[~shoulder], on_border=on_border[~shoulder]
    )


def _plateaus(
    candidate: NDArray[np.bool_], cells: NDArray[np.intp], *, periodic: bool
) -> NDArray[np.intp]:
    """Label connected candidates (8 neighbours), numbered by first cell; neighbours are equal."""
    number = np.full(candidate.shape, -1)
    number[candidate] = np.arange(len(cells))
    pairs = []
    for offset in ((0, 1), (1, -1), (1, 0), (1, 1)):
        neighbour = cells + offset
        inside = np.all((neighbour >= 0) & (neighbour < candidate.shape), axis=1) | periodic
        other = number[tuple((neighbour[inside] % candidate.shape).T)]
        pairs.append(np.stack([np.flatnonzero(inside)[other >= 0], other[other >= 0]]))
    row, column = np.concatenate(pairs, axis=1)
    graph = scipy.sparse.coo_array((np.ones(len(row)), (row, column)), shape=2 * (len(cells),))
    _, label = scipy.sparse.csgraph.connected_components(graph, directed=False)
    _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse]


def _centroids(
    cells: NDArray[np.intp], label: NDArray[np.intp], first: NDArray[np.intp], shape: tuple
) -> Array:
    """Return the mean index coordinates of every plateau, measured the short way from its first."""
    half = np.array(shape) // 2
    offset = (cells - cells[first][label] + half) % shape - half
    size = np.bincount(label)
    mean = np.stack([np.bincount(label, weights=part) / size for part in offset.T], axis=1)
    return cells[first] + mean


def constrained_summits(surface: Surface, start: Array, *, bounded: bool = True) -> Array:
    """Return the summits of the closed rectangle that the surface rises to from given points.

    Newton's method climbs the smooth interpolant in steps of at most a cell, uphill also where the
    surface is not concave; steps that lose height are shortened. A coordinate that lies on the
    border with the slope pointing outward stays there, so that the result is a summit, a maximum
    along an edge, or a corner. Samples on a ridge that is oblique to the grid are higher than their
    neighbours without being summits. From there the climb follows the ridge, over many cells if
    necessary. A point that gains no height stays where it was.

    Args:
        surface: The surface; its border counts also when it is periodic.
        start: Points near the maxima, shape (n, 2) [mm].
        bounded: Whether climbs end at the border; otherwise the surface continues periodically.

    Returns:
        The maxima, shape (n, 2) [mm].
    """
    climb = _Climb(surface, bounded)
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
        surface: The surface; points less than a thousandth of its cells apart are at one place.
        point: Points, shape (n, 2) [mm].
    """
    pairs = scipy.spatial.cKDTree(point / surface.spacing).query_pairs(
        _COINCIDENT, output_type="ndarray"
    )
    links = scipy.sparse.coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=2 * (len(point),))
    return np.asarray(
        scipy.sparse.csgraph.connected_components(links, directed=False)[1], dtype=np.intp
    )


class _Climb:
    """Steps uphill on a surface."""

    def __init__(self, surface: Surface, bounded: bool) -> None:
        self._surface, self._bounded = surface, bounded
        self.cell, self._limit = np.array(surface.spacing), np.array(surface.lengths)
        self.rounding = _ROUNDING * float(np.abs(surface.heights).max())

    def height(self, point: Array, dx: int = 0, dy: int = 0) -> Array:
        """Return heights, or a derivative of them."""
        return self._surface.interpolant(*point.T, dx=dx, dy=dy)

    def moved(self, point: Array, longest: Array) -> Array:
        """Return points after a step of at most ``longest`` cells, shape (n,)."""
        h = self.height
        slope = np.stack([h(point, 1, 0), h(point, 0, 1)], axis=1) * self.cell
        xx, xy, yy = h(point, 2, 0), h(point, 1, 1), h(point, 0, 2)
        curvature = np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2)
        curvature = curvature * np.multiply.outer(self.cell, self.cell)
        if self._bounded:
            low, high = point <= 0.0, point >= self._limit
            fixed = (low & (slope < 0.0)) | (high & (slope > 0.0))
            slope = np.where(fixed, 0.0, slope)
            curvature = np.where(fixed[:, :, None] | fixed[:, None, :], 0.0, curvature)
        step = _ascent(slope, curvature)
        size = np.abs(step).max(axis=1, initial=0.0)
        step *= np.divide(longest, size, out=np.ones_like(size), where=size > longest)[:, None]
        moved = point + step * self.cell
        return np.clip(moved, 0.0, self._limit) if self._bounded else moved


def _ascent(slope: Array, curvature: Array) -> Array:
    """Return Newton's steps where the surface is concave; uphill along convex directions."""
    bend, axes = np.linalg.eigh(curvature)
    along = np.einsum("nij,ni->nj", axes, slope)
    # Newton's step would be longer than a cell there
    flat = np.abs(bend) < np.abs(along)
    step = np.where(flat, np.sign(along), along / np.where(flat, 1.0, np.abs(bend) + (bend == 0.0)))
    return np.asarray(np.einsum("nij,nj->ni", axes, step))
