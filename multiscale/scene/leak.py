"""The section of a scene on the fluid that leaks through the gaps of the contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from multiscale.scene.surface import Tag
from support.errors import InputError
from support.fields import Positive, Pressure, Unit

Direction = Literal["x", "y"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LeakSection:
    """Flow of a fluid through the gaps between two opposite sides, or edges of a contact face.

    Reynolds' equation: laminar flow without inertia of an incompressible fluid of constant
    viscosity, without cavitation, that sticks to both walls. Fluid pressure does not move them. The
    sides along the flow are walls, unless the surface is periodic.

    Args:
        viscosity: Dynamic viscosity η of the fluid.
        pressures: Fluid pressures at the side where x, or y, is 0, and at the opposite one, or at
            inlet and outlet; their difference drives the flow.
        direction: Axis along which it flows; or both, one after the other.
        inlet: Physical name or number of a face of the body that shares an edge with the contact
            face, where the first pressure is; with a law of samples (``law.kind =
            "representative"``) on a mesh, which needs it. Other edges are walls.
        outlet: The same of the second pressure.
    """

    viscosity: Annotated[float, Unit("Pa*s"), Positive]
    pressures: tuple[Pressure, Pressure]
    direction: Literal["x", "y", "both"] = "both"
    inlet: Tag | None = None
    outlet: Tag | None = None

    def __post_init__(self) -> None:
        if (self.inlet is None) != (self.outlet is None):
            missing = "inlet" if self.inlet is None else "outlet"
            raise InputError(
                "is missing: a leak over a contact face needs both edges",
                key=missing,
                allowed="names of faces that share an edge with it",
            )
        if self.between_edges and self.direction != "both":
            raise InputError("'direction' does not go with edges", allowed="leave it out")
        if self.between_edges and self.inlet == self.outlet:
            raise InputError("is the inlet", key="outlet", value=self.outlet, allowed="another")
        first, second = self.pressures
        if first == second:
            raise InputError(
                "drives no flow",
                key="pressures",
                value=list(self.pressures),
                allowed='two different pressures such as ["2 bar", "1 bar"]',
            )

    @property
    def between_edges(self) -> bool:
        """Whether the fluid flows over a contact face, from edge to edge."""
        return self.inlet is not None

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
