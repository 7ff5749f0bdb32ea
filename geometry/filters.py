"""Filters on maps of heights: areal Gaussian, spikes, cell averages on another grid."""

from __future__ import annotations

import math

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from geometry.interpolant import Interpolant

Array = NDArray[np.float64]

_ALPHA = math.sqrt(math.log(2.0) / math.pi)
"""Constant of the Gaussian weight: a wave as long as the cut-off keeps half of its amplitude."""

_REACH = 1.0
"""Distance at which the Gaussian weight is cut, over the cut-off; 6e-7 of its height is left."""

_NEIGHBOURHOOD, _SPIKE = 5, 10.0
"""Cells along a side of the neighbourhood whose median a height is compared with, and robust
standard deviations that make a spike: none on 40 self-affine surfaces, H = 0.3 … 0.95."""


def smoothed(
    heights: Array, spacing: tuple[float, float], cut_off: float, *, periodic: bool = False
) -> Array:
    """Return the waves longer than a cut-off: the areal Gaussian filter.

    The weight is exp(−π r²/(α λc)²)/(α λc)² with α = √(ln 2/π), so that a wave of length λ keeps
    exp(−π (α λc/λ)²) of its amplitude, half where λ = λc. Beyond the border of a map that is not
    periodic nothing weighs, and the weights within are divided by their sum.

    Args:
        heights: Heights, shape (nx, ny) [mm].
        spacing: Sides (dx, dy) of a cell [mm].
        cut_off: Cut-off wavelength λc [mm].
        periodic: Whether the heights continue periodically.

    Source: ISO 16610-61.
    """
    for axis, step in enumerate(spacing):
        count = heights.shape[axis]
        reach = 0 if periodic else math.ceil(_REACH * cut_off / step)
        size = count if periodic else scipy.fft.next_fast_len(count + reach, real=True)
        waves = scipy.fft.rfftfreq(size, step)  # per mm
        kept = np.exp(-math.pi * (_ALPHA * cut_off * waves) ** 2)

        def passed(values: Array, size: int = size, kept: Array = kept) -> Array:
            return scipy.fft.irfft(scipy.fft.rfft(values, size) * kept, size)[
                ..., : values.shape[-1]
            ]

        rows = passed(np.moveaxis(heights, axis, -1))
        heights = np.moveaxis(rows if periodic else rows / passed(np.ones(count)), -1, axis)
    return np.ascontiguousarray(heights)


def spikes(heights: Array, *, periodic: bool = False) -> NDArray[np.bool_]:
    """Find heights that stand out of their neighbourhood: dust and errors of an instrument.

    A spike differs from the median around it by more than 10 robust standard deviations of such
    differences. The median is taken along x, then along y; it keeps steps and edges.

    Args:
        heights: Heights without gaps, shape (nx, ny) [mm].
        periodic: Whether the heights continue periodically.
    """
    mode, median = "wrap" if periodic else "nearest", heights
    for size in ((_NEIGHBOURHOOD, 1), (1, _NEIGHBOURHOOD)):
        median = median_filter(median, size, mode=mode)
    difference = np.abs(heights - median)
    some = difference[difference > 0.0]
    if not some.size:
        return np.zeros(heights.shape, dtype=np.bool_)
    return np.asarray(difference > _SPIKE * 1.4826 * float(np.median(some)))


def regridded(
    heights: Array,
    lengths: tuple[float, float],
    grid: tuple[int, int],
    *,
    periodic: bool = False,
) -> Array:
    """Return heights on another grid of the same rectangle.

    Along a side with fewer cells a new height is the mean over its cell, so that waves too short
    for the new grid do not appear as longer ones; along a side with more cells it lies on the cubic
    spline through the old heights.

    Args:
        heights: Heights, shape (nx, ny) [mm].
        lengths: Sides (Lx, Ly) [mm].
        grid: New numbers of heights (mx, my).
        periodic: Whether the heights continue periodically.
    """
    for axis, count in enumerate(grid):
        if count < heights.shape[axis]:
            heights = np.moveaxis(_averaged(np.moveaxis(heights, axis, 0), count), 0, axis)
    if heights.shape == tuple(grid):
        return np.ascontiguousarray(heights)
    x, y = ((np.arange(n) + 0.5) * (side / n) for n, side in zip(grid, lengths, strict=True))
    return Interpolant(heights, lengths, periodic=periodic)(x[:, None], y[None, :])


def _averaged(rows: Array, count: int) -> Array:
    """Return means over ``count`` equal parts of the first axis; rows count by their share."""
    many = len(rows)
    whole = np.concatenate([np.zeros((1, rows.shape[1])), np.cumsum(rows, axis=0)])
    edges = np.arange(count + 1) * (many / count)
    below = np.minimum(edges.astype(np.intp), many - 1)
    integral = whole[below] + (edges - below)[:, None] * rows[below]
    return np.asarray(np.diff(integral, axis=0) * (count / many))
