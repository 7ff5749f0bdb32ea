"""The contact problems on the cells of samples, which laws of samples stand for."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from patchlaw.geometry import Surface
from patchlaw.micro import FiniteSlopes, HalfSpaceModel
from patchlaw.micro.friction.friction_model import FrictionModel
from patchlaw.multiscale.bodies.bodies import SLOPES, on_body
from patchlaw.multiscale.measured_errors.contact import ErrorProbe
from patchlaw.multiscale.measured_errors.edges import edge_width
from patchlaw.multiscale.scene.surfaces import RegionSamples
from patchlaw.support.errors import NotConverged


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampleCells:
    """Half-space models of samples, and what else is solved on their cells.

    Args:
        model: The periodic half-space of one of the samples.
        finite_slopes: Whether finite slopes of the samples count.
        has_edges: Whether the contact face ends at free edges.
        coefficient: Coefficient of friction; 0 without.
    """

    model: HalfSpaceModel
    finite_slopes: bool
    has_edges: bool
    coefficient: float = 0.0

    def model_of(self, region: RegionSamples, sample: Surface) -> HalfSpaceModel:
        """Return the periodic model of a sample, with the slopes of its bodies where they count.

        Args:
            region: The samples of its region.
            sample: The sample.
        """
        model = self._flat_model(region, sample)
        if not self.finite_slopes:
            return model
        sides = region.sides_of(sample)
        return replace(model, slopes=tuple(FiniteSlopes(*one, periodic=True) for one in sides))

    def _flat_model(self, region: RegionSamples, sample: Surface) -> HalfSpaceModel:
        modulus = region.materials.contact_modulus
        return replace(self.model, surface=sample, contact_modulus=modulus)

    def friction_of(self, region: RegionSamples, sample: Surface) -> FrictionModel:
        """Return the friction of a sample's cells, whose pressures and tractions see each other.

        Args:
            region: The samples of its region.
            sample: The sample.
        """
        return FrictionModel(
            materials=region.materials,
            coefficient=self.coefficient,
            spacing=sample.spacing,
            periodic=True,
            coupled=True,
        )

    def probe_of(self, region: RegionSamples, sample: Surface) -> ErrorProbe:
        """Return what measures the errors of a contact of one sample.

        Args:
            region: The samples of its region.
            sample: The sample.
        """
        return ErrorProbe(
            model=self._flat_model(region, sample),
            on_body=on_body(None, region.materials, region.above_of(sample)),
            order=SLOPES if self.finite_slopes else 0,
        )

    def edge_width_of(self, region: RegionSamples, sample: Surface, pressure: float) -> float:
        """Return the width along the edges of the face that the law of a sample errs by [mm].

        Args:
            region: The samples of its region.
            sample: The sample.
            pressure: Mean pressure [MPa].
        """
        if not self.has_edges:
            return 0.0
        try:
            return edge_width(self._flat_model(region, sample), pressure, region.materials.first)
        except NotConverged:
            return math.inf
