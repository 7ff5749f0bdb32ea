"""Whether heights can be what they are said to be: their slopes, units and tilt."""

from __future__ import annotations

import math

import numpy as np

from geometry.statistics import derivatives
from geometry.surface import Surface
from support.checks import is_level
from support.errors import InputError

STEEPEST, STEEPEST_FINITE = 2.0, 0.8
"""Rms gradients of the steepest heights that are accepted, a slope of 63°, and that finite slopes
are taken into account on. Heights in µm that are taken for mm make a surface a thousand times as
steep. At 0.8 the two orders of finite slopes change the force by as much as they err."""

MAPS = ": are they in µm? Then say height_unit = 'um'; if a map has spikes, outliers = 'remove'"
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
    """Return the root mean square gradient of a surface, which is kept with it.

    Args:
        surface: The surface.
    """
    kept = vars(surface)  # not a field: another surface has another one
    if "rms_gradient" not in kept:
        kept["rms_gradient"] = math.sqrt(sum(derivatives(surface)[:2]))
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
    if share > 0.5:
        notes.append(
            f"the map is tilted: its mean plane makes {100 * share:.0f} % of the variance of its "
            "heights, and a level plane touches one edge first; detrend = 'plane' levels it"
        )
    if most > 200.0 or least < 1e-4:
        notes.append(
            f"the map is {surface.lengths[0]:g} × {surface.lengths[1]:g} mm large: are its lengths "
            "in mm? Quantities take units, as in '100 um'"
        )
    # coordinates in µm that are taken for mm turn 0.01 to 0.3 into 1e-5 to 3e-4
    if 0.0 < gradient < 3e-4:
        notes.append(
            f"the rms gradient of the map is {gradient:.2g}, far less than of machined "
            "surfaces: are lengths and heights in the units that they were taken in? x and y of an "
            ".xyz are taken in mm, unless surface.lengths says otherwise"
        )
    return notes


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
