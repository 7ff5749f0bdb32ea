"""All sections of a scene in one record; what of them goes together beyond what sections say."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain
from typing import Annotated

from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.scene.bodies import (
    BlockSection,
    BodySection,
    CounterBodySection,
)
from patchlaw.multiscale.scene.interface import ConductanceSection, FrictionSection, LeakSection
from patchlaw.multiscale.scene.sections import (
    CouplingSection,
    LawSection,
    MicroSection,
    OutputSection,
    PatchesSection,
    ReferenceSection,
)
from patchlaw.multiscale.scene.surface import CounterSurfaceSection, Problem, SurfaceSection
from patchlaw.support.arguments import KEY, Limits
from patchlaw.support.errors import InputError

_WITHOUT_GAPS = {"isolated", "reference"}
"""Couplings that know no gaps of the surface's cells, nor laws of what leaks through them."""


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
        coupling: How contacts and block are put together.
        reference: The meshes of ``coupling.kind = "reference"``.
        loading: The motion of the rigid plane, or the force on it.
        conductance: Thermal and electrical conductance of the interface, which are not found
            without it.
        leak: Flow of a fluid through the gaps, which is not found without it.
        output: What is written beside the tables of results.
    """

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
    coupling: CouplingSection = field(default_factory=CouplingSection)
    reference: ReferenceSection = field(default_factory=ReferenceSection)
    loading: LoadHistory = field(metadata={KEY: "load"})
    conductance: ConductanceSection | None = None
    leak: LeakSection | None = None
    output: OutputSection = field(default_factory=OutputSection)

    @property
    def kind(self) -> str:
        """The coupling, or that the laws are those of samples."""
        return "representative" if self.law.representative else self.coupling.kind

    @property
    def decomposed(self) -> bool:
        """Whether the body is the half-space and what the finite body adds to it, in modes."""
        if self.kind == "concurrent":
            return True
        if self.body is not None or self.rubs_on_mesh or self.loads_bodies:
            return False
        return self.kind == "consistent" and self.coupling.interface == "patchwise"

    @property
    def rubs_on_mesh(self) -> bool:
        """Whether laws have friction, whose shear stresses deform the mesh of the body."""
        by_laws = self.kind in ("consistent", "isolated", "representative")
        return self.friction is not None and by_laws

    @property
    def loads_bodies(self) -> bool:
        """Whether anything but the contact moves a body: loads, stages, supports that move."""
        stages = any(one.loads_bodies for one in self.loading.stage)
        return stages or any(section.is_loaded for section in self._meshed)

    @property
    def _meshed(self) -> list[CounterBodySection]:
        return [one for one in (self.body, self.counter_body) if one is not None]

    @property
    def on_mesh(self) -> bool:
        """Whether laws lie on finite elements of the body, plain or condensed."""
        return self.kind not in ("analytic", "concurrent", "reference") and not self.decomposed


def check_together(scene: SceneSections, of_coupling: Iterable[str]) -> None:
    """Refuse sections that make no sense together.

    Args:
        scene: The sections, each of which makes sense.
        of_coupling: The keys that were written of the section on the coupling.

    Raises:
        InputError: With the first reason.
    """
    interface = (scene.leak, scene.conductance, scene.friction)
    problems = chain(
        *(rule(scene) for rule in (_bodies, _body_loads, _surfaces, _couplings)),
        scene.law.problems(scene, of_coupling),
        scene.micro.problems(scene),
        *(section.problems(scene) for section in interface if section is not None),
        _shear(scene),
    )
    for key, problem, allowed in problems:
        raise InputError(problem, key=key, allowed=allowed or None)


def _bodies(scene: SceneSections) -> Iterator[Problem]:
    if scene.block is None and scene.body is None:
        yield "block", "is required and missing", "[block]; or [body], of a mesh"
    if scene.block is not None and scene.body is not None:
        yield "body", "is a second body below the surface", "either [block] or [body]"
    if scene.block is None:
        return
    if scene.law.representative and scene.block.lengths is None:
        yield (
            "block.lengths",
            "is required with law.kind = 'representative', whose surface is a sample",
            "the sides of the block along x and y",
        )
    if scene.block.lengths is not None and not scene.law.representative:
        yield (
            "block.lengths",
            "needs law.kind = 'representative'",
            "leave it out; the sides of the block are those of the surface, and block.margin",
        )


def _body_loads(scene: SceneSections) -> Iterator[Problem]:
    """Yield loads of bodies that are not there, and what does not know of them."""
    sections = {"body": scene.body, "counter_body": scene.counter_body}
    for number, stage in enumerate(scene.loading.stage):
        for name, section in sections.items():
            loads, key = getattr(stage, name), f"load.stage.{number}.{name}"
            if loads is None:
                continue
            if section is None or section.mesh is None:
                yield key, f"loads a mesh, and there is no [{name}] of one", f"[{name}] with a mesh"
            else:
                section.check_expands(loads, f"{key}.temperature")
    if scene.counter_body is not None and scene.counter_body.pretension:
        yield (
            "counter_body.pretension",
            "bolts pull the body towards the counter-body, whose supports move with them",
            "body.pretension; what bolts do to the counter-body is one of its tractions",
        )
    if not scene.loads_bodies:
        return
    key = "load.stage" if any(one.loads_bodies for one in scene.loading.stage) else "body"
    reason = "loads of the body besides the contact need laws on its mesh"
    ways = "coupling.kind = 'consistent' or 'isolated'; or law.kind = 'representative'"
    if scene.kind in ("analytic", "concurrent", "reference"):
        yield "coupling.kind", f"is '{scene.kind}', but {reason}", ways
    if scene.law.representative:
        return
    if scene.output.contact in ("last", "all"):
        yield (
            "output.contact",
            "the contact problem behind laws does not know of loads of the body",
            "'none' or 'auto'; or no loads of the body",
        )


def _surfaces(scene: SceneSections) -> Iterator[Problem]:
    """Yield what does not fit of periodic surfaces, where something ends or turns, and two."""
    kind, model, tilt = scene.coupling.kind, scene.micro.model, scene.loading.tilt
    alone = (kind, model, tilt) == ("analytic", "half-space", (0, 0))
    if scene.surface.periodic and not (scene.law.representative or alone):
        yield (
            "surface.periodic",
            "a body or a plane that turns does not continue periodically",
            "coupling.kind = 'analytic', micro.model = 'half-space', a level plane; or "
            "law.kind = 'representative'",
        )
    other = scene.counter_surface
    chosen = scene.accuracy is not None and other is None
    maps = [("law.regions", region) for region in scene.law.regions]
    for key, one in [("surface", scene.surface), ("counter_surface", other), *maps]:
        if one is not None and one.lacks_grid and not (chosen and key == "surface"):
            yield key, "a 'spectrum' needs 'grid' and 'lengths' beside it", ""
    if other is None:
        return
    if other.periodic != scene.surface.periodic:
        yield "counter_surface.periodic", "is not surface.periodic", "both, or neither"


def _couplings(scene: SceneSections) -> Iterator[Problem]:
    """Yield what a coupling has no use for, and what it leaves out."""
    rigid = "which meshes a body under a rigid, smooth plane"
    mapped = "which knows no gaps of cells"
    apart = "whose meshes do not tell the stiffness of the interface from that of the block"
    for key, value, kinds, reason in (
        ("counter_body", scene.counter_body, {"reference"}, rigid),
        ("counter_surface", scene.counter_surface, {"reference"}, rigid),
        ("conductance", scene.conductance, {"reference"}, apart),
        ("micro.hardness", scene.micro.hardness, {"reference", "isolated"}, "which is elastic"),
        ("leak", scene.leak, _WITHOUT_GAPS, mapped),
    ):
        if value is not None and scene.kind in kinds:
            others = (repr(one) for one in ("concurrent", "consistent", "isolated", "analytic"))
            allowed = " or ".join(one for one in others if one[1:-1] not in kinds)
            problem = f"does not go with coupling.kind = '{scene.kind}', {reason}"
            yield key, problem, f"coupling.kind = {allowed}"
    second = scene.counter_body
    if second is not None and second.mesh is None and scene.kind in ("isolated", "representative"):
        laws = "laws of samples" if scene.law.representative else "isolated laws"
        problem = f"is a half-space, which {laws} do not know"
        yield "counter_body", problem, "a meshed block in its place, counter_body.mesh"


def _shear(scene: SceneSections) -> Iterator[Problem]:
    """Yield shear without friction."""
    loading = scene.loading
    if loading.shear_key and scene.friction is None:
        place = "load.stage" if loading.stage else f"load.{loading.shear_key}"
        yield place, "needs friction", "friction.coefficient, as in 0.3"
