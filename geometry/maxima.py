"""Local maxima of a height map among 8 neighbours, plateaus counted once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Array = NDArray[np.float64]


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
    candidate = heights == maximum_filter(heights, size=3, mode=mode)
    cells = np.argwhere(candidate)
    label = _plateaus(candidate, cells, periodic=periodic)
    # A plateau that goes on over an equal cell which is no candidate has a higher neighbour there.
    beside = maximum_filter(np.where(candidate, -np.inf, heights), size=3, mode=mode)
    shoulder = np.bincount(label, weights=(beside == heights)[candidate]) > 0
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
        beside = cells + offset
        inside = np.all((beside >= 0) & (beside < candidate.shape), axis=1) | periodic
        other = number[tuple((beside[inside] % candidate.shape).T)]
        pairs.append(np.stack([np.flatnonzero(inside)[other >= 0], other[other >= 0]]))
    row, column = np.concatenate(pairs, axis=1)
    graph = coo_array((np.ones(len(row)), (row, column)), shape=2 * (len(cells),))
    _, label = connected_components(graph, directed=False)
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
