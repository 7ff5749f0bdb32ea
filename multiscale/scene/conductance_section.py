"""The section of a scene on thermal and electrical conductance of the interface."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from multiscale.scene.quantities import (
    Length,
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
    """Thermal conductivity k of the gas, which conducts k/(g + M) per area through a gap g beside
    the contacts. Patch laws know the mean gap alone, which is the least that it can be."""
    temperature_jump: Annotated[Length, Field(ge=0)] | None = None
    """Length M that the jumps of temperature between gas and faces add to the gaps; 0 when not
    given. For air at 1 bar about 0.4 um. Without it what passes beside contacts, where gaps close,
    has no bound, and depends on the grid."""
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
        if self.temperature_jump is not None and self.gas is None:
            raise ValueError("'temperature_jump' is about the gas (allowed: with 'gas' beside it)")
        for key in ("gas", "temperature", "emissivity"):
            if getattr(self, key) is not None and self.conductivity is None:
                raise ValueError(f"'{key}' is about heat (allowed: with 'conductivity' beside it)")
        if (self.temperature is None) != (self.emissivity is None):
            raise ValueError(
                "radiation needs both 'temperature' and 'emissivity' (allowed: both, or neither)"
            )
        return self
