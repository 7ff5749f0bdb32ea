"""Contact of a rough surface with a rigid plane at one approach, cell by cell."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.rigid_plane import RigidPlane
from micro.compliance.bounding_box import Box
from micro.compliance.elastic_grid import ElasticGrids
from micro.half_space.contact_spots import Contacts, find_contacts

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class HalfSpaceState:
    """Contact of all cells at one approach; maps are evaluated when first asked for.

    Args:
        plane: The rigid plane: approach at the centre from first touch, and slopes.
        required: Displacement that the plane asks of each cell, δ(x, y) − (z_M − z), negative
            where they are apart, shape (nx, ny) [mm].
        pressure: Contact pressure, shape (nx, ny) [MPa].
        contact_modulus: E* [MPa].
        spacing: Sides (dx, dy) of a cell [mm].
        periodic: Whether surface and pressures continue periodically.
        residual: Largest violation of gap ≥ 0 and of gap = 0 under pressure, relative to the
            largest displacement asked for. It bounds the error of the force: this is exact for
            a surface whose heights differ by ``residual`` δ at most.
        iterations: Products of the compliance with pressures.
        grids: Elastic body of the model.
    """

    plane: RigidPlane
    required: Array
    pressure: Array
    contact_modulus: float
    spacing: tuple[float, float]
    periodic: bool
    residual: float
    iterations: int
    grids: ElasticGrids = field(repr=False)

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
        whole = Box.whole(self.pressure.shape)
        grid = self.grids.at(self.pressure.shape, self.spacing, whole)
        pressure = np.divide(self.pressure, self.contact_modulus)
        found = grid.displacement(pressure)
        return found if self.grids.slopes is None else found + self.grids.by_slopes(pressure)

    @property
    def gap(self) -> Array:
        """Distance of the displaced surface from the plane, shape (nx, ny) [mm]."""
        return self.displacement - self.required
