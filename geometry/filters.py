"""Filters on maps of heights: areal Gaussian, spikes, missing heights, averages on another grid."""

from __future__ import annotations

import math

import numpy as np
import scipy
from numpy.typing import ArrayLike

from patchlaw.geometry.interpolant import Interpolant, cell_centres
from patchlaw.support import Array, Flags, InputError, is_level

_SPIKE = 10.0
"""Standard deviations that make a spike: none on 40 self-affine surfaces, H = 0.3 … 0.95."""


def form(heights: Array, order: int) -> Array:
    """Return the least-squares polynomial of total degree ``order`` through what was measured.

    Args:
        heights: Heights, shape (nx, ny) [mm]; not a number where missing, which weighs nothing.
        order: 0 mean, 1 mean plane, 2 mean quadratic.

    Returns:
        The polynomial at all places, also those of missing heights, shape (nx, ny) [mm].

    Raises:
        InputError: For another order.
    """
    if order not in (0, 1, 2):
        raise InputError("this order of detrending is unknown", value=order, allowed="0, 1, 2")
    u, v = np.meshgrid(*((2 * np.arange(n) + 1) / n - 1 for n in heights.shape), indexing="ij")
    powers = [(i, j) for i in range(order + 1) for j in range(order + 1 - i)]
    basis = np.stack([(u**i * v**j).ravel() for i, j in powers], axis=1)
    known = ~np.isnan(heights)
    if known.all():
        weights, *_ = np.linalg.lstsq(basis, heights.ravel(), rcond=None)
    else:
        weights, *_ = np.linalg.lstsq(basis[known.ravel()], heights[known], rcond=None)
    return np.asarray((basis @ weights).reshape(heights.shape))


def levelled(heights: Array, order: int) -> Array:
    """Return what is left of heights without their form, see `form`; level where only rounding is.

    Args:
        heights: Heights, shape (nx, ny) [mm]; not a number where missing, which they stay.
        order: 0 mean, 1 mean plane, 2 mean quadratic.

    Raises:
        InputError: For another order.
    """
    rest = heights - form(heights, order)
    return np.where(np.isnan(rest), rest, 0.0) if is_level(rest, among=heights) else rest


def smoothed(
    heights: Array, spacing: tuple[float, float], cut_off: float, *, periodic: bool = False
) -> Array:
    """Return the waves longer than a cut-off: the areal Gaussian filter.

    The weight is exp(−π r²/(α λc)²)/(α λc)² with α = √(ln 2/π), so that a wave of length λ keeps
    exp(−π (α λc/λ)²) of its amplitude, half where λ = λc. Missing heights weigh nothing, nor does
    what is beyond the border of a map that is not periodic, and the weights of the others are
    divided by their sum. At a missing height the mean of those around it is known where they have
    a quarter of all weights, as they have in the corner of a map.

    Args:
        heights: Heights, shape (nx, ny) [mm]; not a number where missing.
        spacing: Sides (dx, dy) of a cell [mm].
        cut_off: Cut-off wavelength λc [mm].
        periodic: Whether the heights continue periodically.

    Returns:
        The means; not a number at missing heights that are further from all others.

    Source: ISO 16610-61; Knutsson and Westin 1993, doi 10.1109/CVPR.1993.341081.
    """
    missing = np.isnan(heights)
    if not missing.any():
        sums = _weighted(heights, spacing, cut_off, periodic)
        if periodic:
            return sums
        sides = [np.ones((n, 1)) for n in heights.shape]  # the weights are products of two
        along, across = (
            _weighted(one, (step, 1.0), cut_off, periodic, axes=(0,))
            for one, step in zip(sides, spacing, strict=True)
        )
        return np.asarray(sums / (along * across.T))
    sums, weights = (
        _weighted(one, spacing, cut_off, periodic)
        for one in (np.where(missing, 0.0, heights), np.where(missing, 0.0, 1.0))
    )
    return np.where(missing & (weights < 0.25), np.nan, sums / np.where(weights > 0.0, weights, 1))


def _weighted(
    heights: Array,
    spacing: tuple[float, float],
    cut_off: float,
    periodic: bool,
    axes: tuple[int, ...] = (0, 1),
) -> Array:
    """Return the sums of heights with the Gaussian weights of a cut-off along some axes."""
    alpha = math.sqrt(math.log(2.0) / math.pi)
    for axis in axes:
        step, count = spacing[axis], heights.shape[axis]
        # at the distance of a cut-off 6e-7 of the weight are left
        reach = 0 if periodic else math.ceil(cut_off / step)
        size = count if periodic else scipy.fft.next_fast_len(count + reach, real=True)
        waves = scipy.fft.rfftfreq(size, step)  # per mm
        kept = np.exp(-math.pi * (alpha * cut_off * waves) ** 2)
        rows = scipy.fft.rfft(np.moveaxis(heights, axis, -1), size) * kept
        heights = np.moveaxis(scipy.fft.irfft(rows, size)[..., :count], -1, axis)
    return np.ascontiguousarray(heights)


def spikes(heights: Array, spacing: tuple[float, float], order: int = 1) -> Flags:
    """Find heights that stand out of their neighbourhood: dust, errors of an instrument, codes.

    * A height that differs from the median around it by more than 10 robust standard deviations of
      such differences. The median is taken along x, then along y; it keeps steps and edges.
    * A height most of whose neighbours are missing, when it is further than 10 standard deviations
      of the others from the membrane that hangs between those.
    * The lowest or highest value, when several heights have exactly it and its distance from all
      others is more than their range: it means "no data".

    The first two are looked for without the form of the other heights, so that the tilt of a
    specimen makes and hides none.

    Args:
        heights: Heights, shape (nx, ny) [mm]; not a number where missing.
        spacing: Sides (dx, dy) of a cell [mm].
        order: Degree of the form.
    """
    spiking, increment = np.zeros(heights.shape, dtype=np.bool_), _increment(heights)

    def local(heights: Array) -> Flags:
        return _local_spikes(heights, form(heights, order), increment)

    def lonely(heights: Array) -> Flags:
        return _lonely_spikes(levelled(heights, order), spacing)

    with np.errstate(over="ignore", invalid="ignore"):  # heights of no scale are refused later
        # a spike misleads no later search; a huge one tilts the form of the first
        for search in (_codes, local, local, lonely, _codes):
            known = np.where(spiking, np.nan, heights)
            if not np.isnan(known).all():
                spiking |= search(known)
    return spiking


def _increment(heights: Array) -> float:
    """Return the increment that all heights are whole numbers of; 0 where there is none [mm]."""
    some = heights.ravel()[:: max(heights.size // 2**16, 1)]
    levels = np.unique(some[np.isfinite(some)])
    if len(levels) < 2:
        return 0.0
    counts = (levels - levels[0]) / (increment := float(np.diff(levels).min()))
    return increment if float(np.abs(counts - np.rint(counts)).max()) < 1e-3 else 0.0


def _local_spikes(heights: Array, form: Array, increment: float) -> Flags:
    """Find heights that, without their form, differ much from the median of their neighbours."""
    rest = heights - form
    difference = np.abs(rest - _median(_median(rest).T).T)  # not a number where missing
    some = difference[difference > 1e-13 * (np.abs(heights) + np.abs(form))]  # beyond rounding
    if not some.size:
        return np.zeros(heights.shape, dtype=np.bool_)
    # heights in whole numbers rise by one now and then, and are level in between
    return np.asarray(difference > _SPIKE * max(1.4826 * float(np.median(some)), increment))


def _median(rows: Array) -> Array:
    """Return medians of five along the first axis.

    What is missing, or beyond the border, lies on the line through the two heights on the other
    side; where these are missing too the middle one stands for it.
    """
    if rows.size > 2**20 and rows.shape[1] > 1:  # 120 bytes for each height at once
        half = rows.shape[1] // 2
        return np.hstack([_median(rows[:, :half]), _median(rows[:, half:])])
    padded = np.pad(rows, ((2, 2), (0, 0)), constant_values=np.nan)
    far_below, below, here, above, far_above = (padded[k : k + len(rows)] for k in range(5))
    window = np.stack(
        [
            np.where(np.isnan(far_below), 4.0 * above - 3.0 * far_above, far_below),
            np.where(np.isnan(below), 3.0 * above - 2.0 * far_above, below),
            here,
            np.where(np.isnan(above), 3.0 * below - 2.0 * far_below, above),
            np.where(np.isnan(far_above), 4.0 * below - 3.0 * far_below, far_above),
        ]
    )
    window = np.where(np.isnan(window), here, window)
    return np.where(np.isnan(rows), np.nan, np.partition(window, 2, axis=0)[2])


def _lonely_spikes(heights: Array, spacing: tuple[float, float]) -> Flags:
    """Find heights among missing ones that are far from the membrane between all others."""
    known = np.isfinite(heights)
    near, cells = (
        scipy.ndimage.uniform_filter(part.astype(float), 5, mode="constant")
        for part in (known, np.ones_like(known))
    )
    lonely = known & (near < 0.5 * cells)
    others = heights[known & ~lonely]
    if not (lonely.any() and others.size):
        return np.zeros_like(known)
    membrane, _ = filled(np.where(lonely, np.nan, heights), spacing)
    return np.asarray(lonely & (np.abs(heights - membrane) > _SPIKE * float(others.std())))


def _codes(heights: Array) -> Flags:
    """Find a lowest or highest value that means "no data"."""
    known = np.isfinite(heights)
    codes = np.zeros(heights.shape, dtype=np.bool_)
    for code in (heights[known].min(), heights[known].max()) if known.any() else ():
        same = heights == code
        others = heights[known & ~same]
        if np.count_nonzero(same) < 3 or not others.size or is_level(others):
            continue
        if float(np.abs(others - code).min()) > float(np.ptp(others)):
            codes |= same
    return codes


def filled(heights: ArrayLike, spacing: tuple[float, float]) -> tuple[Array, float]:
    """Replace missing heights by a membrane that hangs between the others.

    The filled heights minimise ∫ |∇h|² (Laplace's equation, five-point differences), free on the
    border of the grid. They lie between the lowest and the highest of the heights around them, so
    that no summit is invented; a summit that was not measured stays unknown.

    Args:
        heights: Heights, shape (nx, ny) [mm]; missing where not a number.
        spacing: Sides (dx, dy) of a cell [mm].

    Returns:
        The heights, and the share of them that was missing.

    Raises:
        InputError: When all are missing.
    """
    whole = np.array(heights, dtype=np.float64)
    missing = np.isnan(whole)
    if missing.all():
        raise InputError("all heights are missing", allowed="heights to fill gaps from")
    if missing.any():
        whole[missing] = _membrane(whole, missing, spacing)
    return whole, float(missing.mean())


def _membrane(heights: Array, missing: Flags, spacing: tuple[float, float]) -> Array:
    """Return the heights at the gaps, in the order of the array."""
    number = np.full(heights.shape, -1)
    number[missing] = np.arange(np.count_nonzero(missing))
    ends, others, weights = [], [], []
    for axis, step in enumerate(spacing):
        one = np.moveaxis(np.arange(heights.size).reshape(heights.shape), axis, 0)
        for here, there in ((one[:-1], one[1:]), (one[1:], one[:-1])):
            gap = missing.ravel()[here]
            ends.append(here[gap])
            others.append(there[gap])
            weights.append(np.full(int(gap.sum()), (min(spacing) / step) ** 2))
    cell, other, weight = np.concatenate(ends), np.concatenate(others), np.concatenate(weights)
    row, column, count = number.ravel()[cell], number.ravel()[other], int(missing.sum())
    inside = column >= 0
    right = np.bincount(
        row[~inside], weights=weight[~inside] * heights.ravel()[other[~inside]], minlength=count
    )
    diagonal = np.bincount(row, weights=weight, minlength=count)
    entries = np.concatenate((-weight[inside], diagonal))
    rows = np.concatenate((row[inside], np.arange(count)))
    columns = np.concatenate((column[inside], np.arange(count)))
    matrix = scipy.sparse.coo_matrix((entries, (rows, columns)), shape=(count, count)).tocsc()
    from scipy.sparse.linalg import spsolve  # few maps need it

    return np.asarray(spsolve(matrix, right))


def regridded(
    heights: Array, lengths: tuple[float, float], grid: tuple[int, int], *, periodic: bool = False
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
    x, y = map(cell_centres, lengths, grid)
    return Interpolant(heights, lengths, periodic=periodic)(x[:, None], y[None])


def _averaged(rows: Array, count: int) -> Array:
    """Return means over ``count`` equal parts of the first axis; rows count by their share."""
    many = len(rows)
    whole = np.concatenate([np.zeros((1, rows.shape[1])), np.cumsum(rows, axis=0)])
    edges = np.arange(count + 1) * (many / count)
    below = np.minimum(edges.astype(np.intp), many - 1)
    integral = whole[below] + (edges - below)[:, None] * rows[below]
    return np.asarray(np.diff(integral, axis=0) * (count / many))
