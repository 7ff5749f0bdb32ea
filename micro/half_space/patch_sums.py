"""From the pressures on cells to the response of the surface and its patches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import Partition, Surface, overlaps, patch_means
from geometry.rigid_plane import RigidPlane
from micro.half_space.contact_spots import true_area
from micro.half_space.state import HalfSpaceState

Array = NDArray[np.float64]

TIE = 1e-9
"""Of a cell: a centre that is no further beyond a border lies on it, whatever rounding says."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellSums:
    """Sums and means over patches of what the cells do.

    Pressure, area and displacement of a cell that straddles a border are shared by area; force and
    area outside of all patches count for the nearest. A contact counts for the patch that holds
    its largest pressure.

    Args:
        surface: The surface.
        patches: The N patches, within the surface's rectangle.
        mean_heights: Mean heights of the patches, shape (N,) [mm].
        highest: Height z_M that approaches count from [mm].
    """

    surface: Surface
    patches: Partition
    mean_heights: Array
    highest: float

    def row(self, plane: RigidPlane, state: HalfSpaceState) -> dict[str, Any]:
        """Return the fields of a response for one approach."""
        displacement = self._means(state.displacement)
        below = self.highest - plane.means(self.patches)
        separation = below - self.mean_heights + displacement
        area = true_area(state.in_contact, periodic=state.periodic)
        contacts = state.contacts
        owner = self.patches.index_of(*self._inside(contacts.peak).T)
        return {
            "approach": plane.approach,
            "force": state.force,
            "moment": self._moment(plane, state),
            "contact_area": state.contact_area,
            "contacts": len(contacts),
            "mean_separation": np.average(separation, weights=self.patches.areas),
            "iterations": state.iterations,
            "residual": state.residual,
            "engulfed": 0,
            "patch_force": self._sums(state.pressure),
            "patch_contact_area": self._sums(area),
            "patch_contacts": np.bincount(owner, minlength=self.patches.count),
            "patch_displacement": displacement,
            "patch_separation": separation,
            "warning": "",
        }

    def _inside(self, centres: Array) -> Array:
        """Move centres that lie beyond the outer borders by rounding alone onto these."""
        x, y = self.patches.borders_x, self.patches.borders_y
        nearest = np.clip(centres, (x[0], y[0]), (x[-1], y[-1]))
        beyond = np.abs(centres - nearest) > TIE * np.array(self.surface.spacing)
        return np.where(beyond, centres, nearest)

    def _moment(self, plane: RigidPlane, state: HalfSpaceState) -> tuple[float, float]:
        dx, dy = self.surface.spacing
        cells = state.pressure * (dx * dy)
        return plane.moment(self.surface.x[:, None], self.surface.y, cells)

    def _means(self, field: Array) -> Array:
        return patch_means(Surface(heights=field, lengths=self.surface.lengths), self.patches)

    def _sums(self, field: Array) -> Array:
        """Integrate over every patch, and beyond the outer borders for the nearest patch."""
        borders = self.patches.borders_x, self.patches.borders_y
        x, y = map(overlaps, borders, self.surface.lengths, self.surface.grid)
        return np.asarray((x @ field @ y.T).ravel())
