"""The coupling with laws of periodic samples at the points of a contact face.

Theory: docs/theory.md, sections 10 and 11.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from patchlaw.geometry import Control, Friction, Surface, roughness
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.closed_forms import crowned_peak
from patchlaw.micro.half_space.error_probe import coarser
from patchlaw.micro.wear import slide
from patchlaw.multiscale.bodies.bodies import free_bodies
from patchlaw.multiscale.bodies.reader import Meshes
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.of_samples import representative_laws
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.laws.refinement import MOST_ROWS
from patchlaw.multiscale.laws.worn_laws import WornLaws
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.machine import MemoryRequest
from patchlaw.multiscale.models import describe
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.models.face_contact import FaceContact
from patchlaw.multiscale.models.measured_errors.errors import WearErrors, error_columns
from patchlaw.multiscale.models.measured_errors.faces import (
    LawErrorProbe,
    causes_of,
    check_requests,
    omission_notes,
)
from patchlaw.multiscale.models.measured_errors.samples import SampleCells
from patchlaw.multiscale.models.problem import Model
from patchlaw.multiscale.scene.parts import SceneParts
from patchlaw.multiscale.scene.surfaces import RegionSamples, crown_depth
from patchlaw.support import Array, located, shared
from patchlaw.support.readable import ProgressObserver, times, unobserved

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro import FacePair, LawContactProblem, LoadedFace

T = TypeVar("T")
_FIRST_DEPTH, _RUN_IN = 4e-3, 0.97
"""First depth that laws of worn samples are made for, over the rms height, and contact area
fraction at which a sample has run in."""


class RepresentativeCoupling(Coupling):
    """Laws of samples on the contact face of a body; they are extended where a step needs it.

    Attributes:
        further_fields: Make functions on the mesh that are written with the other fields.
        extensions: What is said of laws that load steps needed further.
    """

    def __init__(self, parts: SceneParts, comm: Any, meshes: Meshes) -> None:
        super().__init__(parts, comm, meshes)
        self.further_fields: list[Callable[[LoadStep], Any]] = []
        self._elsewhere: dict[str, tuple[Any, Any, Any]] = {}
        if meshes[1] is not None:
            face: Any = self.bodies.contact_face
            with located(self.scene.file, "counter_body.contact"):
                face.check_common()

    # --- what is said of it

    @property
    def label(self) -> str:
        """The coupling, and the samples and meshes that it works on, in few words."""
        parts = self.parts
        bodies = ", ".join(
            f"{('linear', 'quadratic')[body.degree - 1]} elements on {body.cells}"
            for body in parts.shown_bodies
        )
        slopes = " with finite slopes" * parts.finite_slopes
        return f"laws of samples on {times(parts.surface.grid)} heights{slopes}, {bodies}"

    @property
    def statement(self) -> str:
        """What the coupling is, in a sentence."""
        made_from = "; ".join(map(describe.samples, self.parts.samples))
        return f"representative: {made_from}; the law holds at every point of the face"

    @property
    def causes(self) -> str:
        """Causes of the errors that are measured, in words."""
        return ", ".join(causes_of(self.parts.samples)) + ", wear" * (self.scene.wear is not None)

    @property
    def unmeasured(self) -> str:
        """Why errors cannot be measured; they always can."""
        return ""

    def error_notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what the measured errors leave out."""
        measured = [step for step in steps if step.errors]
        if measured:
            yield from omission_notes(self.parts.samples, measured[-1])

    def further_requests(self) -> Iterator[MemoryRequest]:
        """Yield what measuring errors needs memory for."""
        if not self.about.unmeasured():
            bodies = {"body": self.parts.body, "counter_body": self.parts.counter}
            yield from check_requests(bodies, rubs=self.scene.rubs_on_mesh)

    # --- errors

    def measured_errors(
        self, step: LoadStep, past: Sequence[LoadStep] = (), *, normal: bool = True
    ) -> dict[str, Any]:
        """Measure the errors of a load step, by further steps on the same bodies."""
        model = self.model
        assert isinstance(model, FaceContact)
        problem, state = model.solved
        stiffness = step.interface_stiffness_N_per_mm or model.stiffness().interface
        known: dict[str, Any] = {
            "problem": problem,
            "face": model.face,
            "state": state,
            "problem_with": self._problem,
            "table": model.table,
            "samples": self.parts.samples,
            "cells": self._cells,
            "step": replace(step, interface_stiffness_N_per_mm=stiffness),
            "new_laws": model.table.laws,
            "zero": self.parts.zero_error,
            "elsewhere": self._elsewhere,
            "told": self.told,
            "worn": model.wears,
            "tell": self.clock.tell,
            "comm": self.comm,
        }
        if model.wears:
            known |= self._as_worn(model)
        if self.scene.rubs_on_mesh:
            from patchlaw.multiscale.models.measured_errors.shear_of_samples import (
                LawShearProbe,  # others do without
            )

            before = (model.slips_before or model.slips).with_ranks(model.face.comm)
            probe: LawErrorProbe = LawShearProbe(**known, before=before)
        else:
            probe = LawErrorProbe(**known)
        found = probe.measure()
        if model.wears:
            apart = {"points": model.worn_depth_between}
            if self.scene.rubs_on_mesh:
                return error_columns(step, found.with_fretting(step, apart))
            zones, one_law = model.wear_by_zones, len(model.table.laws) == 1
            of_wear = WearErrors(model.wear_errors, apart, zones, one_law)
            found = found.with_wear(step, past, of_wear)
        return error_columns(step, found)

    def _as_worn(self, model: FaceContact) -> dict[str, Any]:
        """Return laws, samples and problems of a worn face, by names that `LawErrorProbe` has."""
        table, (problem, state) = model.table, model.solved
        areas = np.where(model.face.areas > 0.0, model.face.areas, 1.0)
        nearest = table.nearest_levels(problem.sampling.patch_sums(state.sample_worn_depth) / areas)
        found: dict[str, Any] = {
            "problem_with": partial(_worn_problem, self._problem, table, problem),
            "table": table.at_levels(nearest),
        }
        if nearest.any():
            levels = [self.parts.samples, *(level for _, level, _ in self.worn_samples)]
            samples = tuple(levels[level][one] for one, level in enumerate(nearest))
            found |= {"samples": samples, "coarser": self._worn_on_fewer}
        return found

    def release(self) -> None:
        """Free the bodies, and others that told their errors."""
        faces = [face for face, *_ in self._elsewhere.values() if face is not None]
        others = [side.body for face in faces for side in face.sides]
        self._elsewhere.clear()
        faces.clear()
        free_bodies(others)
        super().release()

    # --- laws and load steps

    def _make_table(
        self, observe: ProgressObserver = unobserved, before: LawTable | None = None
    ) -> LawTable:
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

        options = {"largest_pressure": [min(pressure, end) for end in most], "observe": observe}
        made = self._laws_of(regions, largest_closure=closure, before=before, **options)
        # in full contact the last rows alone go on
        if before is not None and not any(
            _last(law) > _last(old) for law, old in zip(made.laws, before.laws, strict=True)
        ):
            return before
        highest = max(law.initial_separation for law in made.laws)
        worn, error = [], made.force_error
        for depth, samples, yielded in self.worn_samples:
            table = self._laws_of(samples, **options)
            lower = highest - max(law.initial_separation for law in table.laws) + yielded
            pairs = zip(table.laws, lower, strict=True)
            laws = tuple(law.shifted(distance) for law, distance in pairs)
            worn.append(WornLaws(depth=np.full(len(laws), depth), laws=laws))
            error = max(error, table.force_error)
        return replace(made, worn=tuple(worn), force_error=error)

    def _laws_of(self, samples: Sequence[RegionSamples], **options: Any) -> LawTable:
        """Tabulate the laws of samples; see `representative_laws`, which options are of."""
        models = {
            id(one): self._cells.model_of(region, one)
            for region in samples
            for one in region.surfaces
        }
        return representative_laws(
            {region.name: region.surfaces for region in samples},
            self.parts.materials.contact_modulus,
            tolerance=self.table_tolerance,
            most_rows=MOST_ROWS,
            make_model=lambda sample: models[id(sample)],
            leak=self.scene.leak is not None,
            comm=self.comm,
            **options,
        )

    @cached_property
    def worn_samples(self) -> list[tuple[float, tuple[RegionSamples, ...], Array]]:
        """The samples as they run in under the mean pressure, with the depths that wore off [mm].

        With the samples of every depth stands the mean plastic depth of every region, shape (N,)
        [mm], by which their heights are lower, too. Depths are doubled until nearly all of a sample
        is in contact, or more has worn off than load steps slide for under twice the mean pressure.

        Note:
            Collective.
        """
        wear, parts = self.law_wear, self.parts
        slid = max((step.slid for step in parts.path), default=0.0)
        if self.scene.rubs_on_mesh:
            slid = _slipped(parts.path)
        if wear is None or not slid:
            return []
        rough, levels = parts.rough_surfaces, list[tuple[float, Any, Array]]()
        most = 2.0 * self._mean_pressure() * slid * float(wear.max())
        for depth, contacts in self._running_in(list(chain(*self.periodic_models))):
            starts = [contact.start for contact in contacts]
            surfaces = self._by_region(
                replace(one, heights=one.heights - start.lowered)
                for one, start in zip(rough, starts, strict=True)
            )
            plastic = self._by_region(
                0.0 if one.plastic_depth is None else float(one.plastic_depth.mean())
                for one in starts
            )
            samples = tuple(
                replace(one, surfaces=tuple(some))
                for one, some in zip(parts.samples, surfaces, strict=True)
            )
            yielded = [
                np.average(depths, weights=[surface.area for surface in one.surfaces])
                for one, depths in zip(parts.samples, plastic, strict=True)
            ]
            levels.append((depth, samples, np.array(yielded)))
            least = min(contact.contact_area_fraction for contact in contacts)
            if depth >= most or least > _RUN_IN:
                break
        return levels

    def _running_in(self, models: Sequence[HalfSpaceModel]) -> Iterator[tuple[float, list[Any]]]:
        """Yield depths [mm], each twice the one before, and samples worn by them; collective.

        They wear under the mean pressure; with the depths come their `ContactState`.

        Args:
            models: Models of the samples.
        """
        pressure, contacts, before = self._mean_pressure(), list[Any](), 0.0
        depth = _FIRST_DEPTH * max(roughness(one).sq for one in self.parts.rough_surfaces)

        def worn(number: int) -> Any:
            model = models[number]
            control = Control(force=pressure * model.surface.area)
            start = (contacts[number] if contacts else model.press(control)).start
            return slide(model, control, start, (depth - before) / pressure).state

        while True:
            contacts = shared(self.comm, len(models), worn)
            yield depth, contacts
            before, depth = depth, 2.0 * depth

    def _by_region(self, each: Iterable[T]) -> list[list[T]]:
        """Return what there is of every sample in one list for every region."""
        left = iter(each)
        return [list(islice(left, len(one.surfaces))) for one in self.parts.samples]

    @cached_property
    def _worn_on_fewer(self) -> dict[int, list[Surface]]:
        """Samples that wore on half and on a quarter of the cells a side, by ids of worn samples.

        Note:
            Collective.
        """
        found: dict[int, list[Surface]] = {}
        for some in (2, 4):
            models = [
                probe.on_body(probe.model.resampled(coarser(one, some)), probe.order)
                for region in self.parts.samples
                for one in region.surfaces
                for probe in [self._cells.probe_of(region, one)]
            ]
            levels = zip(self.worn_samples, self._running_in(models), strict=False)
            for (_, samples, _), (_, contacts) in levels:
                worn = chain(*(one.surfaces for one in samples))
                for one, model, contact in zip(worn, models, contacts, strict=True):
                    heights = model.surface.heights - contact.start.lowered
                    lower = replace(model.surface, heights=heights)
                    found.setdefault(id(one), []).append(lower)
        return found

    @cached_property
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

    @property
    def law_wear(self) -> Array | None:
        """Depths that wear off per distance slid and pressure, of every region."""
        section = self.scene.wear
        if section is None:
            return None
        regions = [one.wear for one in self.scene.law.regions]
        each = [section.coefficient if one is None else one for one in (None, *regions)]
        return np.array(each)

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
        approach = self._largest_approach()
        mean = approach / self.bodies.mean_compliance()
        pressure = stated or self._peak(mean, approach=approach)
        return pressure, None if self.scene.loads_bodies else 1.15 * approach

    def _largest_approach(self) -> float:
        """Return the largest approach to any point of the face that is prescribed [mm]."""
        path, lengths = self.parts.path, self.parts.body.lengths
        raised = self.bodies.largest_preload() if self.scene.loads_bodies else 0.0
        tilted = 0.5 * float(np.abs(np.multiply(lengths, path.tilt or (0.0, 0.0))).sum())
        return path.largest() + tilted + raised

    def _mean_pressure(self) -> float:
        """Return the mean pressure at the largest load, roughly where that is no force [MPa]."""
        if self.parts.path.quantity == "force":
            return self.parts.path.largest() / self.parts.body.area
        return 0.1 * self._largest_approach() / self.bodies.mean_compliance()

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
        table, face = self.make_laws(), self.bodies.contact_face
        if self.law_wear is not None and not table.worn:  # kept laws are those of new surfaces
            new = self._make_table()
            table = self.table = new.with_stiffness_ratios(self._stiffness_ratios())
        problem = self._problem(face, table)
        made = FaceContact(problem, table, face, self.law_wear, self._longer)
        made.further_fields = self.further_fields
        if self.scene.loading.slides and self.scene.friction is not None:
            made.rubs = np.array(self.scene.coefficients)
        return made

    def _problem(self, face: LoadedFace | FacePair, table: LawTable) -> LawContactProblem:
        """Return a face with laws at its points."""
        from patchlaw.macro import LawContactProblem

        coefficients = self.scene.coefficients if self.scene.rubs_on_mesh else []
        return LawContactProblem(
            face,
            table.running_in or table.together(),
            mode="pointwise",
            crown=crown_depth(self.scene, self.parts.body.lengths),
            friction=[Friction(coefficient=one) for one in coefficients] or None,
        )


def _last(law: PatchLaw) -> float:
    """Return the pressure that a law ends at [MPa]."""
    return float(law.rows.pressure.max(initial=0.0))


def _slipped(path: Iterable[Any]) -> float:
    """Return how far faces slip at most; infinite where shifts follow from shear forces [mm]."""
    shears = [one.shear for one in path if one.shear is not None]
    if any(one.shift is None for one in shears):
        return math.inf
    shifts = np.array([(0.0, 0.0), *(one.shift for one in shears)], float)
    return float(np.hypot(*np.diff(shifts, axis=0).T).sum())


def _worn_problem(
    problem_on: Callable[[Any, LawTable], LawContactProblem],
    table: LawTable,
    worn: LawContactProblem,
    face: Any,
    _: LawTable,
) -> LawContactProblem:
    """Return the problem on another face of the same bodies, which has worn as deep.

    Depths are linear between the samples of the first one.

    Args:
        problem_on: Returns a problem that has not worn.
        table: The laws.
        worn: The problem that has.
        face: The other face.
    """
    from scipy.interpolate import griddata  # others do without

    made, record = problem_on(face, table), worn.forces.record_of_wear
    places = made.sampling.places
    depth = griddata(record[:, :2], record[:, 2], places)
    outside = np.isnan(depth)  # of the hull of the first samples
    depth[outside] = griddata(record[:, :2], record[:, 2], places[outside], method="nearest")
    made.forces.worn = depth
    return made
