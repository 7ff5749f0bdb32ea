"""The section of a scene on thermal and electrical conductance of the interface."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from multiscale.scene.quantities import (
    OneOrTwoConductivities,
    OneOrTwoResistivities,
    Temperature,
    ThermalConductivity,
)
from multiscale.scene.sections import Number, Section


class ConductanceSection(Section):
    """Conductance of the interface, from its stiffness by Barber's analogy.

    It is exact for contacts between half-spaces; what the bodies add is left to a thermal or
    electrical calculation of them. Either of ``conductivity`` and ``resistivity``, or both.
    """

    conductivity: OneOrTwoConductivities | None = None
    """Thermal conductivities of the body below the surface and of the one on the other side; a
    single value where the other body conducts far better."""
    resistivity: OneOrTwoResistivities | None = None
    """Electrical resistivities of both bodies, or of one, as ``conductivity``."""
    gas: Annotated[ThermalConductivity, Field(gt=0)] | None = None
    """Thermal conductivity of the gas in the gaps: a layer as thick as the mean gap, beside the
    contacts."""
    temperature: Annotated[Temperature, Field(gt=0)] | None = None
    """Absolute temperature of both faces, for radiation across the gaps."""
    emissivity: Annotated[Number, Field(gt=0, le=1)] | None = None
    """Effective emissivity of both faces, 1/(1/ε₁ + 1/ε₂ − 1), for radiation across the gaps."""

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.conductivity is None and self.resistivity is None:
            raise ValueError(
                "needs conductivities (allowed: conductivity = ['50 W/m/K', '0.2 W/m/K'] for heat, "
                "resistivity = ['1.7e-8 ohm m'] for currents, or both)"
            )
        for key in ("gas", "temperature", "emissivity"):
            if getattr(self, key) is not None and self.conductivity is None:
                raise ValueError(f"'{key}' is about heat (allowed: with 'conductivity' beside it)")
        if (self.temperature is None) != (self.emissivity is None):
            raise ValueError(
                "radiation needs both 'temperature' and 'emissivity' (allowed: both, or neither)"
            )
        return self
