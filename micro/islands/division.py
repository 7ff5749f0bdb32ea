"""Division of a sampled surface into watersheds, one for each peak, and the saddles between them.

Every sample climbs to the highest of its 8 neighbours until it reaches a peak. The samples that
reach the same peak are its watershed. The climb never goes down, so above any level a watershed
is connected, and two of them are one region when their saddle lies above the level.

Theory: demos/theory.md, section 9.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import Surface

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_FINEST = 8
_MOST_SAMPLES = 2**18
_HALF = ((0, 1), (1, -1), (1, 0), (1, 1))
_NEIGHBOURS = (*_HALF, *((-i, -j) for i, j in _HALF))


class Saddles(NamedTuple):
    """The saddles between touching pairs of watersheds.

    Attributes:
        first: Smaller peak numbers, shape (m,).
        second: Larger peak numbers, shape (m,).
        height: Heights of the highest saddle between them, shape (m,) [mm].
    """

    first: Indices
    second: Indices
    height: Array


def sampled(surface: Surface) -> Array:
    """Return heights at the centres of cells that divide those of the surface.

    A surface of few cells is sampled more finely on its interpolant: up to 8 samples per cell and
    direction, 512 × 512 in all.

    Args:
        surface: The surface.
    """
    finer = min(_FINEST, int(np.sqrt(_MOST_SAMPLES / surface.heights.size)))
    if finer <= 1:
        return surface.heights
    x, y = (
        (np.arange(cells * finer) + 0.5) * side / finer
        for cells, side in zip(surface.grid, surface.spacing, strict=True)
    )
    return surface.height_at(x[:, None], y)


def divided(heights: Array) -> tuple[Indices, Indices]:
    """Return the peak number of every sample, shape (nx ny,), and the peaks' flat indices.

    Equal neighbours climb to the one with the larger flat index; a plateau has one peak, or
    several whose saddles are as high as they are.

    Args:
        heights: Samples, shape (nx, ny) [mm].
    """
    nx, ny = heights.shape
    padded = np.pad(heights, 1, constant_values=-np.inf)
    best, climb = heights.copy(), np.zeros(heights.shape, dtype=np.intp)
    for i, j in _NEIGHBOURS:
        neighbour = padded[1 + i : 1 + i + nx, 1 + j : 1 + j + ny]
        ahead = i * ny + j > climb
        better = (neighbour > best) | ((neighbour == best) & ahead)
        best[better], climb[better] = neighbour[better], i * ny + j
    target = np.arange(heights.size) + climb.ravel()
    while not np.array_equal(target, higher := target[target]):
        target = higher
    peak = np.flatnonzero(climb.ravel() == 0)
    number = np.empty(heights.size, dtype=np.intp)
    number[peak] = np.arange(len(peak))
    return number[target], peak


def saddles_between(heights: Array, owner: Indices) -> Saddles:
    """Return the highest saddle between every two watersheds that touch.

    Args:
        heights: Samples, shape (nx, ny) [mm].
        owner: Peak number of every sample, −1 for samples left out, shape (nx, ny).
    """
    pairs, level = [], []
    for i, j in _HALF:
        here = np.s_[: -i or None, max(-j, 0) : -j if j > 0 else None]
        there = np.s_[i:, max(j, 0) : j if j < 0 else None]
        first, second = owner[here], owner[there]
        touching = (first != second) & (first >= 0) & (second >= 0)
        pairs.append(np.stack([first[touching], second[touching]]))
        level.append(np.minimum(heights[here][touching], heights[there][touching]))
    first, second = np.sort(np.concatenate(pairs, axis=1), axis=0)
    height = np.concatenate(level)
    order = np.lexsort((-height, second, first))
    first, second, height = first[order], second[order], height[order]
    highest = np.ones(len(first), dtype=bool)
    highest[1:] = (first[1:] != first[:-1]) | (second[1:] != second[:-1])
    return Saddles(first[highest], second[highest], height[highest])
