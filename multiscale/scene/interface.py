"""The sections of a scene on what the interface does beside bearing: rub, conduct, leak."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from patchlaw.geometry.spring_bed import Coefficient
from patchlaw.multiscale.scene.surface import Tag
from patchlaw.support.arguments import Length, Limits, Mass, Positive, Pressure, Unit
from patchlaw.support.errors import InputError
from patchlaw.support.quantities import example

Direction = Literal["x", "y"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionSection:
    """Coulomb friction of the interface; without this section it is frictionless.

    Cells stick and slip where load steps solve half-space contacts themselves, with the couplings
    ``concurrent`` and ``analytic``. Laws have friction on the mesh of the body: ``consistent``,
    ``isolated`` and laws of samples. What shears the interface are ``load.shear`` or
    ``load.shear_force``; with laws the body itself as well, as it bulges or expands. Cells that
    wear by ``load.sliding`` lose μ times force and distance to friction.

    Args:
        coefficient: Coefficient of friction μ: no tangential traction exceeds μ times the pressure.
        coupled: Whether pressures pull the surface sideways and tractions lift it, as on a body
            against a rigid plane, or of other elasticity than the other one, and on a finite body.
            Both problems are then solved in turn until they agree. With ``false`` it is neglected,
            and the run says how much the shear force would differ. When not given it is neglected
            unless the shear would differ by more than 10 %, which a few cells tell before the run.
            Cells alone can do so.
        speed: Speed of ``load.sliding``, for the power that friction takes at every load step, as
            in ``5 m/s``.
    """

    coefficient: Coefficient
    coupled: bool | None = None
    speed: Annotated[float, Unit("m/s"), Positive] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class WearSection:
    """Wear of the surface by Archard's law; without it nothing wears.

    Cells wear with the couplings ``concurrent`` and ``analytic``: by ``load.sliding``, as the faces
    slide on each other as wholes, or by their own slip (fretting), with ``[friction]`` under
    ``load.shear`` or ``load.shear_force``. Faces under laws of samples wear by ``load.sliding``,
    and the samples run in. Zones of such faces may have coefficients of their own, see
    ``law.regions``.

    Args:
        coefficient: Depth that wears off per distance slid and pressure, which is the volume per
            distance and force: 1e-8 mm²/N are 1e-5 mm³/(N m).
    """

    coefficient: Annotated[float, Unit("1/MPa"), Positive]


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


@dataclass(frozen=True, slots=True, kw_only=True)
class VibrationSection:
    """Natural modes of the bodies about every load step, linear in the stiffness of the contact.

    They need laws on the mesh of bodies whose materials have a ``density``. With friction contacts
    stick; without it the plane glides along the face.

    Args:
        modes: Number of modes, from the lowest frequency.
        plane: Mass of the rigid plane, which moves along its normal then; or that it is held.
        sliding: Direction along the axes of the face in which the plane slides over it: shear
            stresses are then μ times the pressures, and modes may merge and grow. When not given
            nothing slides.
    """

    modes: Annotated[int, Limits(ge=1, le=1000)] = 10
    plane: Mass | Literal["held"] = "held"
    sliding: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.sliding is not None and not any(self.sliding):
            raise InputError(
                "is no direction", key="sliding", value=list(self.sliding), allowed="[1, 0]"
            )


def _check_pair(key: str, values: tuple[float, ...] | None, unit: str) -> None:
    """Refuse anything but positive values of one body or of both."""
    problem = ""
    if values is not None and len(values) not in (1, 2):
        problem = "needs a value for one body or for both"
    elif values and not min(values) > 0.0:
        problem = "must be greater than 0"
    if problem:
        allowed = f"one or two quantities > 0 such as {example(unit)}"
        raise InputError(problem, key=key, value=list(values or ()), allowed=allowed)
