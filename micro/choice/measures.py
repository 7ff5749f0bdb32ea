"""What the expected errors of micro models depend on: the regions that a plane cuts off a surface.

All of it comes from the undeformed heights, without any solution. The bearing area at the plane
stands for the contacts: on a paraboloid Hertz's contact is half of the region above the plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from geometry import Surface, roughness
from geometry.summits import grid_maxima

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


def contact_measures(surface: Surface, approach: float, *, periodic: bool) -> ContactMeasures:
    """Measure the contacts of a surface under a level plane.

    Args:
        surface: The surface.
        approach: Approach of the undeformed plane [mm].
        periodic: Whether the border cuts nothing.
    """
    level = surface.highest - approach
    names, regions = label(surface.heights > level, np.ones((3, 3)))
    area = np.bincount(names.ravel(), minlength=2)[1:]
    cells = max(int(area.sum()), _LEAST_REGION)
    dx, dy = surface.spacing
    radius = np.sqrt(0.5 * cells * dx * dy / (np.pi * max(regions, 1)))
    summits = grid_maxima(surface.heights, periodic=periodic)
    above = int(np.count_nonzero(summits.height > level))
    return ContactMeasures(
        regions=regions,
        contact_fraction=0.5 * cells / surface.heights.size,
        cells_per_radius=float(radius / max(dx, dy)),
        cells_per_wave=_cells_per_wave(surface),
        crowding=float(radius * np.sqrt(max(above, 1) / surface.area)),
        eccentricity=float(np.sqrt(_mean_square_eccentricity(names, area, dx / dy))),
        border_share=0.0 if periodic else _border_share(names, area),
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
