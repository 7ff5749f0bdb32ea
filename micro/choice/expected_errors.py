"""Expected errors of the force of every micro model, from measures of the contacts.

The measures come from the undeformed heights, without any solution. The bearing area at the plane
stands for the contacts: on a paraboloid Hertz's contact is half of the region above the plane.

A bound of the error is a sum of terms with non-negative coefficients. For asperities and islands

    c₀ + c₁ a √η + c₂ e² + c₃ a/λ + c₄ e² a/λ + c₅ β

with contact radius a, density η of the summits above the plane, eccentricity e, shortest
wavelength λ and the share β of the bearing area that the border cuts. For a half-space grid with
n cells per contact radius, m per shortest wavelength and N regions

    g₀ / (n² √N) + g₁ / n² + g₂ / m.

Cells miss the summits, which averages out over many contacts, and their steps round contacts off,
which does not. The coefficients are quantile regressions (`tests/benchmarks/auto_calibration.py`)
of the errors at two loads of 160 surfaces: Hurst exponents 0.3 to 1, bands from 1 to 4 up to 6 to
64 waves a side, a part of them anisotropic, 48² to 512² heights, rms gradients 0.05 to 0.2, contact
on 0.02 to 30 % of the area. 97.5 % of the errors keep their bound.

Theory: demos/theory.md, section 13.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from geometry import Surface, roughness
from geometry.summits import grid_maxima

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
_LEAST_REGION = 0.25
"""Cells above the plane that are assumed where only the interpolant rises above it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactMeasures:
    """Measures of the contacts of a surface under a plane.

    Attributes:
        regions: Connected regions above the undeformed plane.
        contact_fraction: Half of the bearing area fraction: an estimate of the contact area.
        cells_per_radius: Contact radius, of the mean contact, over the longer side of a cell.
        cells_per_wave: Shortest wavelength over the longer side of a cell: that of a single wave
            with the ratio of rms gradient and rms curvature of the surface.
        crowding: Contact radius times the root of the density of summits above the plane.
        eccentricity: Root of the mean e² of the regions' second moments, weighted with area.
        border_share: Share of the bearing area in regions that the border cuts.
    """

    regions: int
    contact_fraction: float
    cells_per_radius: float
    cells_per_wave: float
    crowding: float
    eccentricity: float
    border_share: float


def contact_measures(surface: Surface, approach: float) -> ContactMeasures:
    """Measure the contacts of a surface under a level plane.

    Args:
        surface: The surface.
        approach: Approach of the undeformed plane [mm].
    """
    level = surface.highest - approach
    names, regions = label(surface.heights > level, np.ones((3, 3)))
    area = np.bincount(names.ravel(), minlength=2)[1:]
    cells = max(int(area.sum()), _LEAST_REGION)
    dx, dy = surface.spacing
    radius = np.sqrt(0.5 * cells * dx * dy / (np.pi * max(regions, 1)))
    summits = grid_maxima(surface.heights, periodic=False)
    above = int(np.count_nonzero(summits.height > level))
    return ContactMeasures(
        regions=regions,
        contact_fraction=0.5 * cells / surface.heights.size,
        cells_per_radius=float(radius / max(dx, dy)),
        cells_per_wave=_cells_per_wave(surface),
        crowding=float(radius * np.sqrt(max(above, 1) / surface.area)),
        eccentricity=float(np.sqrt(_mean_square_eccentricity(names, area, dx / dy))),
        border_share=_border_share(names, area),
    )


def _cells_per_wave(surface: Surface) -> float:
    rough = roughness(surface)
    if not rough.m4 > 0.0:
        return float(max(surface.grid))
    shortest = 2.0 * min(surface.spacing)  # differences over two cells see no slope there
    length = max(2.0 * np.pi * float(np.sqrt(rough.m2 / rough.m4)), shortest)
    return length / max(surface.spacing)


def _mean_square_eccentricity(
    names: NDArray[np.intp], area: NDArray[np.intp], aspect: float
) -> float:
    """Return the mean of 1 − b²/a² of the regions, of cells dx/dy, weighted with area."""
    i, j = np.nonzero(names)
    of = names[i, j] - 1

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(of, weights=values, minlength=len(area)) / area)

    if not of.size:
        return 0.0
    ii, jj = i - mean(i.astype(float))[of], j - mean(j.astype(float))[of]
    # A cell is not a point: its own moment keeps small regions round.
    xx, yy, xy = mean(ii * ii) + 1 / 12, mean(jj * jj) + 1 / 12, mean(ii * jj)
    xx, xy = aspect**2 * xx, aspect * xy
    half, middle = np.hypot(0.5 * (xx - yy), xy), 0.5 * (xx + yy)
    return float(np.average(2.0 * half / (middle + half), weights=area))


def _border_share(names: NDArray[np.intp], area: NDArray[np.intp]) -> float:
    edges = (names[0], names[-1], names[:, 0], names[:, -1])
    cut = np.unique(np.concatenate(edges))
    return float(area[cut[cut > 0] - 1].sum() / max(area.sum(), 1))


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
