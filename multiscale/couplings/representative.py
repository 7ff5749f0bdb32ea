"""The coupling with laws of periodic samples at the points of a contact face.

Theory: docs/theory.md, sections 10 and 11.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from patchlaw.geometry import PatchGrid, RigidPlane, patch_means
from patchlaw.geometry.spring_bed import Friction
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.closed_forms.hertz import crowned_peak
from patchlaw.multiscale.couplings import describe, validity
from patchlaw.multiscale.couplings.about import About
from patchlaw.multiscale.couplings.coupling import Coupling, Meshes
from patchlaw.multiscale.couplings.dispatch import traits_of
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.of_samples import representative_laws
from patchlaw.multiscale.laws.refinement import MOST_ROWS
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.machine import MemoryRequest
from patchlaw.multiscale.measured_errors.errors import error_columns
from patchlaw.multiscale.measured_errors.samples import (
    LawErrorProbe,
    SampleCells,
    causes_of,
    check_requests,
    omission_notes,
)
from patchlaw.multiscale.models.face_contact import ExtendedFaceContact
from patchlaw.multiscale.models.model import Model
from patchlaw.multiscale.readable import Observer, number, times
from patchlaw.multiscale.scene.loads import check_load, path_on
from patchlaw.multiscale.scene.memory import CELL_OF_CONTACT, check_memory
from patchlaw.multiscale.scene.parts import BodyFacts, SceneParts, Source, second_material
from patchlaw.multiscale.scene.surfaces import (
    crown_depth,
    located,
    region_samples,
    sample_surface,
)

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro import FacePair, LawContactProblem, LoadedFace


@dataclass(eq=False)
class RepresentativeCoupling(Coupling):
    """Laws of samples on the contact face of a body; they are extended where a step needs it.

    Attributes:
        further_fields: Make functions on the mesh that are written with the other fields.
        extensions: What is said of laws that load steps needed further.
    """

    further_fields: list[Callable[[LoadStep], Any]] = field(default_factory=list, init=False)
    extensions: list[str] = field(default_factory=list, init=False)

    @classmethod
    def from_scene(cls, source: Source) -> Self:
        """Make the coupling of a scene on one process; see `Coupling.from_scene`."""
        began, scene, (body, counter) = time.perf_counter(), source.scene, source.facts
        traits = traits_of(scene)
        check_memory(source.nodes, traits.requests(scene))
        if body is None:
            sample = sample_surface(scene, scene.surface, "surface")
            body = BodyFacts.of_block(scene, sample, traits.unstated_cells(scene))
        samples = region_samples(scene, body.materials, second_material(scene, counter))
        surface, materials = samples[0].surfaces[0], samples[0].materials
        surfaces = tuple(one for region in samples for one in region.surfaces)
        (path, zero), plane = path_on(scene, surfaces, body.area), None
        check_load(scene, path, zero, surfaces, body.area, body)
        stated = source.micro_model(surface, materials)
        assert isinstance(stated, HalfSpaceModel), "scenes of summits are refused"
        model = replace(stated, periodic=True)
        if path.quantity != "force":
            mean = model.reference_height - surface.mean_height
            plane = RigidPlane.above(surface, min(path.largest(), mean))
        whole = PatchGrid(grid=(1, 1), lengths=surface.lengths)
        parts = SceneParts(
            scene=scene,
            surface=surface,
            patches=whole,
            mean_heights=patch_means(surface, whole),
            materials=materials,
            body=body,
            counter=counter,
            path=path,
            zero=zero,
            seconds={"surface": time.perf_counter() - began},
            samples=samples,
            micro=model,
            finite_slopes=bool(scene.micro.finite_slopes),
            plane_at_largest_load=plane,
        )
        return cls(parts)

    @property
    def about(self) -> About:
        """What is said of the coupling and of its load steps."""
        return AboutSamples(self)

    def attach(self, comm: Any, meshes: Meshes) -> None:
        """Put the coupling on its bodies, whose contact faces must have a part in common."""
        super().attach(comm, meshes)
        if meshes[1] is not None:
            face: Any = self.bodies.contact_face()
            with located(self.scene, "counter_body.contact"):
                face.check_common()

    # --- errors

    def measured_errors(
        self, step: LoadStep, past: Sequence[LoadStep] = (), *, normal: bool = True
    ) -> dict[str, Any]:
        """Measure the errors of a load step, by further steps on the same bodies."""
        model = self.model
        assert isinstance(model, ExtendedFaceContact)
        problem, state = model.solved
        known: dict[str, Any] = {
            "problem": problem,
            "face": model.face,
            "state": state,
            "problem_with": self._problem,
            "table": model.table,
            "samples": self.parts.samples,
            "cells": self._cells,
            "comm": self.comm,
        }
        probe = LawErrorProbe(**known)
        if self.scene.friction is not None:
            from patchlaw.multiscale.measured_errors.shear_of_samples import (
                LawShearProbe,  # others do without
            )

            before = (model.past_before or model.past).with_ranks(model.face.comm)
            probe = LawShearProbe(**known, step=step, before=before)
        return error_columns(step, probe.measure())

    # --- laws and load steps

    def _make_table(self, observe: Observer | None, before: LawTable | None = None) -> LawTable:
        """Tabulate the laws, or extend earlier ones as far as the material allows.

        Args:
            observe: Told of rows as they are made.
            before: Laws that end too early; where they end as far as possible they come back.
        """
        regions = self.parts.samples
        # near the hardness nearly all cells bear it, and at it there is no function of closure
        most = [math.inf if one.hardness is None else 0.95 * one.hardness for one in regions]
        if before is None or not (reached := before.largest_pressure):
            pressure, closure = self._largest_loads()
        else:
            pressure, closure = 2.0 * reached, None
            most = [
                min(end, one.materials.contact_modulus)
                for end, one in zip(most, regions, strict=True)
            ]
        made_of = zip(self.parts.rough_surfaces, chain(*self.periodic_models), strict=True)
        models = {id(sample): model for sample, model in made_of}
        made = representative_laws(
            {region.name: region.surfaces for region in regions},
            self.parts.materials.contact_modulus,
            largest_pressure=[min(pressure, end) for end in most],
            largest_closure=closure,
            tolerance=self.table_tolerance,
            most_rows=MOST_ROWS,
            make_model=lambda sample: models[id(sample)],
            before=before,
            leak=self.scene.leak is not None,
            comm=self.comm,
            observe=observe,
        )
        # in full contact the last rows alone go on
        ended = before is not None and not made.largest_pressure > before.largest_pressure
        return before if before is not None and ended else made

    @property
    def _cells(self) -> SampleCells:
        """The contact problems on the cells of the samples."""
        block, model = self.scene.block, self.parts.micro
        assert isinstance(model, HalfSpaceModel)
        return SampleCells(
            model=model,
            finite_slopes=self.parts.finite_slopes,
            has_edges=block is None or block.sides != "roller",  # mirrors are no edges
        )

    @property
    def periodic_models(self) -> list[list[HalfSpaceModel]]:
        """The periodic models of all samples of every region."""
        make, regions = self._cells.model_of, self.parts.samples
        return [[make(region, one) for one in region.surfaces] for region in regions]

    def _stiffness_ratios(self) -> list[float]:
        return [region.materials.stiffness_ratio for region in self.parts.samples]

    def _largest_loads(self) -> tuple[float, float | None]:
        """Return the largest local pressure that laws are made for [MPa], and closure [mm].

        The closure is None where only a force, or other loads of the body, would tell it.

        Note:
            Collective.
        """
        stated, parts = self.scene.law.largest_pressure, self.parts
        path, face = parts.path, parts.body
        if path.quantity == "force":
            force = path.largest()
            mean = force / face.area
            return stated or self._peak(mean, force=force), None
        tilt, lengths = path.tilt or (0.0, 0.0), face.lengths
        raised = self.bodies.largest_preload() if self.scene.loads_bodies else 0.0
        approach = path.largest() + 0.5 * float(np.abs(np.multiply(lengths, tilt)).sum()) + raised
        mean = approach / self.bodies.mean_compliance()
        pressure = stated or self._peak(mean, approach=approach)
        return pressure, None if self.scene.loads_bodies else 1.15 * approach

    def _peak(self, mean: float, *, force: float = 0.0, approach: float = 0.0) -> float:
        """Return the largest local pressure that laws are made for [MPa].

        It is ten times the mean pressure on the face, or twice the largest pressure of the smooth
        crowned bodies, which roughness lowers.
        """
        radii = [one for one in self.scene.law.crown or () if one != "inf"]
        if not radii:
            return 10.0 * mean
        modulus, length = self.parts.materials.contact_modulus, min(self.parts.body.lengths)
        peak = crowned_peak(radii, modulus, length, force=force, approach=approach)
        return max(10.0 * mean, 2.0 * peak)

    def _make_model(self) -> Model:
        table, face = self.make_laws(), self.bodies.contact_face()
        made = ExtendedFaceContact(partial(self._problem, face), table, face, self._longer)
        made.further_fields = self.further_fields
        return made

    def _problem(self, face: LoadedFace | FacePair, table: LawTable) -> LawContactProblem:
        """Return a face with laws at its points."""
        from patchlaw.macro import LawContactProblem

        return LawContactProblem(
            face,
            table.together(),
            mode="pointwise",
            crown=crown_depth(self.scene, self.parts.body.lengths),
            friction=[Friction(coefficient=one) for one in self.scene.coefficients] or None,
        )

    def _longer(self, table: LawTable) -> LawTable | None:
        """Return the laws extended; None where they end as far as possible."""
        longer = self._make_table(None, before=table)
        if longer is table:
            return None
        self.table = longer = longer.with_stiffness_ratios(self._stiffness_ratios())
        self.extensions.append(
            f"the laws were extended to {number(longer.largest_pressure)} MPa, which a load step "
            "needed"
        )
        return longer


class AboutSamples(About):
    """Statements on laws of samples."""

    @property
    def label(self) -> str:
        """The heights of the samples, and the elements of the bodies."""
        parts = self.parts
        bodies = ", ".join(
            f"{('linear', 'quadratic')[body.degree - 1]} elements on {body.cells}"
            for body in parts.shown_bodies
        )
        slopes = " with finite slopes" * parts.finite_slopes
        return f"laws of samples on {times(parts.surface.grid)} heights{slopes}, {bodies}"

    def describe(self) -> dict[str, str]:
        """Return what will be done and why, and what the laws are made from."""
        made_from = "; ".join(map(describe.samples, self.parts.samples))
        text = f"representative: {made_from}; the law holds at every point of the face"
        return super().describe() | {"coupling": text, "body": describe.body(self.parts)}

    @property
    def error_causes(self) -> str:
        """The causes of errors that a run measures."""
        shear = "; those of the shear as well" * (self.scene.friction is not None)
        return f"{', '.join(causes_of(self.parts.samples))}{shear}"

    def _of_bodies(self) -> Iterator[str]:
        """Yield what is doubtful of the bodies, and whether samples can stand for the face."""
        yield from super()._of_bodies()
        yield from validity.of_samples(self.parts.samples, self.parts.body.area)

    @property
    def contact_memory(self) -> float:
        """Memory of the contact problem of a sample [B]."""
        return CELL_OF_CONTACT * self.parts.surface.heights.size

    def memory_requests(self) -> Iterator[MemoryRequest]:
        """Yield what a run needs memory for, that of measured errors included."""
        yield from super().memory_requests()
        if not self.unmeasured():
            parts = self.parts
            yield from check_requests({"body": parts.body, "counter_body": parts.counter})

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the approximations behind load steps."""
        yield from super().notes(steps)
        yield from self.coupling.extensions

    def error_notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what measured errors leave out."""
        measured = [step for step in steps if step.errors]
        if measured:
            yield from omission_notes(self.parts.samples, measured[-1])
