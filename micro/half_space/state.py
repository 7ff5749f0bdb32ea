"""Contact of a rough surface with a rigid plane at one approach, cell by cell."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.rigid_plane import RigidPlane
from micro.compliance.cells import Box
from micro.compliance.grid_compliance import Compliance
from micro.half_space.contact_spots import Contacts, find_contacts

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class HalfSpaceState:
    """Contact of all cells at one approach; maps are evaluated when first used.

    Args:
        plane: The rigid plane: approach at the centre from first touch, and slopes.
        interference: Overlap of the plane and the undeformed surface, δ(x, y) − (z_M − z), negative
            where they are apart, shape (nx, ny) [mm].
        pressure: Contact pressure, shape (nx, ny) [MPa].
        spacing: Sides (dx, dy) of a cell [mm].
        residual: Largest violation of gap ≥ 0 and of gap = 0 under pressure, relative to the
            largest interference. It bounds the error of the force: this is exact for a surface
            whose heights differ by ``residual`` δ at most.
        iterations: Products of the compliance with pressures.
        compliance: Elastic body of the model.
    """

    plane: RigidPlane
    interference: Array
    pressure: Array
    spacing: tuple[float, float]
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
        return float(self.pressure.sum()) * self.spacing[0] * self.spacing[1]

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
        return find_contacts(self.pressure, self.spacing, periodic=self.periodic)

    @cached_property
    def displacement(self) -> Array:
        """Normal displacement of the surface at the cell centres, shape (nx, ny) [mm].

        On a periodic surface it counts from its own mean.
        """
        pressure = np.divide(self.pressure, self.compliance.modulus)
        whole = Box.whole(pressure.shape)
        found = self.compliance.on_grid(pressure.shape, self.spacing, whole).displacement(pressure)
        if self.compliance.slopes is not None:
            found += self.compliance.slope_displacement(pressure)
        return found

    @property
    def gap(self) -> Array:
        """Distance of the displaced surface from the plane, shape (nx, ny) [mm]."""
        return self.displacement - self.interference
