"""The section of a scene on the fluid that leaks through the gaps of the contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from support.errors import InputError
from support.fields import Positive, Pressure, Unit

Direction = Literal["x", "y"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LeakSection:
    """Flow of a fluid through the gaps between two opposite sides of the surface.

    Reynolds' equation: laminar flow without inertia of an incompressible fluid of constant
    viscosity, without cavitation, that sticks to both walls. Fluid pressure does not move them. The
    sides along the flow are walls, unless the surface is periodic.

    Args:
        viscosity: Dynamic viscosity η of the fluid.
        pressures: Fluid pressures at the side where x, or y, is 0, and at the opposite one; their
            difference drives the flow.
        direction: Axis along which it flows; or both, one after the other.
    """

    viscosity: Annotated[float, Unit("Pa*s"), Positive]
    pressures: tuple[Pressure, Pressure]
    direction: Literal["x", "y", "both"] = "both"

    def __post_init__(self) -> None:
        first, second = self.pressures
        if first == second:
            raise InputError(
                "drives no flow",
                key="pressures",
                value=list(self.pressures),
                allowed='two different pressures such as ["2 bar", "1 bar"]',
            )

    @property
    def drop(self) -> float:
        """Fluid pressure at the first side less that at the opposite one [MPa]."""
        return self.pressures[0] - self.pressures[1]

    @property
    def viscosity_MPa_s(self) -> float:
        """Dynamic viscosity [MPa s]."""
        return 1e-6 * self.viscosity

    @property
    def directions(self) -> tuple[Direction, ...]:
        """The axes along which the fluid flows."""
        return ("x", "y") if self.direction == "both" else (self.direction,)
