"""Whether a measured map can be what it says: its units, its tilt."""

from __future__ import annotations

import numpy as np

from geometry.checks import is_level
from geometry.errors import InputError
from geometry.statistics import roughness
from geometry.surface import Surface

STEEPEST = 2.0
"""Rms gradient of the steepest map that is accepted, a slope of 63°. Heights in µm that are taken
for mm make a map a thousand times as steep."""

_SQUARE, _OBLONG = 0.02, 0.1
"""Differences of the sides of a cell, over one of them, that are none and that are seen."""
_MUCH_TILT, _FLATTEST = 0.5, 3e-4
_LONGEST, _SHORTEST = 200.0, 1e-4
"""Share of the mean plane in the variance, rms gradient and sides [mm] that deserve a note.
Coordinates in µm that are taken for mm make a map a thousand times as flat: 0.01 to 0.3 become 1e-5
to 3e-4."""


def reading_notes(grid: tuple[int, int], lengths: tuple[float, float]) -> list[str]:
    """Return a note where a map has square cells on its sides if x and y are swapped, and only so.

    Args:
        grid: Numbers of heights (nx, ny), as they were read.
        lengths: Sides (Lx, Ly) that were given [mm].
    """
    (nx, ny), (x, y) = grid, lengths
    dx, dy, dx_swapped, dy_swapped = x / nx, y / ny, x / ny, y / nx
    if abs(dx_swapped / dy_swapped - 1.0) > _SQUARE or abs(dx / dy - 1.0) < _OBLONG:
        return []
    return [
        f"{nx} × {ny} heights make cells of {1e3 * dx:.3g} × {1e3 * dy:.3g} µm on these sides; "
        f"with x and y swapped, {ny} × {nx} heights make square ones of {1e3 * dx_swapped:.3g} × "
        f"{1e3 * dy_swapped:.3g} µm: is a row of the map one along x? Then swap_xy = true"
    ]


def surface_notes(surface: Surface) -> list[str]:
    """Return what a user should know of a measured surface before it is pressed.

    Args:
        surface: The surface, prepared.

    Raises:
        InputError: When it is steeper than any rough surface; asks for the unit of the heights.
    """
    gradient, (least, most), notes = roughness(surface).sdq, sorted(surface.lengths), []
    if gradient > STEEPEST:
        raise InputError(
            f"the rms gradient of the map is {gradient:.3g}, no rough surface is so steep: are its "
            "heights in µm? Then say height_unit = 'um'; if it has spikes, outliers = 'remove'",
            allowed=f"rms gradients up to {STEEPEST:g}",
        )
    share = _plane_share(surface)
    if share > _MUCH_TILT:
        notes.append(
            f"the map is tilted: its mean plane makes {100 * share:.0f} % of the variance of its "
            "heights, and a level plane touches one edge first; detrend = 'plane' levels it"
        )
    if most > _LONGEST or least < _SHORTEST:
        notes.append(
            f"the map is {surface.lengths[0]:g} × {surface.lengths[1]:g} mm large: are its lengths "
            "in mm? Quantities take units, as in '100 um'"
        )
    if 0.0 < gradient < _FLATTEST:
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
