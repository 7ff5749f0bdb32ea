"""What is done to a measured map before it is a surface that is pressed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from geometry.filters import filled, regridded, smoothed, spikes
from geometry.plausibility import MAPS, check_slopes
from geometry.surface import Surface
from support.arrays import Array, Flags
from support.checks import cell_counts
from support.errors import InputError
from support.fields import Heights, Length, PositiveLength

Interval = tuple[Length, Length]


@dataclass(frozen=True, slots=True, kw_only=True)
class Crop:
    """The rectangle of a map that is kept, rounded to whole cells; all of an axis not given.

    Args:
        x: Where the kept part begins and ends along x [mm]; all of it when not given.
        y: Where the kept part begins and ends along y [mm]; all of it when not given.
    """

    x: Interval | None = None
    y: Interval | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Filter:
    """Cut-off wavelengths of the areal Gaussian filter, ISO 16610-61.

    Half of the amplitude passes at a cut-off.

    Args:
        short: S-filter: waves shorter than this are removed [mm].
        long: L-filter: waves longer than this are removed [mm].
    """

    short: PositiveLength | None = None
    long: PositiveLength | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Preparation:
    """What is done to a map.

    It is done in this order: ``swap_xy``, ``crop``, ``outliers``, ``missing``, ``detrend``,
    ``filter``, ``resample``. ISO 25178-3 takes the S-filter before the form. Here the form goes
    first, as a tilt would disturb the filter along the borders of the map.

    Args:
        swap_xy: Whether x and y of the map are exchanged: rows of a text without sides, and the
            first index of an array, then lie along x. ``lengths``, ``grid`` and ``crop`` are those
            after it.
        crop: The rectangle that is kept, before anything else is done to a map.
        outliers: Whether spikes, and a repeated value that means "no data", are kept, or removed
            and filled.
        missing: What happens to heights that are masked or not a number: ``refuse`` them, or
            ``fill`` them by the smoothest membrane between the others, spikes aside.
        detrend: Form that is removed from a map: its mean, its mean plane, or its mean quadratic
            form.
        filter: Cut-off wavelengths of a Gaussian filter, applied after the form is removed.
        resample: Numbers of heights along x and y of a new grid, which a map is brought to at last.
    """

    swap_xy: bool = False
    crop: Crop = Crop()
    outliers: Literal["keep", "remove"] = "keep"
    missing: Literal["refuse", "fill"] = "refuse"
    detrend: Literal["none", "mean", "plane", "quadratic"] = "none"
    filter: Filter = Filter()
    resample: tuple[Heights, Heights] | None = None


def prepared(surface: Surface, steps: Preparation, advice: str = MAPS) -> Surface:
    """Remove the form of a surface, filter it and put it on another grid.

    Args:
        surface: The surface; its source then says what was done.
        steps: What is done; `completed` does what comes before the form.
        advice: What may be wrong where it is too steep, see `check_slopes`.

    Raises:
        InputError: When a cut-off or the new grid does not fit the surface, or it is too steep.
    """
    done = []
    if steps.detrend != "none":
        surface = surface.detrended(("mean", "plane", "quadratic").index(steps.detrend))
        done.append(f"its {steps.detrend} removed")
    short, long = steps.filter.short, steps.filter.long
    _check_cut_offs(surface, short, long)
    h, spacing, periodic = surface.heights, surface.spacing, surface.periodic
    if short is not None:
        h = smoothed(h, spacing, short, periodic=periodic)
        done.append(f"waves below {1e3 * short:g} µm removed (Gaussian)")
    if long is not None:
        h = h - smoothed(h, spacing, long, periodic=periodic)
        done.append(f"waves beyond {1e3 * long:g} µm removed (Gaussian)")
    if steps.resample is not None:
        mx, my = cell_counts(steps.resample, "the new grid of the surface", smallest=4)
        h = regridded(h, surface.lengths, (mx, my), periodic=periodic)
        done.append(f"resampled from {surface.grid[0]} × {surface.grid[1]} heights")
    if done:
        surface = replace(surface, heights=h, source=", ".join((surface.source, *done)))
    check_slopes(surface, advice)
    return surface


def completed(
    heights: Array, lengths: tuple[float, float], steps: Preparation
) -> tuple[Array, tuple[float, float], list[str], list[str]]:
    """Crop a map, remove its spikes, then fill its gaps.

    Args:
        heights: Heights, shape (nx, ny) [mm]; not a number where missing.
        lengths: Sides (Lx, Ly) [mm].
        steps: What is done; x and y are swapped already, and what comes after the gaps is left to
            `prepared`.

    Returns:
        Heights without gaps, their sides [mm], what was done, and what a user should know of it.

    Raises:
        InputError: When the crop does not fit, or heights are missing that are not to be filled.
    """
    done: list[str] = []
    notes: list[str] = []
    if steps.crop != Crop():
        heights, lengths, sentence = _cropped(heights, lengths, steps.crop)
        done.append(sentence)
    if np.isinf(heights).any():  # refused as a surface
        return heights, lengths, done, notes
    gaps = np.isnan(heights)
    if steps.missing == "refuse":
        _refuse_gaps(gaps)
    spacing = lengths[0] / heights.shape[0], lengths[1] / heights.shape[1]
    outlying = spikes(heights, spacing)
    known = np.where(outlying, np.nan, heights)
    removed, kept = steps.outliers == "remove", known[~np.isnan(known)]
    if outlying.any() and not removed:
        notes += _on_spikes(heights[outlying], kept)
    if gaps.any() or (removed and outlying.any()):
        whole, _ = filled(known, spacing)  # what is no height must not reach into the gaps
        share, count = float(gaps.mean()), int(np.count_nonzero(outlying))
        if share:
            done.append(f"{100 * share:.3g} % of the heights missing and filled by a membrane")
        if removed and count:
            done.append(f"{count} spikes removed and filled")
        if share > 0.3:
            notes.append(
                f"{100 * share:.0f} % of the heights are missing: what fills them is smooth and "
                "has no summits, and forces and contact areas are those of the rest"
            )
        notes += _on_filling(whole[np.isnan(known)], kept)
        heights = whole if removed else np.where(outlying, heights, whole)
    return heights, lengths, done, notes


def _refuse_gaps(gaps: Flags) -> None:
    if gaps.any():
        i, j = np.argwhere(gaps)[0]
        raise InputError(
            f"{np.count_nonzero(gaps)} of {gaps.size} heights are missing, the first at index "
            f"({i}, {j})",
            allowed="finite heights; missing = 'fill' closes gaps by a membrane",
        )


def _on_spikes(spiking: Array, others: Array) -> list[str]:
    """Return a note on spikes above all other heights, or far below them as no groove is [mm]."""
    above, below = float(spiking.max() - others.max()), float(others.min() - spiking.min())
    sizes = []
    if above > 0.0:
        sizes.append(f"the highest stands {1e3 * above:.3g} µm above all others and touches first")
    if below > float(np.ptp(others)):
        sizes.append(f"the lowest lies {1e3 * below:.3g} µm below all others")
    if not sizes:
        return []
    return [
        f"{spiking.size} heights are spikes or mean 'no data', out of line with the others; "
        f"{', '.join(sizes)}; outliers = 'remove' fills their places"
    ]


def _on_filling(inside: Array, others: Array) -> list[str]:
    """Return a note where what fills gaps is higher or lower than nearly all heights [mm]."""
    low, high = np.quantile(others, (0.001, 0.999))  # beyond are heights that are rare but right
    beyond = max(float(inside.max() - high), float(low - inside.min()))
    if beyond <= float(others.std()):
        return []
    return [
        f"what fills gaps reaches {1e3 * beyond:.3g} µm beyond 99.8 % of the "
        "heights, as those on the rims of gaps do: they may be errors of the instrument"
    ]


def _cropped(
    heights: Array, lengths: tuple[float, float], crop: Crop
) -> tuple[Array, tuple[float, float], str]:
    """Return what lies in a rectangle, its sides [mm], and a sentence on it."""
    (nx, ny), (lx, ly) = heights.shape, lengths
    i, i_end = _cells_between(crop.x, lx, nx, "x")
    j, j_end = _cells_between(crop.y, ly, ny, "y")
    x, y, x0, y0 = (i_end - i) * lx / nx, (j_end - j) * ly / ny, i * lx / nx, j * ly / ny
    sentence = (
        f"cropped to {1e3 * x:g} × {1e3 * y:g} µm from x = {1e3 * x0:g} µm, y = {1e3 * y0:g} µm"
    )
    return heights[i:i_end, j:j_end], (x, y), sentence


def _cells_between(
    interval: tuple[float, float] | None, length: float, count: int, axis: str
) -> tuple[int, int]:
    """Return the first cell between two coordinates [mm] of a side, and the first behind them."""
    if interval is None:
        return 0, count
    lo, hi = (round(float(edge) / length * count) for edge in interval)
    if not 0 <= lo < hi <= count:
        raise InputError(
            f"the crop along {axis} does not lie within the surface or keeps no cell",
            key=f"surface.crop.{axis}",
            value=tuple(interval),
            allowed=f"0 ≤ lo < hi ≤ {length} mm",
        )
    return lo, hi


def _check_cut_offs(surface: Surface, short: float | None, long: float | None) -> None:
    """Refuse cut-offs that the grid cannot resolve, that exceed the map or leave no waves."""
    least, most = 2.0 * max(surface.spacing), min(surface.lengths)
    for name, value in (("short", short), ("long", long)):
        if value is not None and not (math.isfinite(value) and least <= value <= most):
            raise InputError(
                f"the {name} cut-off of the filter does not fit the map",
                key=f"surface.filter.{name}",
                value=value,
                allowed=f"two cells to the shorter side, {least:g} to {most:g} mm",
            )
    if short is not None and long is not None and not short < long:
        raise InputError(
            "the cut-offs of the filter leave no waves",
            key="surface.filter.short",
            value=short,
            allowed=f"less than the long cut-off, {long:g} mm",
        )
