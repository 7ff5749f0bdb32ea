"""The sections of a scene on the method and on what the interface does, and all sections together.

The method: patches, micro model, coupling, reference, law, output. The interface rubs, wears,
conducts, leaks, vibrates.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, ConfigDict, Field

from patchlaw.geometry.spectrum import LARGEST_SEED
from patchlaw.geometry.spring_bed import Coefficient
from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.scene.body_sections import (
    BlockSection,
    BodySection,
    CounterBodySection,
    CounterSurfaceSection,
    RegionSection,
    SurfaceSection,
    Tag,
)
from patchlaw.support import (
    KEY,
    Count,
    Distance,
    Grid,
    Heights,
    InputError,
    Length,
    Limits,
    Mass,
    Positive,
    PositiveLength,
    PositivePressure,
    Pressure,
    Unit,
    changed_fields,
)
from patchlaw.support.quantities import example

Radius = PositiveLength | Literal["inf"]
Seed = Annotated[int, Limits(ge=0, le=LARGEST_SEED)]


@dataclass(frozen=True, slots=True, kw_only=True)
class PatchesSection:
    """The partition of the interface.

    Args:
        grid: Numbers of patches along x and y. Laws belong to patches; other couplings gather their
            results by them.
    """

    grid: Grid = (4, 4)


@dataclass(frozen=True, slots=True, kw_only=True)
class MicroSection:
    """The micro model of the rough surface.

    Args:
        model: How contacts are solved: ``half-space`` cell by cell; as elliptic or circular
            summits, with interaction or ``-independent`` of each other (Waddad et al. 2016).
        finite_slopes: Whether the slopes of the roughness, where they are not small, count to
            second order. When not given they do with half-space contacts, unless laws are isolated
            or those of samples. They are refused beyond an rms gradient of 0.8, where that fails.
        cells: Cells along x and y that half-space contacts are solved on, between the heights of a
            map as well; the heights of the surface when not given.
        hardness: Hardness of the softer body, about 2.8 to 3 times its yield strength (Tabor 1951):
            no contact pressure exceeds it, and the interference that it leaves stays as plastic
            depth. Contacts are elastic when not given. It needs half-space contacts.
    """

    model: Literal[
        "elliptic", "circular", "elliptic-independent", "circular-independent", "half-space"
    ] = "half-space"
    finite_slopes: bool | None = None
    cells: tuple[Heights, Heights] | None = None
    hardness: PositivePressure | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CouplingSection:
    """How micro and macro model are put together.

    Args:
        kind: How the force is found: ``concurrent`` solves the whole surface on the block at every
            load step, without laws; ``consistent`` takes all patch laws from such solutions, under
            the tilt of the load (where the plane is free, under the tilt that it takes at each
            approach); ``isolated`` takes every patch's law from what lies in it alone (Waddad et
            al. 2016); ``analytic`` is the micro model alone on a half-space; ``reference`` meshes
            the rough surface itself, see the section reference. An ``accuracy`` chooses it where it
            is not stated: concurrent, consistent where there are more load steps than laws take
            solutions, or reference where neither keeps the accuracy.
        love: Displacement under its own pressure that is subtracted from an isolated patch: the
            mean one, or that at its centre.
        interface: Whether the closure of a law is a mean over each patch, or taken at each point.
        table_tolerance: Interpolation error of the laws, relative to the force; 1e-4 when not
            given, and 2e-3 with micro models that resolve the cells of the surface.
    """

    kind: Literal["isolated", "consistent", "concurrent", "analytic", "reference"] = "consistent"
    love: Literal["mean", "centre"] = "mean"
    interface: Literal["patchwise", "pointwise"] = "patchwise"
    table_tolerance: Annotated[float, Limits(gt=0, lt=0.1)] | None = None

    def __post_init__(self) -> None:
        laws = {"isolated", "consistent"}
        for key, default, kinds in (
            ("love", "mean", {"isolated"}),
            ("interface", "patchwise", laws),
            ("table_tolerance", None, laws),
        ):
            value = getattr(self, key)
            # the analytic one ignores what is about patches and finite elements
            if value != default and self.kind not in {*kinds, "analytic"}:
                raise InputError(
                    f"{key} = {value!r} does not go with kind = '{self.kind}'",
                    allowed=f"{key} = {default!r}" if default else "leave it out",
                )


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceSection:
    """The meshed rough surface of ``coupling.kind = "reference"``; other couplings ignore it.

    Args:
        method: How contact is found, see `macro.UnilateralContactProblem`.
        meshes: Number of meshes of falling size that take the same loads. Their results are
            extrapolated; one mesh alone has no error bar.
        fine: Edge length of the finest tetrahedra where contact can occur; from surface and load
            when not given.
    """

    method: Literal["active-set", "augmented-lagrangian"] = "active-set"
    meshes: Annotated[int, Limits(ge=1, le=3)] = 2
    fine: PositiveLength | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LawSection:
    """What the laws of an interface are made from.

    Args:
        kind: Whether every ``patch`` has the law of its own heights, or a ``representative`` one
            holds at every point of a contact face of any size and outline: that of the surface as a
            periodic sample.
        seeds: Of a spectrum: seeds of several samples. The law is that of their mean, and their
            scatter is reported; the seed of the spectrum when not given.
        samples: Of a ``surface.file``: further maps of the same roughness, read and prepared like
            it. The law is that of the mean of all, and their scatter is reported.
        largest_pressure: Largest pressure at a point of the face that the laws are made for; when
            not given, ten times the mean one, or more on a crowned face. Laws are extended where a
            load step needs it.
        regions: Further faces of the contact, each with a sample of its own.
        crown: Radii of a crowned face along its axes x and y, about its middle; ``"inf"`` is level.
        axes: What the axes x and y of a sample lie along on the face, which a leak depends on:
            those of the face, ``"x"``, as when not given; or, where the lay follows a turned or
            lapped face, ``"polar"``: x along the radius, y around the centre.
        centre: A point on the axis of the part, in coordinates of the mesh, that ``"polar"`` axes
            turn around; the middle of the face's bounding rectangle when not given.
    """

    kind: Literal["patch", "representative"] = "patch"
    seeds: tuple[Seed, ...] = ()
    samples: tuple[str, ...] = ()
    largest_pressure: PositivePressure | None = None
    regions: tuple[RegionSection, ...] = ()
    crown: tuple[Radius, Radius] | None = None
    axes: Literal["x", "polar"] | None = None
    centre: tuple[Length, Length, Length] | None = None

    def __post_init__(self) -> None:
        for key in changed_fields(self) if self.kind == "patch" else ():
            raise InputError(f"'{key}' needs kind = 'representative'", allowed="leave it out")
        if len(set(self.seeds)) < len(self.seeds):
            raise InputError(f"seeds = {list(self.seeds)} has one twice", allowed="different seeds")
        names = [region.surface for region in self.regions]
        if len(set(names)) < len(names):
            raise InputError(f"regions name a face twice: {names}", allowed="each face once")
        if self.centre is not None and self.axes != "polar":
            raise InputError("'centre' is that of polar axes", allowed="axes = 'polar' beside it")

    @property
    def representative(self) -> bool:
        """Whether the law is that of a periodic sample."""
        return self.kind == "representative"


def _load_steps(value: Any) -> Any:
    """Refuse what names no load steps in one sentence, not one for each type that it is not."""
    numbers = isinstance(value, list | tuple) and len(value) > 0
    if numbers and all(type(one) is int and one > 0 for one in value):
        return list(value)
    if isinstance(value, bool) or value in ("last", "all"):
        return value
    raise InputError(
        "does not name load steps",
        allowed="true or false, 'last', 'all', or a list of numbers of load steps, from 1",
    )


_StepNumbers = Annotated[list[Count], Field(min_length=1, description="numbers of load steps")]


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputSection:
    """What is written beside the tables of results.

    Args:
        figures: Whether figures are drawn. "all" adds ``block.png``, which takes about a second:
            the rough block in three dimensions with its contacts and the stresses below them, where
            pressures of cells are known. Half-space contacts have them, with laws where ``contact``
            is written. "svg" writes all of them as SVG too, beside the PNG files.
        report: Whether report.html is written.
        fields: Load steps whose displacements, stresses and contact pressures are written for
            ParaView: "last" (or true), "all", or a list of their numbers.
        check: Load steps whose errors are measured by solving further contact problems, where the
            micro model is ``half-space``; under laws of samples the load step, too, on other
            elements.
        contact: Load steps whose contact is written, with a row for every spot and, where the model
            has cells or nodes, maps of pressure and gap. With "all" the report has a slider over
            the load steps, whose pictures take half a second each. With laws the contact problem
            that they stand for is then solved, once for each of these steps. "auto" is "last"
            without laws and "none" with laws. "none" leaves out the interfacial stiffness as well.
        views: Whether contacts, fields and modes that are written are shown in three dimensions
            too, in pages ``view_*.html`` that the report links, as ``patchlaw view`` does
            afterwards.
    """

    figures: bool | Literal["all", "svg"] = True
    report: bool = True
    fields: Annotated[
        bool | Literal["last", "all"] | _StepNumbers, BeforeValidator(_load_steps)
    ] = False
    check: Literal["last", "none", "all"] = "last"
    contact: Literal["auto", "last", "all", "none"] = "auto"
    views: bool = False

    @property
    def asks_for_contact(self) -> bool:
        """Whether contacts are to be written, whatever the coupling."""
        return self.contact in ("last", "all")

    def wants_fields(self, step: int, *, last: bool) -> bool:
        """Tell whether the fields of a load step are written.

        Args:
            step: Its number.
            last: Whether it is the last one.
        """
        if isinstance(self.fields, list):
            return step in self.fields
        return self.fields == "all" or (last and bool(self.fields))


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
    ``load.shear`` or ``load.shear_force``. Faces under laws of samples wear likewise, those of
    patches with the coupling ``consistent`` by ``load.sliding``; their roughness runs in. Zones of
    faces under laws of samples may have coefficients of their own, see ``law.regions``.

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
    temperature_jump: Distance | None = None
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


@dataclass(frozen=True, kw_only=True)
class SceneSections:
    """The sections of a scene. Lengths in mm, pressures in MPa.

    The section ``[load]`` is the attribute `loading`, because `Scene.load` reads a file.

    Args:
        accuracy: Allowed relative error of the force. What is stated is kept. Keys that are not
            stated (``surface.grid`` of a spectrum,
            ``micro.model``, ``coupling.kind``, ``patches.grid``, ``refinements`` of bodies on
            meshes and, under laws on a mesh, ``block.cells``) get values by a rule from errors that
            are measured before the run, the same on every machine. Under laws of samples
            (``law.kind = "representative"``) these keys are ``surface.grid`` of a spectrum,
            ``micro.finite_slopes``, ``element`` and ``refinements`` of bodies, ``cells`` of a
            block. The results say whether the error that is measured in the run keeps the accuracy.
            Without it every key that is not stated has its default.
        surface: The rough surface.
        counter_surface: Roughness of the other side, which is smooth without this section: heights
            as measured on it, facing up, on the grid of ``[surface]``. It is laid on the surface
            turned about the y axis, so that at x and Lx − x the two heights add.
        block: The elastic block below the surface. Either this or ``[body]``.
        body: The elastic body below the surface, from a mesh. Either this or ``[block]``.
        counter_body: The elastic body on the other side; a rigid plane without this section.
        law: What the laws of the interface are made from.
        patches: The partition of the interface.
        micro: How contacts are solved.
        friction: Friction of the interface, which has none without this section.
        wear: Wear of the surface, of which there is none without this section.
        coupling: How contacts and block are put together.
        reference: The meshes of ``coupling.kind = "reference"``.
        loading: The motion of the rigid plane, or the force on it.
        conductance: Thermal and electrical conductance of the interface, which are not found
            without it.
        leak: Flow of a fluid through the gaps, which is not found without it.
        vibration: Natural modes about every load step, which are not found without it.
        output: What is written beside the tables of results.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid", allow_inf_nan=False)

    accuracy: Annotated[float, Limits(gt=0, lt=0.5)] | None = None
    surface: SurfaceSection
    counter_surface: CounterSurfaceSection | None = None
    block: BlockSection | None = None
    body: BodySection | None = None
    counter_body: CounterBodySection | None = None
    law: LawSection = field(default_factory=LawSection)
    patches: PatchesSection = field(default_factory=PatchesSection)
    micro: MicroSection = field(default_factory=MicroSection)
    friction: FrictionSection | None = None
    wear: WearSection | None = None
    coupling: CouplingSection = field(default_factory=CouplingSection)
    reference: ReferenceSection = field(default_factory=ReferenceSection)
    loading: Annotated[LoadHistory, Field(alias="load")] = field(metadata={KEY: "load"})
    conductance: ConductanceSection | None = None
    leak: LeakSection | None = None
    vibration: VibrationSection | None = None
    output: OutputSection = field(default_factory=OutputSection)

    @property
    def kind(self) -> str:
        """The coupling, or that the laws are those of samples."""
        return "representative" if self.law.representative else self.coupling.kind

    @property
    def by_laws(self) -> bool:
        """Whether load steps use laws."""
        return self.kind in ("consistent", "isolated", "representative")

    @property
    def has_body(self) -> bool:
        """Whether the surface is on a body instead of a half-space."""
        return self.kind != "analytic"

    @property
    def meshes_roughness(self) -> bool:
        """Whether the roughness is meshed, so that there is no micro model."""
        return self.kind == "reference"

    @property
    def shows_contacts(self) -> bool:
        """Whether fields of a body are those under its contacts."""
        return self.kind == "concurrent"

    @property
    def patches_alone(self) -> bool:
        """Whether laws are those of patches that are taken alone, on half-spaces."""
        return self.kind == "isolated"

    @property
    def decomposed(self) -> bool:
        """Whether the body is the half-space and what the finite body adds to it, in modes."""
        if self.kind == "concurrent":
            return True
        if self.body is not None or self.needs_mesh:
            return False
        return self.kind == "consistent" and self.coupling.interface == "patchwise"

    @property
    def hardnesses(self) -> list[float | None]:
        """Hardness of the contact face and of its further regions; None of elastic ones [MPa]."""
        own = self.micro.hardness
        stated = [own if one.hardness is None else one.hardness for one in self.law.regions]
        return [own, *(None if isinstance(one, str) else one for one in stated)]

    @property
    def hardness_key(self) -> str:
        """The first key that states a hardness; empty where contacts are elastic."""
        if self.micro.hardness is not None:
            return "micro.hardness"
        known = [n for n, one in enumerate(self.hardnesses[1:]) if one is not None]
        return f"law.regions.{known[0]}.hardness" if known else ""

    @property
    def coefficients(self) -> list[float]:
        """Coefficients of friction of the contact face and of its further regions, if any."""
        if self.friction is None:
            return []
        own = self.friction.coefficient
        return [own, *(one.friction or own for one in self.law.regions)]

    @property
    def rubs_on_mesh(self) -> bool:
        """Whether laws have friction, whose shear stresses deform the mesh of the body.

        Those of faces that slide as wholes are left out.
        """
        return self.friction is not None and self.by_laws and not self.loading.slides

    @property
    def needs_mesh(self) -> bool:
        """Whether more than the pressures of patches moves the body, or its mass counts."""
        other = self.rubs_on_mesh or self.loads_bodies or self.vibration is not None
        return other or (self.wear is not None and self.by_laws and self.law.representative)

    @property
    def loads_bodies(self) -> bool:
        """Whether anything but the contact moves a body: loads, stages, supports that move."""
        stages = any(one.loads_bodies for one in self.loading.stage)
        return stages or any(one.is_loaded for one in (self.body, self.counter_body) if one)

    @property
    def on_mesh(self) -> bool:
        """Whether laws lie on finite elements of the body, plain or condensed."""
        return self.by_laws and not self.decomposed
