"""Estimates the contacts of a surface at its largest load, from heights and a coarse half-space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geometry.patches import PatchGrid, patch_means
from geometry.surface import Surface
from micro import HalfSpaceModel, resampled

_ESTIMATE_CELLS = 96
_NEAR = 1 / 8  # of a side


@dataclass(frozen=True, slots=True, kw_only=True)
class Contacts:
    """What the couplings' errors depend on.

    Attributes:
        yielding: κ, mean displacement of the half-space below the loads over the approach.
        border: β, share of the overlap within an eighth of the side from the border.
    """

    yielding: float
    border: float


def contacts(
    surface: Surface, modulus: float, plane: tuple[float, tuple[float, float]]
) -> Contacts:
    """Measure the contacts of a surface at the largest load; a half-space of few cells is solved.

    Args:
        surface: The surface.
        modulus: E* [MPa].
        plane: Largest approach at the middle [mm] and slopes.
    """
    approach, tilt = plane
    x, y = surface.x - 0.5 * surface.lengths[0], surface.y - 0.5 * surface.lengths[1]
    lean = tilt[0] * x[:, None] + tilt[1] * y
    overlap = np.maximum(approach + lean - (surface.highest - surface.heights), 0.0)
    near_x, near_y = (
        np.abs(from_middle) > (0.5 - _NEAR) * size
        for from_middle, size in zip((x, y), surface.lengths, strict=True)
    )
    total = float(overlap.sum())
    if not total > 0.0:
        return Contacts(yielding=0.0, border=0.0)
    rough = rough_half_space(surface, modulus)
    whole = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    means = patch_means(surface, whole)
    found = rough.respond([approach], patches=whole, mean_heights=means, tilt=tilt)
    sunk = float(found.force[0]) / (modulus * np.sqrt(whole.area))
    return Contacts(
        yielding=sunk / float(overlap.max()),
        border=float(overlap[near_x[:, None] | near_y].sum()) / total,
    )


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


def nearest(plane: tuple[float, tuple[float, float]], surface: Surface) -> float:
    """Return how near a tilted plane comes anywhere: its approach at the nearest corner [mm]."""
    approach, tilt = plane
    return approach + 0.5 * float(np.abs(np.multiply(surface.lengths, tilt)).sum())
