"""What is done to measured maps before they are a surface that is pressed.

A map is prepared by itself; then two that face each other are turned over, laid on each other and
added, and one may be mirrored.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from patchlaw.geometry.filters import filled, form, levelled, regridded, smoothed, spikes
from patchlaw.geometry.materials import Material, MaterialPair
from patchlaw.geometry.statistics import MAPS, check_periodic_form, check_slopes, surface_notes
from patchlaw.geometry.surface import Surface
from patchlaw.support import Array, Flags, Heights, InputError, Length, PositiveLength, check_fields
from patchlaw.support.checks import LARGEST, check_scale, is_level

Interval = tuple[Length, Length]

_FORMS = ("none", "mean", "plane", "quadratic")
"""Kinds of ``detrend``, by the degree of the form less one."""

_SMOOTH = (
    "what fills them is smooth and has no summits, and forces and contact areas are those of the "
    "rest"
)
"""What is said of maps that lack more than three heights of ten."""

_ROUNDING = 1e-9
"""Relative difference of two sides that is rounding."""


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

    It is done in this order: ``swap_xy``, ``crop``, ``outliers``, ``detrend``, ``filter``,
    ``missing``, ``resample``. Form and means of filters are those of heights that were measured;
    what fills gaps comes after them. ISO 25178-3 takes the S-filter before the form. Here the form
    goes first, as a tilt would disturb the filter along the borders of the map.

    Args:
        swap_xy: Whether x and y of the map are exchanged: rows of a text without sides, and the
            first index of an array, then lie along x. ``lengths``, ``grid`` and ``crop`` are those
            after it.
        crop: The rectangle that is kept, before anything else is done to a map.
        outliers: Whether spikes, and a repeated value that means "no data", are kept, or removed
            and filled.
        missing: What happens to heights that are masked, not a number or none that an instrument
            measures: ``refuse`` them, or ``fill`` them by the smoothest membrane between the
            others, spikes aside, once form and filter, which weigh them as nothing, are done.
        detrend: Form that is removed from a map: its mean, its mean plane, or its mean quadratic
            form. Of what continues periodically only the mean.
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

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(slots=True)
class WorkingMap:
    """Heights on their way to a surface, and what was done to them.

    Args:
        heights: Heights, shape (nx, ny) [mm]; not a number where they are missing.
        lengths: Sides (Lx, Ly) [mm].
        periodic: Whether the heights continue periodically.
        said: Where they come from, and what was done so far.
    """

    heights: Array
    lengths: tuple[float, float]
    periodic: bool
    said: list[str]

    @property
    def spacing(self) -> tuple[float, float]:
        """Distances of the heights along x and y [mm]."""
        return self.lengths[0] / self.heights.shape[0], self.lengths[1] / self.heights.shape[1]

    def crop(self, crop: Crop) -> None:
        """Keep what lies in a rectangle."""
        (nx, ny), (lx, ly) = self.heights.shape, self.lengths
        i, i_end = _cells_between(crop.x, lx, nx, "x")
        j, j_end = _cells_between(crop.y, ly, ny, "y")
        x, y, x0, y0 = (i_end - i) * lx / nx, (j_end - j) * ly / ny, i * lx / nx, j * ly / ny
        self.heights, self.lengths = self.heights[i:i_end, j:j_end], (x, y)
        self.said.append(
            f"cropped to {1e3 * x:g} × {1e3 * y:g} µm from x = {1e3 * x0:g} µm, y = {1e3 * y0:g} µm"
        )

    def filter(self, steps: Preparation) -> None:
        """Remove the form and the waves that are not wanted."""
        if steps.detrend != "none":
            before, degree = self.heights, _FORMS.index(steps.detrend) - 1
            self.heights = levelled(before, degree)
            if self.periodic:
                check_periodic_form(before, self.heights, steps.detrend)
            self.said.append(f"its {steps.detrend} removed")
        short, long = steps.filter.short, steps.filter.long
        _check_cut_offs(self.spacing, self.lengths, short, long)
        if short is not None:
            self.heights = smoothed(self.heights, self.spacing, short, periodic=self.periodic)
            self.said.append(f"waves below {1e3 * short:g} µm removed (Gaussian)")
        if long is not None:
            waves = smoothed(self.heights, self.spacing, long, periodic=self.periodic)
            self.heights = self.heights - waves
            self.said.append(f"waves beyond {1e3 * long:g} µm removed (Gaussian)")

    def resample(self, steps: Preparation) -> None:
        """Bring the heights to the grid that is wanted."""
        if steps.resample is not None:
            nx, ny = self.heights.shape
            self.said.append(f"resampled from {nx} × {ny} heights")
            self.heights = regridded(
                self.heights, self.lengths, steps.resample, periodic=self.periodic
            )


def prepared(surface: Surface, steps: Preparation, advice: str = MAPS) -> Surface:
    """Remove the form of a surface, filter it and put it on another grid.

    Args:
        surface: The surface; its source then says what was done.
        steps: What is done; `prepared_map` does what comes before the form.
        advice: What may be wrong where it is too steep, see `check_slopes`.

    Raises:
        InputError: When a cut-off or the new grid does not fit the surface, or it is too steep.
    """
    periodic = surface.periodic and steps.detrend in ("none", "mean")
    work = WorkingMap(surface.heights, surface.lengths, periodic, [surface.source])
    work.filter(steps)
    work.resample(steps)
    if len(work.said) > 1:
        source = ", ".join(work.said)
        surface = replace(surface, heights=work.heights, periodic=periodic, source=source)
    check_slopes(surface, advice)
    return surface


def prepared_map(
    work: WorkingMap, steps: Preparation, notes: Sequence[str] = (), advice: str = MAPS
) -> Surface:
    """Prepare a measured map: all steps but the first, as x and y are swapped already.

    Args:
        work: The map; its heights are missing where they are not a number, or none that an
            instrument measures. It is changed.
        steps: What is done.
        notes: What a user should know of them already.
        advice: What may be wrong where they are too steep, see `check_slopes`.

    Raises:
        InputError: When they are no surface, a step does not fit, heights are missing that are not
            to be filled, or it is too steep.
    """
    said, found, heights = work.said, list(notes), work.heights
    if heights.ndim != 2 or not heights.size:  # refused as a surface
        return Surface(heights=heights, lengths=work.lengths)
    work.heights = np.where(np.abs(heights) <= LARGEST, heights, np.nan)
    if steps.crop != Crop():
        work.crop(steps.crop)
    heights, spacing = work.heights, work.spacing
    gaps = np.isnan(heights)
    if gaps.any() and (steps.missing == "refuse" or gaps.all()):
        raise _missing(gaps)
    outlying = spikes(heights, spacing, max(_FORMS.index(steps.detrend) - 1, 1))
    if outlying.any() and steps.outliers == "remove":
        count = int(np.count_nonzero(outlying))
        said.append(f"{count} spike{'s' * (count > 1)} removed and filled")
        heights = np.where(outlying, np.nan, heights)
    elif outlying.any():
        found += _on_spikes(heights, outlying, steps)
    check_scale(heights)
    if is_level(heights) and np.nanmin(heights) < np.nanmax(heights):
        heights = np.where(np.isnan(heights), np.nan, np.nanmean(heights))
        said.append("level but for rounding")
    work.heights = heights
    work.filter(steps)
    work.heights, notes_on_filling = _without_gaps(work.heights, outlying, spacing)
    found += notes_on_filling
    if share := float(gaps.mean()):
        said.append(f"{100 * share:.3g} % of the heights missing and filled by a membrane")
    found += [f"{100 * share:.0f} % of the heights are missing: {_SMOOTH}"] * (share > 0.3)
    work.resample(steps)
    source = ", ".join(said)
    surface = Surface(
        heights=work.heights, lengths=work.lengths, periodic=work.periodic, source=source
    )
    check_slopes(surface, advice)
    vars(surface)["notes"] = (*found, *surface_notes(surface))  # what is known of it is kept
    return surface


def _without_gaps(
    heights: Array, outlying: Flags, spacing: tuple[float, float]
) -> tuple[Array, list[str]]:
    """Return heights with their gaps filled, and notes on what fills them.

    Args:
        heights: Heights, not a number in gaps [mm].
        outlying: What is no height, and must not reach into the gaps.
        spacing: Distances of the heights along x and y [mm].
    """
    if not np.isnan(heights).any():
        return heights, []
    known = np.where(outlying, np.nan, heights)
    whole, _ = filled(known, spacing)
    notes = _on_filling(whole[np.isnan(known)], known[~np.isnan(known)])
    return np.where(np.isnan(heights), whole, heights), notes


def _missing(gaps: Flags) -> InputError:
    (i, j), count = np.argwhere(gaps)[0], np.count_nonzero(gaps)
    return InputError(
        f"{count} of {gaps.size} heights are missing, the first at index ({i}, {j})"
        if count < gaps.size
        else "all heights are missing",
        allowed=f"finite heights within ±{LARGEST:g} mm; missing = 'fill' closes gaps by a "
        "membrane",
    )


def _on_spikes(heights: Array, outlying: Flags, steps: Preparation) -> list[str]:
    """Return a note on spikes above all other heights, or far below them as no groove is [mm]."""
    known, degree = np.where(outlying, np.nan, heights), _FORMS.index(steps.detrend) - 1
    rest = heights - form(known, degree) if degree >= 0 else heights  # as it is pressed
    spiking, others = rest[outlying], rest[~np.isnan(known)]
    above, below = float(spiking.max() - others.max()), float(others.min() - spiking.min())
    sizes = []
    if above > 0.0:
        sizes.append(f"the highest stands {1e3 * above:.3g} µm above all others and touches first")
    if below > float(np.ptp(others)):
        sizes.append(f"the lowest lies {1e3 * below:.3g} µm below all others")
    if not sizes:
        return []
    several = spiking.size > 1
    which = (
        f"{spiking.size} heights are spikes or mean" if several else "1 height is a spike or means"
    )
    return [
        f"{which} 'no data', out of line with the others; "
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


def _check_cut_offs(
    spacing: tuple[float, float],
    lengths: tuple[float, float],
    short: float | None,
    long: float | None,
) -> None:
    """Refuse cut-offs that the grid cannot resolve, that exceed the map or leave no waves."""
    least, most = 2.0 * max(spacing), min(lengths)
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


def turned_over(surface: Surface) -> Surface:
    """Return a surface as it lies on another one: turned about the y axis.

    Args:
        surface: Heights as measured, facing up.

    Returns:
        Heights at Lx − x, still counted out of the body.
    """
    return replace(surface, heights=surface.heights[::-1])


def laid_on(
    first: Surface, second: Surface, *, shift: tuple[float, float] = (0.0, 0.0), angle: float = 0.0
) -> Surface:
    """Return a surface turned about its middle, then moved, on the cells of another one.

    A quarter of a turn, and a shift of a periodic surface by whole cells, move the heights as they
    are. Else they are those of the interpolant.

    Args:
        first: The surface below, middle on middle without a shift.
        second: The surface that is moved, as it lies on the first, see `turned_over`.
        shift: Way along x and y [mm].
        angle: Turn from x to y, as seen from above [degrees].

    Returns:
        Heights on the grid and sides of ``first``; periodic where the turned surface has its sides
        and is.

    Raises:
        InputError: When a surface that is not periodic does not cover the other one.
    """
    turns = round(angle / 90.0)
    left = np.radians(angle - 90.0 * turns)
    if turns % 4:
        lengths = second.lengths if turns % 2 == 0 else second.lengths[::-1]
        second = replace(second, heights=np.rot90(second.heights, turns), lengths=lengths)
    fits = left == 0.0 and np.allclose(second.lengths, first.lengths, rtol=_ROUNDING, atol=0.0)
    if fits and second.grid == first.grid:
        cells = np.divide(shift, first.spacing)
        whole = np.rint(cells)
        if not whole.any() and not cells.any():
            return second
        if second.periodic and np.allclose(cells, whole, rtol=0.0, atol=_ROUNDING):
            return second.shifted(int(whole[0]), int(whole[1]))
    x = first.x[:, None] - 0.5 * first.lengths[0] - shift[0]
    y = first.y - 0.5 * first.lengths[1] - shift[1]
    along, across = np.cos(left) * x + np.sin(left) * y, np.cos(left) * y - np.sin(left) * x
    heights = second.height_at(along + 0.5 * second.lengths[0], across + 0.5 * second.lengths[1])
    periodic = second.periodic and fits
    return replace(second, heights=heights, lengths=first.lengths, periodic=periodic)


def facing(first: Surface, second: Surface) -> Surface:
    """Return the sum of the heights of two surfaces, which is what closes as they approach.

    Args:
        first: Heights of the lower side.
        second: Heights of the upper side as it lies on the first, see `turned_over`.

    Returns:
        The surface of h(x, y) = h1(x, y) + h2(x, y), periodic where both are.

    Raises:
        InputError: When they have not the same grid and sides, or are too steep together.
    """
    if first.grid != second.grid:
        raise InputError(
            "has not the heights of the surface that it faces",
            value=list(second.grid),
            allowed=f"{list(first.grid)}, by grid or resample",
        )
    if not np.allclose(first.lengths, second.lengths, rtol=_ROUNDING, atol=0.0):
        raise InputError(
            "has not the sides of the surface that it faces",
            value=list(second.lengths),
            allowed=f"{list(first.lengths)} mm, by lengths or crop",
        )
    both = Surface(
        heights=first.heights + second.heights,
        lengths=first.lengths,
        periodic=first.periodic and second.periodic,
        source=f"{first.source}; facing {second.source}",
        notes=(*first.notes, *(f"counter-surface: {note}" for note in second.notes)),
    )
    check_slopes(both, ": these are both sides together")
    return both


def rough_sides(
    surface: Surface, above: Surface | None, materials: MaterialPair
) -> list[tuple[Surface, Material]]:
    """Return the rough sides of elastic bodies, whose slopes count, with their materials.

    Args:
        surface: The heights of both sides together, on any grid.
        above: What of them is the upper side's; None where that is smooth.
        materials: The materials of the lower and of the upper body.
    """
    if above is None:
        return [(surface, materials.first)]
    above = above.on_grid(surface.grid)
    below = replace(surface, heights=surface.heights - above.heights)
    sides = [(below, materials.first)]
    return sides if materials.second is None else [*sides, (above, materials.second)]


def mirrored(surface: Surface) -> Surface:
    """Return a surface with its mirror images beside it, twice as long and wide, periodic.

    A map that is continued as it is has a step all around it, whose ridge carries load. Mirrored
    heights continue without a step; all they have is a crease where the map slopes at its border.

    Args:
        surface: The surface.
    """
    lx, ly = surface.lengths
    row = np.concatenate((surface.heights, surface.heights[::-1]))
    heights = np.concatenate((row, row[:, ::-1]), axis=1)
    source = f"{surface.source}, mirrored" if surface.source else "mirrored"
    return replace(surface, heights=heights, lengths=(2 * lx, 2 * ly), periodic=True, source=source)
