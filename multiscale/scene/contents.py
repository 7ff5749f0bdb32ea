"""All sections of a scene, and which of them go together."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Annotated, Self

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from multiscale.scene.body_sections import BodySection, CounterBodySection, LawSection
from multiscale.scene.conductance_section import ConductanceSection
from multiscale.scene.coupling_sections import CouplingSection, LoadSection, ReferenceSection
from multiscale.scene.read_off_rules import problems_of_conductance, problems_of_hardness
from multiscale.scene.sections import (
    BlockSection,
    CounterSurfaceSection,
    MicroSection,
    Number,
    OutputSection,
    PatchesSection,
    Section,
    SurfaceSection,
)

Problem = tuple[str, str]
"""A key, and why its value makes no sense beside those of others."""


class SceneSections(Section):
    """The sections of a scene. Lengths in mm, pressures in MPa.

    The section ``[load]`` is the attribute `loading`, because `Scene.load` reads a file.
    """

    accuracy: Annotated[Number, Field(gt=0, lt=0.5)] | None = None
    """Allowed relative error of the force. What is stated is kept. Keys that are ``"auto"`` or,
    with an accuracy, not stated (``surface.grid`` of a spectrum, ``micro.model``,
    ``coupling.kind``, ``patches.grid`` and, under laws on a mesh, ``block.cells``) get values by a
    rule from errors that are measured before the run, the same on every machine. The results say
    whether the error that is measured in the run keeps the accuracy. Without it, ``auto`` means
    2 %."""
    surface: SurfaceSection
    """The rough surface."""
    counter_surface: CounterSurfaceSection | None = None
    """Roughness of the other side, which is smooth without this section: heights as measured on it,
    facing up, on the grid of ``[surface]``. It is laid on the surface turned about the y axis, so
    that at x and Lx − x the two heights add."""
    block: BlockSection | None = None
    """The elastic block below the surface. Either this or ``[body]``."""
    body: BodySection | None = None
    """The elastic body below the surface, from a mesh. Either this or ``[block]``."""
    counter_body: CounterBodySection | None = None
    """The elastic body on the other side; a rigid plane without this section."""
    law: LawSection = LawSection()
    """What the laws of the interface are made from."""
    patches: PatchesSection = PatchesSection()
    """The partition of the interface."""
    micro: MicroSection = MicroSection()
    """How contacts are solved."""
    coupling: CouplingSection = CouplingSection()
    """How contacts and block are put together."""
    reference: ReferenceSection = ReferenceSection()
    """The meshes of ``coupling.kind = "reference"``."""
    loading: Annotated[LoadSection, Field(alias="load")]
    """The motion of the rigid plane, or the force on it."""
    conductance: ConductanceSection | None = None
    """Thermal and electrical conductance of the interface, which are not found without it."""
    output: OutputSection = OutputSection()
    """What is written beside the tables of results."""

    @property
    def kind(self) -> str:
        """The coupling, or that the laws are those of samples."""
        return "representative" if self.law.representative else self.coupling.kind

    @property
    def decomposed(self) -> bool:
        """Whether the body is the half-space and what the finite body adds to it, in modes."""
        if self.law.representative:
            return False
        return self.kind == "concurrent" if self.body is not None else self.coupling.decomposed

    @property
    def on_mesh(self) -> bool:
        """Whether laws lie on finite elements of the body, plain or condensed."""
        return self.kind not in ("analytic", "concurrent", "reference") and not self.decomposed

    @model_validator(mode="after")
    def _fit_together(self) -> Self:
        """Refuse sections that make no sense together, with the first reason."""
        of_all = (
            *(self._problems_of_bodies, self._problems_of_surfaces, self._problems_of_couplings),
            *(partial(problems_of_hardness, self), partial(problems_of_conductance, self)),
        )
        for problems in of_all:
            for key, text in problems():
                raise PydanticCustomError("sections", "{text}", {"key": key, "text": text})
        return self

    def _problems_of_bodies(self) -> Iterator[Problem]:
        if self.block is None and self.body is None:
            yield "block", "is required and missing (allowed: [block]; or [body], of a mesh)"
        if self.block is not None and self.body is not None:
            yield "body", "is a second body below the surface (allowed: either [block] or [body])"
        if self.block is None:
            return
        if self.law.representative and self.block.lengths is None:
            yield (
                "block.lengths",
                "is required with law.kind = 'representative', whose surface is a sample (allowed: "
                "the sides of the block along x and y)",
            )
        if self.block.lengths is not None and not self.law.representative:
            yield (
                "block.lengths",
                "needs law.kind = 'representative' (allowed: leave it out; the sides of the block "
                "are those of the surface, and block.margin)",
            )

    def _problems_of_surfaces(self) -> Iterator[Problem]:
        """Yield what does not fit of periodic surfaces, where something ends or turns, and two."""
        kind, model, tilt = self.coupling.kind, self.micro.model, self.loading.tilt
        alone = (kind, model, tilt) == ("analytic", "half-space", (0, 0))
        if self.surface.periodic and not (self.law.representative or alone):
            yield (
                "surface.periodic",
                "a body or a plane that turns does not continue periodically (allowed: "
                "coupling.kind = 'analytic', micro.model = 'half-space', a level plane; or "
                "law.kind = 'representative')",
            )
        other = self.counter_surface
        if self.surface.lacks_grid and (self.accuracy is None or other is not None):
            yield "surface", "a 'spectrum' needs 'grid' and 'lengths' beside it"
        if other is None:
            return
        if other.periodic != self.surface.periodic:
            yield "counter_surface.periodic", "is not surface.periodic (allowed: both, or neither)"
        if "auto" in (self.surface.grid, other.grid):
            yield (
                "surface.grid",
                "is not chosen with [counter_surface] (allowed: the same numbers in both)",
            )

    def _problems_of_couplings(self) -> Iterator[Problem]:
        for name in ("body", "counter_body", "counter_surface"):
            if self.coupling.kind == "reference" and getattr(self, name) is not None:
                yield (
                    "coupling.kind",
                    f"reference does not go with [{name}]: what is meshed is a block under a "
                    "rigid, smooth plane (allowed: 'concurrent', 'consistent', 'isolated')",
                )
        second, coupling = self.counter_body, self.coupling
        on_mesh = coupling.newton == "full" or coupling.interface == "pointwise"
        if second is not None and second.mesh is None and coupling.kind == "isolated" and on_mesh:
            yield (
                "coupling.kind",
                "isolated laws against a half-space need the compliance of both bodies (allowed: "
                "coupling.newton = 'condensed' and coupling.interface = 'patchwise'; or "
                "coupling.kind = 'consistent')",
            )
        chosen = self.accuracy is not None or "auto" in (coupling.kind, self.surface.grid)
        if self.body is not None and chosen:
            yield (
                "accuracy",
                "is not kept on [body], nor are surface.grid or coupling.kind chosen there "
                "(allowed: leave it out, and state them)",
            )
        if self.law.representative:
            yield from self._problems_of_representative_laws()

    def _problems_of_representative_laws(self) -> Iterator[Problem]:
        """Yield the keys that a law of a periodic sample has no use for."""
        law, out = "law.kind = 'representative'", "(allowed: leave it out)"
        for key in sorted(self.coupling.stated - {"table_tolerance"}):
            yield f"coupling.{key}", f"does not go with {law}, which stands at points {out}"
        if self.patches.grid != type(self.patches)().grid:
            yield "patches.grid", f"does not go with {law}, which has no patches {out}"
        if self.accuracy is not None:
            yield "accuracy", f"does not go with {law} (allowed: coupling.table_tolerance)"
        if self.micro.model != "half-space":
            yield "micro.model", f"does not go with {law} (allowed: 'half-space')"
        if self.output.contact in ("last", "all"):
            yield "output.contact", f"does not go with {law}, which has no spots {out}"
        if self.law.seeds and self.surface.spectrum is None:
            yield "law.seeds", "needs surface.spectrum (allowed: leave it out for a measured map)"
        if self.block is not None and self.law.regions:
            yield "law.regions", "names faces of a mesh (allowed: with [body])"
        if self.body is not None and self.body.place is not None:
            yield "body.place", f"does not go with {law}, whose sample has no place {out}"
