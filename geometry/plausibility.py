"""Whether a measured map can be what it says: its units, its tilt."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from geometry.checks import is_level
from geometry.errors import InputError
from geometry.statistics import roughness
from geometry.surface import Surface

STEEPEST = 2.0
"""Rms gradient of the steepest map that is accepted; ground, etched and blasted metal has 0.05 to
1, and a map whose heights are taken in a unit too large has a thousand times as much."""

_FLATTEST = 1e-5
_LONGEST, _SHORTEST = 200.0, 1e-4
"""Rms gradient below which, and sides beyond which [mm], the units of a map are asked for."""


def surface_notes(surface: Surface) -> Iterator[str]:
    """Yield what a user should know of a measured surface before it is pressed.

    Args:
        surface: The surface, prepared.
    """
    share = _plane_share(surface)
    if share > 0.5:
        yield (
            f"the map is tilted: its mean plane makes {100 * share:.0f} % of the variance of its "
            "heights, and a level plane touches one edge first; detrend = 'plane' levels it"
        )
    gradient, (least, most) = roughness(surface).sdq, sorted(surface.lengths)
    if most > _LONGEST or least < _SHORTEST:
        yield (
            f"the map is {surface.lengths[0]:g} × {surface.lengths[1]:g} mm large: are its lengths "
            'in mm? (surface.lengths takes units, such as "100 um")'
        )
    if 0.0 < gradient < _FLATTEST:
        yield (
            f"the rms gradient of the map is {gradient:.2g}, far less than of any machined "
            "surface: are lengths and heights in the units that they were taken in?"
        )


def check_steepness(surface: Surface) -> None:
    """Refuse a map that is steeper than any rough surface.

    Args:
        surface: The surface, prepared.

    Raises:
        InputError: Asks for the unit of the heights.
    """
    gradient = roughness(surface).sdq
    if gradient > STEEPEST:
        raise InputError(
            f"the rms gradient of the map is {gradient:.3g}, no rough surface is so steep: are its "
            "heights in µm? Then say height_unit = 'um'; if it has spikes, outliers = 'remove'",
            allowed=f"rms gradients up to {STEEPEST:g}",
        )


def _plane_share(surface: Surface) -> float:
    """Return the share of the mean plane in the variance of the heights."""
    variance = float(np.var(surface.heights))
    if not variance > 0.0 or is_level(surface.heights):
        return 0.0
    return 1.0 - float(np.var(surface.detrended(1).heights)) / variance
