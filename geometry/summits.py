"""Search for the summits of a surface: maxima of its samples, then a climb on its interpolant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from geometry.surface import Surface
from support.arrays import Array, Flags, Indices

_COINCIDENT = 1e-3
"""Distance of summits that are taken for one [cells]."""


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
    on_border: Flags


def grid_maxima(heights: Array) -> GridMaxima:
    """Find the cells, or plateaus of equal cells, that all neighbours stay below.

    Args:
        heights: Heights, shape (nx, ny) [mm].
    """
    candidate = heights == scipy.ndimage.maximum_filter(heights, size=3, mode="nearest")
    cells = np.argwhere(candidate)
    label = _plateaus(candidate, cells)
    # a plateau is no maximum where an equal cell beside it has a higher neighbour
    others = scipy.ndimage.maximum_filter(
        np.where(candidate, -np.inf, heights), size=3, mode="nearest"
    )
    shoulder = np.bincount(label, weights=(others == heights)[candidate]) > 0
    outer = np.any((cells == 0) | (cells == np.array(heights.shape) - 1), axis=1)
    on_border = np.bincount(label, weights=outer) > 0
    _, first = np.unique(label, return_index=True)
    start, size = cells[first], np.bincount(label)
    offsets = (cells - start[label]).T
    middle = start.astype(float)
    middle += np.stack([np.bincount(label, part) / size for part in offsets], axis=1)
    height = heights[tuple(start.T)]
    return GridMaxima(
        position=middle[~shoulder], height=height[~shoulder], on_border=on_border[~shoulder]
    )


def _plateaus(candidate: Flags, cells: Indices) -> Indices:
    """Label connected candidates (8 neighbours), numbered by first cell; neighbours are equal."""
    number = np.full(candidate.shape, -1)
    number[candidate] = np.arange(len(cells))
    pairs = []
    for offset in ((0, 1), (1, -1), (1, 0), (1, 1)):
        neighbour = cells + offset
        inside = np.all((neighbour >= 0) & (neighbour < candidate.shape), axis=1)
        other = number[tuple(neighbour[inside].T)]
        pairs.append(np.stack([np.flatnonzero(inside)[other >= 0], other[other >= 0]]))
    row, column = np.concatenate(pairs, axis=1)
    graph = scipy.sparse.coo_array((np.ones(len(row)), (row, column)), shape=2 * (len(cells),))
    _, label = scipy.sparse.csgraph.connected_components(graph, directed=False)
    _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse]


def slopes_and_curvatures(surface: Surface, point: Array) -> tuple[Array, Array]:
    """Return the first and second derivatives of the interpolant.

    Args:
        surface: The surface.
        point: Points, shape (n, 2) [mm].

    Returns:
        h_x and h_y, shape (2, n), and h_xx, h_xy and h_yy, shape (3, n) [1/mm].
    """
    first, second = ((1, 0), (0, 1)), ((2, 0), (1, 1), (0, 2))
    slopes, curvatures = (
        np.stack([surface.interpolant(*point.T, dx=dx, dy=dy) for dx, dy in orders])
        for orders in (first, second)
    )
    return slopes, curvatures


def constrained_summits(surface: Surface, start: Array) -> Array:
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

    Returns:
        The maxima, shape (n, 2) [mm].
    """
    point = np.array(start, float)
    rounding = 4.0 * np.finfo(float).eps * float(np.abs(surface.heights).max())
    on, longest = np.arange(len(point)), np.ones(len(point))
    shortest = 1e-10  # step that ends a climb, in cells
    for _ in range(200):
        if not on.size:
            break
        here = point[on]
        moved = _moved_uphill(surface, here, longest[on])
        before, after = surface.height_at(*here.T), surface.height_at(*moved.T)
        size = np.abs((moved - here) / surface.spacing).max(axis=1)
        gained = after - before > rounding
        # the last steps of Newton's method are right though the height does not show it
        taken = gained | ((size < _COINCIDENT) & (before - after <= rounding))
        point[on[taken]] = moved[taken]
        longest[on] = np.where(taken, np.minimum(2.0 * longest[on], 1.0), 0.25 * size)
        on = on[(size > shortest) & (longest[on] > shortest)]
    gained = surface.height_at(*point.T) - surface.height_at(*start.T) > rounding
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


def _moved_uphill(surface: Surface, point: Array, longest: Array) -> Array:
    """Return points after a step of at most ``longest`` cells, shape (n,)."""
    cell, border = np.array(surface.spacing), np.array(surface.lengths)
    slopes, curvatures = slopes_and_curvatures(surface, point)
    slope = slopes.T * cell
    curvature = curvatures[[0, 1, 1, 2]].T.reshape(-1, 2, 2) * np.multiply.outer(cell, cell)
    fixed = ((point <= 0.0) & (slope < 0.0)) | ((point >= border) & (slope > 0.0))
    slope = np.where(fixed, 0.0, slope)
    curvature = np.where(fixed[:, :, None] | fixed[:, None, :], 0.0, curvature)
    step = _ascent(slope, curvature)
    size = np.abs(step).max(axis=1, initial=0.0)
    step *= np.divide(longest, size, out=np.ones_like(size), where=size > longest)[:, None]
    return np.clip(point + step * cell, 0.0, border)


def _ascent(slope: Array, curvature: Array) -> Array:
    """Return Newton's steps where the surface is concave; uphill along convex directions."""
    bend, axes = np.linalg.eigh(curvature)
    along = np.einsum("nij,ni->nj", axes, slope)
    # Newton's step would be longer than a cell there
    flat = np.abs(bend) < np.abs(along)
    step = np.where(flat, np.sign(along), along / np.where(flat, 1.0, np.abs(bend) + (bend == 0.0)))
    return np.asarray(np.einsum("nij,nj->ni", axes, step))
