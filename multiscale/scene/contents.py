"""All sections of a scene in one record."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.scene.bodies import (
    BlockSection,
    BodySection,
    CounterBodySection,
)
from patchlaw.multiscale.scene.interface import (
    ConductanceSection,
    FrictionSection,
    LeakSection,
    VibrationSection,
    WearSection,
)
from patchlaw.multiscale.scene.sections import (
    CouplingSection,
    LawSection,
    MicroSection,
    OutputSection,
    PatchesSection,
    ReferenceSection,
)
from patchlaw.multiscale.scene.surface import CounterSurfaceSection, SurfaceSection
from patchlaw.support.arguments import KEY, Limits


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
    loading: LoadHistory = field(metadata={KEY: "load"})
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
    def laws_know_body(self) -> bool:
        """Whether laws hold on the body, so that a tolerance of them follows from an accuracy."""
        return self.by_laws and self.kind != "isolated"

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
        """Whether laws have friction, whose shear stresses deform the mesh of the body."""
        return self.friction is not None and self.by_laws

    @property
    def needs_mesh(self) -> bool:
        """Whether more than the pressures of patches moves the body, or its mass counts."""
        wears = self.wear is not None and self.by_laws
        return wears or self.rubs_on_mesh or self.loads_bodies or self.vibration is not None

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
        return self.by_laws and not self.decomposed
