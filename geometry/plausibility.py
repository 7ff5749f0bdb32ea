"""Whether heights can be what they are said to be: their slopes, units and tilt."""

from __future__ import annotations

import math

import numpy as np

from patchlaw.geometry.statistics import difference_gradient, mean_squares
from patchlaw.geometry.surface import Surface
from patchlaw.support.arrays import Array
from patchlaw.support.checks import is_level
from patchlaw.support.errors import InputError

STEEPEST, STEEPEST_FINITE = 2.0, 0.8
"""Rms gradients of the steepest heights that are accepted, a slope of 63°, and that finite slopes
are taken into account on. Heights in µm that are taken for mm make a surface a thousand times as
steep. At 0.8 the two orders of finite slopes change the force by as much as they err."""

MAPS = ": are they in µm? Then say height_unit = 'um'; if a map has spikes, outliers = 'remove'"
LARGEST_MAP = 1e4
"""Side beyond which no instrument measures: lengths of another unit are read as it [mm]."""

STATED = (
    ": the file states its heights in {}; is that right, and are its lengths? If the map has "
    "spikes, outliers = 'remove'"
)
SPECTRA = ": the spectrum needs a smaller amplitude, or fewer waves"
"""What may be wrong with the heights of maps and of spectra that are too steep."""


def reading_notes(grid: tuple[int, int], lengths: tuple[float, float]) -> list[str]:
    """Return a note where a map has square cells on its sides if x and y are swapped, and only so.

    Args:
        grid: Numbers of heights (nx, ny), as they were read.
        lengths: Sides (Lx, Ly) that were given [mm].
    """
    (nx, ny), (x, y) = grid, lengths
    dx, dy, dx_swapped, dy_swapped = x / nx, y / ny, x / ny, y / nx
    if abs(dx_swapped / dy_swapped - 1.0) > 0.02 or abs(dx / dy - 1.0) < 0.1:
        return []
    return [
        f"{nx} × {ny} heights make cells of {1e3 * dx:.3g} × {1e3 * dy:.3g} µm on these sides; "
        f"with x and y swapped, {ny} × {nx} heights make square ones of {1e3 * dx_swapped:.3g} × "
        f"{1e3 * dy_swapped:.3g} µm: is a row of the map one along x? Then swap_xy = true"
    ]


def rms_gradient(surface: Surface) -> float:
    """Return the root mean square gradient of the spline through heights, which is kept with them.

    Args:
        surface: The surface.
    """
    kept = vars(surface)  # not a field: another surface has another one
    if "rms_gradient" not in kept:
        kept["rms_gradient"] = math.sqrt(sum(mean_squares(surface)[1:3]))
    return float(kept["rms_gradient"])


def check_slopes(surface: Surface, advice: str = MAPS) -> None:
    """Refuse heights that are steeper than any rough surface, wherever they come from.

    Args:
        surface: The surface, prepared; of two rough sides each, and the sum of their heights.
        advice: What may be wrong with them, at the end of a sentence.

    Raises:
        InputError: Gives the advice.
    """
    gradient = rms_gradient(surface)
    if gradient > STEEPEST * (1.0 + 1e-9):
        raise InputError(
            f"the rms gradient of the heights is {gradient:.3g}, no rough surface is so steep"
            f"{advice}",
            allowed=f"rms gradients up to {STEEPEST:g}",
        )


def check_finite_slopes(surface: Surface) -> None:
    """Refuse slopes that two orders do not describe.

    Args:
        surface: The surface of one body.

    Raises:
        InputError: Says what else can be done, and what error that has.
    """
    gradient = rms_gradient(surface)
    if gradient > STEEPEST_FINITE * (1.0 + 1e-9):
        raise InputError(
            "finite slopes are known to second order, which fails at the rms gradient of the "
            f"surface, {gradient:.3g}; without them (micro.finite_slopes = false) forces of such "
            "surfaces are too large by 10 % and more, by an error that is not measured; "
            "coupling.kind = 'reference' meshes the slopes as they are",
            allowed=f"rms gradients up to {STEEPEST_FINITE:g}",
        )


def surface_notes(surface: Surface) -> list[str]:
    """Return what a user should know of a measured surface before it is pressed.

    Args:
        surface: The surface, prepared.
    """
    gradient, (least, most), notes = rms_gradient(surface), sorted(surface.lengths), []
    share = _plane_share(surface)
    steps = [] if share <= 0.5 and not surface.periodic else _steps_at_borders(surface.heights)
    if surface.periodic and max(steps) > 1.0:
        notes.append(
            "the map is continued periodically and its opposite borders do not match: it steps "
            f"there up to {max(steps):.2g} times as much as between neighbours elsewhere"
        )
    if share > 0.5 and max(steps) > 1.0:
        notes.append(
            f"the map is tilted: its mean plane makes {100 * share:.0f} % of the variance of its "
            "heights, and a level plane touches one edge first; detrend = 'plane' levels it"
        )
    if most > 200.0 or least < 1e-4:
        notes.append(
            f"the map is {surface.lengths[0]:g} × {surface.lengths[1]:g} mm large: are its lengths "
            "in mm? Quantities take units, as in '100 um'"
        )
    differences = difference_gradient(surface)
    if abs(differences - gradient) > 0.05 * gradient:
        notes.append(
            f"waves at the grid are not resolved: the rms gradient is {gradient:.3g} on the spline "
            f"that is pressed, and {differences:.3g} in first differences, which Sdq of ISO "
            "25178-2 usually stands for; contact areas and stiffness depend on the grid, unless "
            "surface.filter removes such waves"
        )
    # coordinates in µm that are taken for mm turn 0.01 to 0.3 into 1e-5 to 3e-4
    if 0.0 < gradient < 3e-4:
        notes.append(
            f"the rms gradient of the map is {gradient:.2g}, far less than of machined "
            "surfaces: are lengths and heights in the units that they were taken in? For heights "
            "in m say height_unit = 'm'; x and y of an .xyz are taken in mm, unless xy_unit or "
            "surface.lengths says otherwise"
        )
    return notes


def check_periodic_form(before: Array, after: Array, kind: str) -> None:
    """Refuse to remove a form that opposite borders of a periodic map match with.

    Args:
        before: Heights, shape (nx, ny) [mm]; not a number where missing.
        after: Heights without the form [mm].
        kind: The kind of ``detrend``.

    Raises:
        InputError: Says what such a map needs.
    """
    steps = zip("xy", _steps_at_borders(after), _steps_at_borders(before), strict=True)
    for axis, step, was in steps:
        if step > 1.0 >= was:
            raise InputError(
                f"the map continues periodically along {axis}, where its borders match; without "
                f"its mean {kind} they do not",
                key="surface.detrend",
                value=kind,
                allowed="'none' or 'mean' for what continues periodically",
            )


def _steps_at_borders(heights: Array) -> list[float]:
    """Return how far opposite borders are from matching along x and along y.

    It is the rms step from the last row to the first, by 1.5 times the largest between rows
    within: 1 or less where the map may continue, by chance beyond what it has within. Missing
    heights do not count.
    """
    ratios = []
    for rows in (heights, heights.T):
        squares = np.diff(rows, axis=0, append=rows[:1]) ** 2
        known = ~np.isnan(squares)
        count = known.sum(axis=1)
        sums = np.where(known, squares, 0.0).sum(axis=1) / np.maximum(count, 1)
        within = 2.25 * float(sums[:-1].max())
        ratios.append(math.sqrt(sums[-1] / within) if within else float("inf" if sums[-1] else 0))
    return ratios


def _plane_share(surface: Surface) -> float:
    """Return the share of the mean plane in the variance of the heights."""
    if is_level(surface.heights):
        return 0.0
    heights = surface.heights - surface.mean_height
    share = 0.0
    for centres, means in ((surface.x, heights.mean(axis=1)), (surface.y, heights.mean(axis=0))):
        u = centres - centres.mean()  # on a grid the slopes along x and y are found one by one
        share += float(np.mean(means * u) ** 2 / np.mean(u * u))
    return share / float(np.mean(heights * heights))
