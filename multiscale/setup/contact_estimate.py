"""A coarse half-space for estimates of loads, and how near a plane comes."""

from __future__ import annotations

import numpy as np

from geometry.surface import Surface
from micro import HalfSpaceModel, resampled

_ESTIMATE_CELLS = 96


def rough_half_space(surface: Surface, modulus: float) -> HalfSpaceModel:
    """Return a half-space model of few cells, for estimates of loads.

    Args:
        surface: The surface.
        modulus: E* [MPa].
    """
    cells = min(surface.grid[0], _ESTIMATE_CELLS), min(surface.grid[1], _ESTIMATE_CELLS)
    return HalfSpaceModel(
        surface=resampled(surface, cells), contact_modulus=modulus, highest=surface.highest
    )


def largest_local_approach(plane: tuple[float, tuple[float, float]], surface: Surface) -> float:
    """Return how near a tilted plane comes anywhere: its approach at the nearest corner [mm]."""
    approach, tilt = plane
    return approach + 0.5 * float(np.abs(np.multiply(surface.lengths, tilt)).sum())
