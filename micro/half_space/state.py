"""Contact of a rough surface with a rigid plane at one approach, cell by cell."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import Partition, Surface, overlaps, patch_means
from geometry.rigid_plane import RigidPlane
from micro.compliance.grid_compliance import Compliance
from micro.half_space.contact_spots import Contacts, find_contacts, true_area

Array = NDArray[np.float64]

_ROUNDING = 1e-9
"""Of a cell: a centre that is no further beyond a border lies on it."""


def plane_interference(plane: RigidPlane, surface: Surface, reference_height: float) -> Array:
    """Return the overlap of a plane and an undeformed surface, δ(x, y) − (z_M − z), (nx, ny) [mm].

    Args:
        plane: The rigid plane.
        surface: The surface.
        reference_height: Height z_M that approaches count from [mm].
    """
    below = reference_height - surface.heights
    return np.asarray(plane.at(surface.x[:, None], surface.y) - below)


@dataclass(frozen=True, kw_only=True, eq=False)
class HalfSpaceState:
    """Contact of all cells at one approach; maps are evaluated when first used.

    Args:
        plane: The rigid plane: approach at the centre from first touch, and slopes.
        surface: The surface.
        reference_height: Height z_M that approaches count from [mm].
        pressure: Contact pressure, shape (nx, ny) [MPa].
        residual: Largest violation of gap ≥ 0 and of gap = 0 under pressure, relative to the
            largest interference. It bounds the error of the force: this is exact for a surface
            whose heights differ by ``residual`` δ at most.
        iterations: Products of the compliance with pressures.
        compliance: Elastic body of the model.
    """

    plane: RigidPlane
    surface: Surface
    reference_height: float
    pressure: Array
    residual: float
    iterations: int
    compliance: Compliance = field(repr=False)

    @property
    def approach(self) -> float:
        """Rigid approach δ at the centre, counted from first touch [mm]."""
        return self.plane.approach

    @property
    def force(self) -> float:
        """Normal force [N]."""
        return float(self.pressure.sum()) * self.surface.spacing[0] * self.surface.spacing[1]

    @property
    def in_contact(self) -> NDArray[np.bool_]:
        """Which cells carry a pressure, shape (nx, ny)."""
        return self.pressure > 0.0

    @property
    def periodic(self) -> bool:
        """Whether surface and pressures continue periodically."""
        return self.compliance.periodic

    @property
    def counted_area(self) -> float:
        """Area of all cells under pressure [mm²]; too large by a part of the perimeter."""
        return float(self.contacts.counted_area.sum())

    @property
    def contact_area(self) -> float:
        """Real contact area, corrected by the perimeter [mm²]."""
        return float(self.contacts.area.sum())

    @cached_property
    def contacts(self) -> Contacts:
        """The connected contacts."""
        return find_contacts(self.pressure, self.surface.spacing, periodic=self.periodic)

    @cached_property
    def displacement(self) -> Array:
        """Normal displacement of the surface at the cell centres, shape (nx, ny) [mm].

        On a periodic surface it counts from its own mean.
        """
        pressure = np.divide(self.pressure, self.compliance.modulus)
        grid = self.compliance.on_grid(pressure.shape, self.surface.spacing)
        found = grid.displacement(pressure)
        if self.compliance.slopes is not None:
            found += self.compliance.slope_displacement(pressure)
        return found

    @property
    def interference(self) -> Array:
        """Overlap of plane and undeformed surface, negative where they are apart, (nx, ny) [mm]."""
        return plane_interference(self.plane, self.surface, self.reference_height)

    @property
    def gap(self) -> Array:
        """Distance of the displaced surface from the plane, shape (nx, ny) [mm]."""
        return self.displacement - self.interference

    def row(self, patches: Partition, mean_heights: Array) -> dict[str, Any]:
        """Return the fields of a `Response` at this approach: sums and means over patches.

        Pressure, area and displacement of a cell that straddles a border are shared by area; force
        and area outside of all patches count for the nearest. A contact counts for the patch that
        holds its largest pressure.

        Args:
            patches: The N patches, within the surface's rectangle.
            mean_heights: Mean heights of the patches, shape (N,) [mm].
        """
        plane, contacts = self.plane, self.contacts
        surface = self.surface
        displaced = Surface(heights=self.displacement, lengths=surface.lengths)
        displacement = patch_means(displaced, patches)
        separation = self.reference_height - plane.means(patches) - mean_heights + displacement
        borders = patches.borders_x, patches.borders_y
        x, y = map(overlaps, borders, surface.lengths, surface.grid)
        area = true_area(self.in_contact, periodic=self.periodic)
        forces = self.pressure * (surface.spacing[0] * surface.spacing[1])
        owner = patches.index_of(*_inside(contacts.peak, patches, surface.spacing).T)
        return {
            "approach": plane.approach,
            "force": self.force,
            "moment": plane.moment(surface.x[:, None], surface.y, forces),
            "contact_area": self.contact_area,
            "contacts": len(contacts),
            "mean_separation": np.average(separation, weights=patches.areas),
            "iterations": self.iterations,
            "residual": self.residual,
            "overlapping_contacts": 0,
            "patch_force": (x @ self.pressure @ y.T).ravel(),
            "patch_contact_area": (x @ area @ y.T).ravel(),
            "patch_contacts": np.bincount(owner, minlength=patches.count),
            "patch_displacement": displacement,
            "patch_separation": separation,
            "warning": "",
        }


def _inside(centres: Array, patches: Partition, spacing: tuple[float, float]) -> Array:
    """Move centres that lie beyond the outer borders by rounding alone onto these."""
    x, y = patches.borders_x, patches.borders_y
    nearest = np.clip(centres, (x[0], y[0]), (x[-1], y[-1]))
    beyond = np.abs(centres - nearest) > _ROUNDING * np.array(spacing)
    return np.where(beyond, centres, nearest)
