"""Expected errors of the force of every micro model, from measures of the contacts.

A bound is a sum of terms with non-negative coefficients. For asperities and islands

    c₀ + c₁ a √η + c₂ e² + c₃ a/λ + c₄ e² a/λ + c₅ β

with contact radius a, density η of the summits above the plane, eccentricity e, shortest
wavelength λ and the share β of the bearing area that the border cuts; for a half-space grid with
n cells per contact radius, m per shortest wavelength and N regions

    g₀ / (n² √N) + g₁ / n² + g₂ / m:

cells miss the summits by what averages out over many contacts, and round contacts off by what does
not. The coefficients are quantile regressions (`tests/benchmarks/auto_calibration.py`) of the
errors at two loads of 160 surfaces: Hurst exponents 0.3 to 1, bands from 1 to 4 up to 6 to 64 waves
a side, a part of them anisotropic, 48² to 512² heights, rms gradients 0.05 to 0.2, contact on
0.02 to 30 % of the area. 97.5 % of the errors keep their bound.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from micro.choice.measures import ContactMeasures

CONTACT_TERMS = ("floor", "crowding", "eccentricity", "wave", "eccentric_wave", "border")
GRID_TERMS = ("radius_few", "radius", "wave")

CONTACT_COEFFICIENTS = {
    "elliptic": (0.0124, 0.0, 0.0, 0.109, 1.20, 1.15),
    "circular": (0.0120, 0.0, 0.0, 0.0965, 1.37, 1.15),
    "elliptic-independent": (0.0, 5.23, 0.0, 0.0, 1.89, 0.791),
    "circular-independent": (0.0, 5.22, 0.0, 0.0, 1.34, 0.812),
    "scaled": (0.0526, 0.0395, 0.0, 0.0024, 0.0, 0.0018),
    "islands": (0.0037, 0.0, 0.0417, 0.201, 0.0, 0.0302),
}
"""Coefficients of the terms of `contact_terms`."""

GRID_COEFFICIENTS = (0.0596, 0.0332, 0.158)
"""Coefficients of the terms of `grid_terms`."""


def contact_terms(at: ContactMeasures) -> NDArray[np.float64]:
    """Return 1, a √η, e², a/λ, e² a/λ and β.

    Args:
        at: The contacts at a load.
    """
    square, waves = at.eccentricity**2, at.cells_per_radius / at.cells_per_wave
    return np.array([1.0, at.crowding, square, waves, square * waves, at.border_share])


def grid_terms(at: ContactMeasures, factor: float) -> NDArray[np.float64]:
    """Return 1/(n² √N), 1/n² and 1/m.

    Args:
        at: The contacts at a load.
        factor: Cells of the grid along a side, relative to the surface's own.
    """
    square = (factor * at.cells_per_radius) ** -2.0
    few = square / np.sqrt(max(at.regions, 1))
    return np.array([few, square, 1.0 / (factor * at.cells_per_wave)])


def contact_error(kind: str, at: ContactMeasures) -> float:
    """Return the bound of the relative error of asperities or islands.

    Args:
        kind: A key of `CONTACT_COEFFICIENTS`.
        at: The contacts at a load.
    """
    return float(contact_terms(at) @ np.array(CONTACT_COEFFICIENTS[kind]))


def grid_error(at: ContactMeasures, factor: float) -> float:
    """Return the bound of the relative error of a half-space grid.

    Args:
        at: The contacts at a load.
        factor: Cells of the grid along a side, relative to the surface's own.
    """
    return float(grid_terms(at, factor) @ np.array(GRID_COEFFICIENTS))
