"""Peaks of a sampled surface, the catchments that climb to them and the passes between.

Every sample climbs to the highest of its 8 neighbours until it reaches a peak; the samples that
reach the same peak are its catchment. The climb never goes down, so above any level a catchment
is connected, and two of them are one region when their pass lies above the level.
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


class Passes(NamedTuple):
    """Touching pairs of catchments.

    Attributes:
        first: Smaller peak numbers, shape (m,).
        second: Larger peak numbers, shape (m,).
        height: Heights of the highest pass between them, shape (m,) [mm].
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


def watersheds(heights: Array) -> tuple[Indices, Indices]:
    """Return the peak number of every sample, shape (nx ny,), and the peaks' flat indices.

    Equal neighbours climb to the one with the larger flat index; a plateau has one peak, or
    several whose passes are as high as they are.

    Args:
        heights: Samples, shape (nx, ny) [mm].
    """
    nx, ny = heights.shape
    padded = np.pad(heights, 1, constant_values=-np.inf)
    best, climb = heights.copy(), np.zeros(heights.shape, dtype=np.intp)
    for i, j in _NEIGHBOURS:
        beside = padded[1 + i : 1 + i + nx, 1 + j : 1 + j + ny]
        ahead = i * ny + j > climb
        better = (beside > best) | ((beside == best) & ahead)
        best[better], climb[better] = beside[better], i * ny + j
    target = np.arange(heights.size) + climb.ravel()
    while not np.array_equal(target, further := target[target]):
        target = further
    peak = np.flatnonzero(climb.ravel() == 0)
    number = np.empty(heights.size, dtype=np.intp)
    number[peak] = np.arange(len(peak))
    return number[target], peak


def passes_between(heights: Array, owner: Indices) -> Passes:
    """Return the highest pass between every two catchments that touch.

    Args:
        heights: Samples, shape (nx, ny) [mm].
        owner: Peak number of every sample, −1 for samples left out, shape (nx, ny).
    """
    pairs, level = [], []
    for i, j in _HALF:
        here = np.s_[: -i or None, max(-j, 0) : -j if j > 0 else None]
        there = np.s_[i:, max(j, 0) : j if j < 0 else None]
        first, second = owner[here], owner[there]
        touch = (first != second) & (first >= 0) & (second >= 0)
        pairs.append(np.stack([first[touch], second[touch]]))
        level.append(np.minimum(heights[here][touch], heights[there][touch]))
    first, second = np.sort(np.concatenate(pairs, axis=1), axis=0)
    height = np.concatenate(level)
    order = np.lexsort((-height, second, first))
    first, second, height = first[order], second[order], height[order]
    highest = np.ones(len(first), dtype=bool)
    highest[1:] = (first[1:] != first[:-1]) | (second[1:] != second[:-1])
    return Passes(first[highest], second[highest], height[highest])
