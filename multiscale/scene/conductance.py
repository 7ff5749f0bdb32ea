"""The section of a scene on thermal and electrical conductance of the interface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from support.errors import InputError
from support.fields import Length, Limits, Positive, Unit
from support.quantities import example


@dataclass(frozen=True, slots=True, kw_only=True)
class ConductanceSection:
    """Conductance of the interface, from its stiffness by Barber's analogy.

    It is exact for contacts between half-spaces; what the bodies add is left to a thermal or
    electrical calculation of them. Either of ``conductivity`` and ``resistivity``, or both.

    Args:
        conductivity: Thermal conductivities of the body below the surface and of the one on the
            other side; a single value where the other body conducts far better.
        resistivity: Electrical resistivities of both bodies, or of one, as ``conductivity``.
        gas: Thermal conductivity k of the gas, which conducts k/(g + M) per area through a gap g
            beside the contacts. Patch laws know the mean gap alone, which is the least that it can
            be.
        temperature_jump: Length M that the jumps of temperature between gas and faces add to the
            gaps; 0 when not given. For air at 1 bar about 0.4 um. Without it what passes beside
            contacts, where gaps close, has no bound, and depends on the grid.
        temperature: Absolute temperature of both faces, for radiation across the gaps.
        emissivity: Effective emissivity of both faces, 1/(1/ε₁ + 1/ε₂ − 1), for radiation across
            the gaps.
    """

    conductivity: Annotated[tuple[float, ...], Unit("W/m/K", several=True)] | None = None
    resistivity: Annotated[tuple[float, ...], Unit("ohm*m", several=True)] | None = None
    gas: Annotated[float, Unit("W/m/K"), Positive] | None = None
    temperature_jump: Annotated[Length, Limits(ge=0)] | None = None
    temperature: Annotated[float, Unit("K"), Positive] | None = None
    emissivity: Annotated[float, Limits(gt=0, le=1)] | None = None

    def __post_init__(self) -> None:
        _check_pair("conductivity", self.conductivity, "W/m/K")
        _check_pair("resistivity", self.resistivity, "ohm*m")
        if self.conductivity is None and self.resistivity is None:
            raise InputError(
                "needs conductivities",
                allowed="conductivity = ['50 W/m/K', '0.2 W/m/K'] for heat, "
                "resistivity = ['1.7e-8 ohm m'] for currents, or both",
            )
        if self.temperature_jump is not None and self.gas is None:
            raise InputError("'temperature_jump' is about the gas", allowed="with 'gas' beside it")
        for key in ("gas", "temperature", "emissivity"):
            if getattr(self, key) is not None and self.conductivity is None:
                raise InputError(f"'{key}' is about heat", allowed="with 'conductivity' beside it")
        if (self.temperature is None) != (self.emissivity is None):
            raise InputError(
                "radiation needs both 'temperature' and 'emissivity'", allowed="both, or neither"
            )


def _check_pair(key: str, values: tuple[float, ...] | None, unit: str) -> None:
    """Refuse anything but positive values of one body or of both."""
    if values is None:
        return
    allowed = f"one or two quantities > 0 such as {example(unit)}"
    if len(values) not in (1, 2):
        problem = "needs a value for one body or for both"
        raise InputError(problem, key=key, value=list(values), allowed=allowed)
    if not min(values) > 0.0:
        raise InputError("must be greater than 0", key=key, value=list(values), allowed=allowed)
