"""Errors of load steps under laws of samples, by cause, measured in the run.

Each cause is varied while all others stay, under the plane of the load step: elements of the body
to first order from the known solution where they are linear, by another one where they are
quadratic; the laws by what they err at the pressures of the step, and the quadrature by their
pressures at more points. One linear solution tells what these change, to first order: the response
of the contact to the approach, which tells the error of the approach, too.

Errors of elements are set in proportion to the change of the force from linear to quadratic ones.
The factors were set before they were tried, on bodies drawn at random, against meshes refined twice
(docs/accuracy.md).

The cells and the finite slopes of samples are judged as those of any contact problem, by `contact`
beside this module, at the mean closure of every region. The scatter among samples gives the error
of their mean that is not exceeded in 19 of 20 sets of as many samples, by Student's t.

Theory: docs/theory.md, section 13.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from patchlaw.geometry import Control, Surface
from patchlaw.geometry.contact_state import ContactState
from patchlaw.geometry.sliders import MOST_REMEMBERED
from patchlaw.micro import FiniteSlopes, FrictionModel, HalfSpaceModel
from patchlaw.multiscale.bodies.bodies import SLOPES, free_bodies, on_body
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.laws.refinement import LEAST_LOAD
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.machine import MemoryRequest
from patchlaw.multiscale.models.measured_errors.contact import ErrorProbe, error_by_cells, read
from patchlaw.multiscale.models.measured_errors.edges import edge_width
from patchlaw.multiscale.models.measured_errors.errors import ZERO, MeasuredErrors, stated
from patchlaw.multiscale.readable import WHOLE, Caution, ProgressObserver, unobserved
from patchlaw.multiscale.scene.memory import body_request
from patchlaw.multiscale.scene.parts import BodyFacts
from patchlaw.multiscale.scene.surfaces import RegionSamples
from patchlaw.support import Array, Indices, NotConverged, shared

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro import FaceEquilibrium, FacePair, LawContactProblem, LoadedFace
    from patchlaw.macro.contact.law_problem import ApproachResponse

CAUSES = "mesh", "quadrature", "laws", "samples", "grid", "slopes", "edges", ZERO
"""The causes, in their order."""
MOST_CHECKED_UNKNOWNS = 400_000
"""Unknowns of the same mesh with quadratic elements at most. Beyond, the error of linear elements
is measured for a block alone, by half of its cells along every side; that of modes is not told."""
OF_LINEAR, OF_QUADRATIC, OF_HALF, OF_REFINED = 1.3, 0.3, 1.0, 1.5
_OF_BEYOND = 1.5
"""Errors of linear and of quadratic elements over the change of the force from one to the other, of
linear ones over the change from half as many cells along every side, and of quadratic ones over the
change by cutting cells into eight: 1.25 to 1.62 on 40 bodies drawn at random. The last is of linear
ones over what displacements change that only quadratic ones have, 0.7 to 1 of the whole."""
_BY_CREASES, _MOST_KEPT_UNKNOWNS = 3e-3, 20_000
"""Errors up to here, relative to the answer, are measured on cells cut into eight, too, where these
have so many unknowns at most; other elements with so many are kept for later load steps. Creases between the facets of a faceted side disturb a uniform stress
by 1e-4 to 1e-3 in places that no degree of elements resolves on the same mesh."""
_SHARE = 0.975
"""Share of sets of samples whose mean lies less than the stated error too low, or too high."""
_KNOWN = 13
"""Numbers that a sample on its cells tells: two errors of the force, the width at edges, the force;
errors of what is read off by cells and by slopes, three each; what is read off under the mean
pressure. Of gaps they are over that of the law."""
_ROUNDED = 1.2
"""Ratio of pressures that samples are solved under: their errors, relative to the pressure and to
what is read off, hardly change from one to the next."""
PLACES = 401
"""Places on a law that its closure or stiffness at a pressure is read off between."""
_TOLD = 0.57
"""Memory of the products that tell the error of linear elements over that of a solve: 1230 of 2150
B an unknown of a cube of 73,167 (Q2), 740 of 1610 of 151,959 (P2)."""
_MOVED = 2.0
"""Errors of area, gap and stiffness under the force over that of the force at the approach,
relative, where elements and points move pressures about: up to 1.6 on a tilted slab of four
elements, and up to 1.7 on four bodies drawn at random of cells of 1.5 times their usual length,
where they were 0.9 to 2.5 at the approach."""
_LEAST_SEPARATION = 1e-3
"""Separation at which samples near full contact are judged, over that at zero closure."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampleCells:
    """Half-space models of samples, and what else is solved on their cells.

    Args:
        model: The periodic half-space of one of the samples.
        finite_slopes: Whether finite slopes of the samples count.
        has_edges: Whether the contact face ends at free edges.

    Attributes:
        told: What the samples of a region tell, and their areas, by their law and its closure.
        ends: By what tells cells from others, the last two ends of paths in shear that were gone on
            them, each with the way to it.
    """

    model: HalfSpaceModel
    finite_slopes: bool
    has_edges: bool
    told: dict[Hashable, tuple[Array, Array]] = field(default_factory=dict, init=False)
    ends: dict[Hashable, list[tuple[list[Control], Any]]] = field(default_factory=dict, init=False)

    def model_of(self, region: RegionSamples, sample: Surface) -> HalfSpaceModel:
        """Return the periodic model of a sample, with the slopes of its bodies where they count.

        Args:
            region: The samples of its region.
            sample: The sample.
        """
        model = self._flat_model(region, sample)
        if not self.finite_slopes:
            return model
        sides = region.sides_of(sample)
        return replace(model, slopes=tuple(FiniteSlopes(*one, periodic=True) for one in sides))

    def _flat_model(self, region: RegionSamples, sample: Surface) -> HalfSpaceModel:
        modulus = region.materials.contact_modulus
        model = replace(self.model, surface=sample, contact_modulus=modulus)
        return replace(model, hardness=region.hardness)

    def friction_of(self, region: RegionSamples, sample: Surface) -> FrictionModel:
        """Return the friction of a sample's cells, whose pressures and tractions see each other.

        Args:
            region: The samples of its region.
            sample: The sample.
        """
        return FrictionModel(
            materials=region.materials,
            coefficient=region.coefficient,
            spacing=sample.spacing,
            periodic=True,
            coupled=True,
        )

    def probe_of(self, region: RegionSamples, sample: Surface) -> ErrorProbe:
        """Return what measures the errors of a contact of one sample.

        Args:
            region: The samples of its region.
            sample: The sample.
        """
        return ErrorProbe(
            model=self._flat_model(region, sample),
            on_body=on_body(None, region.materials, region.above_of(sample)),
            order=SLOPES if self.finite_slopes else 0,
        )

    def edge_width_of(self, region: RegionSamples, sample: Surface, pressure: float) -> float:
        """Return the width along the edges of the face that the law of a sample errs by [mm].

        Args:
            region: The samples of its region.
            sample: The sample.
            pressure: Mean pressure [MPa].
        """
        if not self.has_edges:
            return 0.0
        try:
            return edge_width(self._flat_model(region, sample), pressure, region.materials.first)
        except NotConverged:
            return math.inf


@dataclass(frozen=True, kw_only=True, eq=False)
class LawErrorProbe:
    """Measures the errors of the latest load step on a face with laws of samples.

    Args:
        problem: The body with the laws on its contact face, at the load step.
        face: The contact face.
        state: The contact there.
        problem_with: Returns the problem on a face of the same bodies, with laws.
        table: The laws of the regions.
        samples: Their samples.
        cells: The contact problems on the cells of these.
        step: The load step.
        worn: Whether laws and samples are those of depths near to what has worn off.
        new_laws: The laws of the samples before they wore; of new samples those of `table`.
        tell: Told how many of the samples are done, in percent.
        zero: Error of the height that approaches count from [mm].
        coarser: By the id of a worn sample those that wore on half and on a quarter of its cells.
        elsewhere: By name other faces of small bodies, each with laws and the problem there.
        comm: MPI communicator; None for this process alone.
    """

    problem: LawContactProblem
    face: LoadedFace | FacePair
    state: FaceEquilibrium
    problem_with: Callable[[Any, LawTable], LawContactProblem]
    table: LawTable
    samples: Sequence[RegionSamples]
    cells: SampleCells
    step: LoadStep
    worn: bool = False
    new_laws: Sequence[PatchLaw]
    tell: ProgressObserver = unobserved
    zero: float = 0.0
    coarser: Mapping[int, Sequence[Surface]] = field(default_factory=dict)
    elsewhere: dict[str, tuple[Any, Any, Any]] = field(default_factory=dict)
    comm: Any = None
    _of_regions: dict[str, Array] = field(default_factory=dict, init=False)

    @cached_property
    def control(self) -> Control:
        """What prescribes the plane of the load step, by its approach."""
        return self.problem.same_approach()

    def measure(self) -> MeasuredErrors:
        """Measure the errors of the force at the approach.

        A plane that is free to turn does so in every comparison.

        Raises:
            NotConverged: When one of the contact problems cannot be solved.

        Note:
            Collective.
        """
        if not self.state.force:
            errors = dict.fromkeys(self.causes, np.zeros(4))
            force = 0.0 if self.problem.sliders else float(self._by_zero()[0])
            if force:  # how far it would touch is not known
                errors[ZERO] = np.array([force, math.inf, self.zero, math.inf])
            return MeasuredErrors(by_cause=errors, stiffness=0.0, zero=self.zero)
        return self.of_force(self.answer_errors(), self.pressure_errors())

    def of_force(self, answer: dict[str, Array], pressure: dict[str, Array]) -> MeasuredErrors:
        """Return the errors of the force at the approach.

        Args:
            answer: What `answer_errors` returns.
            pressure: What `pressure_errors` returns.

        Note:
            Collective.
        """
        parts = {cause: float(error[0]) for cause, error in answer.items()} | {
            cause: float(self.response.force_changes(error).sum())
            for cause, error in pressure.items()
        }
        step, force = self.step, self.state.force
        # where elements and points change pressures, areas and stiffnesses change as these
        others = {cause: _MOVED * self._going_with(parts[cause] / force) for cause in answer}
        others[ZERO] = np.zeros(3)
        if step.by_force:
            parts[ZERO] = self.response.stiffness * self.zero
        sums = self.response.sampling.patch_sums
        for cause, error in pressure.items():
            others[cause] = self._of_regions.get(cause, np.zeros(3))
            if cause in ("laws", "edges"):  # by the pressure, and what the gap closes by for it
                share = self._going_with(float(sums(error).sum()) / force)
                others[cause] = np.maximum(others[cause], share)
        if not step.by_force:  # besides, all go with the force
            others = {c: one + self._going_with(parts[c] / force) for c, one in others.items()}
        sizes = [step.contact_area_fraction, 1.0, 1.0]
        return MeasuredErrors(
            by_cause={c: np.append(parts[c], others[c] * sizes) for c in self.causes},
            stiffness=self.response.stiffness,
            zero=self.zero,
        )

    @cached_property
    def _gaps_by(self) -> float:
        """Relative change of the force over that of the mean gap [1/mm]."""
        known = self.step.interface_stiffness_N_per_mm or self.response.stiffness
        return known / self.state.force

    def _going_with(self, share: float) -> Array:
        """Return what area, mean gap and stiffness err by where pressures do by a share, (3,).

        Near full contact the area hardly grows with the pressure, while gaps and stiffness where
        the face bears little change more than all of it together.
        """
        errors = np.array([share, share / self._gaps_by, share])
        if not math.isfinite(share) or not share:
            return errors
        known, sizes = self._as_read, np.ones(3)
        moved = np.max([abs(self._read_off(by) - known) for by in (share, -share)], axis=0)
        sizes[::2] = known[::2]
        moved = np.divide(moved, sizes, out=errors.copy(), where=sizes > 0.0)
        return np.array([min(share, moved[0]), *np.maximum(errors, moved)[1:]])

    @cached_property
    def _as_read(self) -> Array:
        return self._read_off(0.0)

    def _read_off(self, share: float) -> Array:
        """Return area, gap [mm] and stiffness by the laws under pressures greater by a share.

        They are means over the face; collective.
        """
        sampling = self.response.sampling
        pressure = np.maximum(1.0 + share, 0.0) * self.state.sample_pressure
        closure, found = self._closures_under(pressure, sampling.patch), np.zeros((3, len(pressure)))
        for region, law in enumerate(self.table.laws):
            here = sampling.patch == region
            point = law.at(closure[here], extend=True)
            found[:, here] = point.contact_area_fraction, point.separation, point.stiffness
        whole = sampling.patch_sums(np.ones_like(pressure)).sum()
        return np.array([sampling.patch_sums(one).sum() for one in found]) / whole

    @property
    def causes(self) -> list[str]:
        """The causes, in their order."""
        return causes_of(self.samples)

    @cached_property
    def response(self) -> ApproachResponse:
        """What the approach changes in the contact; collective."""
        return self.problem.approach_response()

    def answer_errors(self) -> dict[str, Array]:
        """Return the errors of the answer by causes that are varied by solving again; collective.

        The first of an answer is the force at the approach.
        """
        found = dict(zip(("mesh", "quadrature"), self.discretisation(), strict=True))
        return found | {ZERO: self._by_zero()}

    def pressure_errors(self) -> dict[str, Array]:
        """Return by cause what the laws err by at this rank's samples, (n,) [MPa]; collective."""
        closure, patch = self.response.closure, self.response.sampling.patch
        pressure = self.state.sample_pressure
        if self.worn:  # the laws are those of the nearest depths: at equal pressures
            closure = self._closures_under(pressure, patch)

        def by_region(function: Callable[[PatchLaw, Array], Array]) -> Array:
            found = np.zeros_like(closure)
            for region, law in enumerate(self.table.laws):
                here = patch == region
                found[here] = function(law, closure[here])
            return found

        factors = np.array([mean_error(region.surfaces) for region in self.samples])
        sums = self.response.sampling.patch_sums
        forces = sums(pressure)

        def means(at: Array) -> Array:
            weighted = sums(pressure * at)
            return np.divide(weighted, forces, out=np.zeros_like(forces), where=forces > 0.0)

        (grid, slopes, widths), of_regions = self._of_samples(means(closure), forces, factors)
        self._of_regions.update(of_regions)
        # without load an unknown error is none
        return {
            "laws": by_region(interpolation_errors) * (pressure > 0.0),
            "samples": factors[patch] * by_region(lambda law, c: law.pressure_scatter(c)),
            "grid": np.where(pressure > 0.0, grid[patch], 0.0) * pressure,
            "slopes": np.where(pressure > 0.0, slopes[patch], 0.0) * pressure,
            "edges": self._at_edges(widths),
        }

    def _closures_under(self, pressure: Array, patch: Indices) -> Array:
        """Return the closures of the laws of regions under pressures, shape (n,) [mm]."""
        closure = np.zeros_like(pressure)
        for region, law in enumerate(self.table.laws):
            closures, here = np.linspace(*law.range, PLACES), patch == region
            closure[here] = np.interp(pressure[here], law.pressure(closures), closures)
        return closure

    def _at_edges(self, widths: Array) -> Array:
        """Return what strips along the edges of the face carry, at the samples next to them [MPa].

        Args:
            widths: Widths of the strips by region, shape (regions,) [mm].
        """
        from patchlaw.macro.contact.other_elements import free_edges, nearest_samples

        sampling, pressure = self.response.sampling, self.state.sample_pressure
        first = self.face.sides[0]
        edges = free_edges(first.body, first.facets)
        beside = nearest_samples(edges, sampling.x, sampling.y, self.face.comm)
        errors = np.zeros_like(pressure)
        for length, (samples, share) in zip(edges.length, beside, strict=True):
            at = samples[pressure[samples] > 0.0]
            carried = widths[sampling.patch[at]] * pressure[at] * length * share
            errors[at] += carried / sampling.weight[at]
        return errors

    # --- elements

    def discretisation(self) -> tuple[Array, Array]:
        """Return the errors of what `answer_on` returns by elements and by quadrature.

        The first are infinite where the elements are linear and quadratic ones too many.

        Note:
            Collective.
        """
        from patchlaw.macro.contact import other_elements as on

        own, known = on.bodies_of(self.face), self.answer
        points = known + self.by_points()
        mesh, quadratic, below = np.zeros_like(known), known, np.zeros_like(known)
        if any(body.degree == 2 for body in own):
            linear = partial(on.face_on, choose=lambda b: b.linear if b.degree == 2 else b)
            mesh += OF_QUADRATIC * np.abs(self._answer_of_kind("linear", linear) - known)
        if any(body.degree == 1 for body in own):
            error, quadratic = self._of_linear(points)
            mesh, below = mesh + error, np.abs(quadratic - points)
        if mesh[0] < _BY_CREASES * abs(known[0]) and 8 * self._most <= _MOST_KEPT_UNKNOWNS:
            # creases, by quadratic elements on cells cut into eight
            if (found := self._answer_of_kind("cut", on.refined_face, same=False)) is not None:
                mesh = np.maximum(mesh, below + OF_REFINED * np.abs(found - quadratic))
        return mesh, np.abs(points - known)

    @cached_property
    def _most(self) -> int:
        """Unknowns of the bodies with quadratic elements; collective."""
        from patchlaw.macro.contact import other_elements as on

        return sum(map(on.quadratic_dofs, on.bodies_of(self.face)))

    def _of_linear(self, points: Array) -> tuple[Array | float, Array]:
        """Return the errors of linear elements, infinite where they are not measured.

        Args:
            points: The answer on them with a finer quadrature.

        Returns:
            The errors, and the answer on the elements that told them.
        """
        from patchlaw.macro.contact import other_elements as on

        def raised(face: Any) -> Any:
            return on.face_on(face, lambda b: b.as_quadratic() if b.degree == 1 else b, True)

        if self._most <= MOST_CHECKED_UNKNOWNS:
            found = self._answer_of_kind("quadratic", raised)
            return _OF_BEYOND * np.abs(found - points), found
        found = self._answer_of_kind("half", on.face_on_half, same=False)
        if found is None:
            return math.inf, points
        return OF_HALF * np.abs(found - self.answer), found

    def _answer_of_kind(self, kind: str, make: Callable[[Any], Any], same: bool = True) -> Any:
        """Return the answer on another face, None where there is none; see `answer_on`."""
        with self._other(kind, make) as problem:
            return None if problem is None else self.answer_on(problem, same=same)

    @contextmanager
    def _other(self, kind: str, make: Callable[[Any], Any]) -> Iterator[Any]:
        """Lend the problem on another face; faces of small bodies are kept to the next load step.

        Args:
            kind: Name of the face.
            make: Makes it from that of the run; None where there is none.
        """
        from patchlaw.macro.contact import other_elements as on

        kept = self.elsewhere
        face, table, problem = kept.pop(kind, None) or (make(self.face), None, None)
        if face is not None and table is not self.table:
            problem = self.problem_with(face, self.table)
        yield problem
        own = on.bodies_of(self.face)
        if face is None or self._most <= _MOST_KEPT_UNKNOWNS:
            kept[kind] = face, self.table, problem
            return
        made = [body for body in on.bodies_of(face) if all(body is not one for one in own)]
        del face, problem
        free_bodies(made)

    def _by_zero(self) -> Array:
        """Return what the answer errs by as a held plane may be nearer by the error of the zero."""
        if self.step.by_force or not self.zero:
            return np.zeros_like(self.answer)
        with self._other("nearer", lambda face: face) as problem:
            return np.abs(self.answer_on(problem, nearer=self.zero) - self.answer)

    def by_points(self) -> Array:
        """Return what more quadrature points change in the answer, to first order."""
        return self._borne_on_finer() - self._borne(self.problem)

    def _borne_on_finer(self) -> Array:
        from patchlaw.macro.contact import other_elements as on

        with self._other("finer", lambda f: on.face_on(f, lambda body: body, finer=True)) as finer:
            return self._borne(finer)

    def _borne(self, problem: LawContactProblem) -> Array:
        """Return what a problem on the same elements bears; see `LawContactProblem.forces_at`."""
        return problem.forces_at(self.state, self.control.body_state, self.response)

    @property
    def answer(self) -> Array:
        """What discretisation may be off by: the force, shape (1,) [N]."""
        return np.array([self.state.force])

    def answer_on(
        self, problem: LawContactProblem, *, same: bool = True, nearer: float = 0.0
    ) -> Array:
        """Return the answer on another face, under the same plane.

        Args:
            problem: The problem there.
            same: Whether its meshes are the same. On more unknowns the answer is then that to first
                order.
            nearer: How much nearer the plane is [mm].
        """
        if self.begins_on(problem, same=same):
            step = self.control, self.problem, self.response
            return np.array([problem.first_order_force(*step)])
        return np.array([problem.solve(nearer_by(self.control, nearer)).force])

    def begins_on(self, problem: LawContactProblem, *, same: bool) -> bool:
        """Let a problem begin where the load step is; tell whether its end follows to first order.

        Args:
            problem: The problem.
            same: Whether its meshes are the same.
        """
        from patchlaw.macro.contact import other_elements as on

        if not same:
            problem.start_from(self.state.patch_pressure)
            return False
        state = self.control.body_state
        on.start_from_elements(problem, self.state, self.face, state)
        return bool(problem.face.body.dofs > self.face.body.dofs)

    # --- samples

    def _of_samples(
        self, closures: Array, forces: Array, factors: Array
    ) -> tuple[Array, dict[str, Array]]:
        """Return what samples on their cells err by.

        Args:
            closures: Mean closures of the regions, weighted by pressure, shape (regions,) [mm].
            forces: Forces on them [N].
            factors: Errors of means of samples over the scatter among them, shape (regions,).

        Returns:
            Relative errors of the force by cells and by finite slopes, and widths at edges, shape
            (3, regions); and by cause errors of area, mean gap and stiffness under the force, the
            first and last relative, shape (3,), weighted by forces.
        """
        sums, whole = np.zeros((4, len(self.samples))), float(forces.sum())
        of_regions = {cause: np.zeros(3) for cause in ("grid", "slopes", "samples")}
        laws, known = self.table.laws, self.cells.told
        places = [(law, _rounded(law, at)) for law, at in zip(laws, closures, strict=True)]
        unknown = [f > 0.0 and at not in known for f, at in zip(forces, places, strict=True)]
        tell = partial(self._told_by, closures=[closure for _, closure in places])
        for number, *told in self.of_regions("check of samples", tell, unknown):
            known[places[number]] = told
        for number in np.flatnonzero(forces > 0.0):
            own, areas = known[places[number]]
            sums[:, number] = own[:, :4].sum(axis=0)
            gap = _gap(laws[number], closures[number])
            part = forces[number] / whole * np.array([1.0, gap, 1.0])
            weights = own[:, 3] / (own[:, 3].sum() or 1.0)
            of_regions["grid"] += part * (weights @ own[:, 4:7])
            of_regions["slopes"] += part * (weights @ own[:, 7:10])
            of_regions["samples"] += part * factors[number] * _scatter(areas, own[:, 10:])
        means = np.divide(sums[:2], sums[3], out=np.zeros_like(sums[:2]), where=sums[3] > 0.0)
        return np.array([*means, sums[2]]), of_regions

    def of_regions(
        self, what: str, tell: Callable[[int, Surface], Array], some: Sequence[Any]
    ) -> Iterator[tuple[int, Array, Array]]:
        """Yield what is told of the samples of a region, and their areas [mm²]; collective.

        Args:
            what: Name of what is told, for whom follows the progress.
            tell: Tells it of one of the samples of a region, by the number of the region.
            some: Which regions it is told of.

        Returns:
            The numbers of these regions, what is told of each of their samples, and the areas.
        """
        samples = self.samples
        tasks = [(k, one) for k, of in enumerate(samples) if some[k] for one in of.surfaces]

        def observe(done: int) -> None:
            self.tell(what, WHOLE * done // max(len(tasks), 1), WHOLE)

        observe(0)
        found = shared(self.comm, len(tasks), lambda task: tell(*tasks[task]), observe=observe)
        for number in dict.fromkeys(number for number, _ in tasks):
            own = [one for (of, _), one in zip(tasks, found, strict=True) if of == number]
            areas = [sample.area for sample in samples[number].surfaces]
            yield number, np.array(own), np.array(areas)

    def _told_by(self, number: int, sample: Surface, closures: Sequence[float]) -> Array:
        """Return what a sample on its cells tells, shape (_KNOWN,).

        Args:
            number: Number of its region.
            sample: The sample.
            closures: Closures of the regions, shape (regions,) [mm].
        """
        region, law, closure = self.samples[number], self.table.laws[number], closures[number]
        sizes = np.array([1.0, _gap(law, closure), 1.0])
        probe, known = self.cells.probe_of(region, sample), np.zeros(_KNOWN)
        reference = probe.model.reference_height - sample.mean_height
        approach = reference - separation_of(law, float(closure), reference)
        model = probe.on_body(probe.model, probe.order)
        state, pressure = model.press(Control(approach=approach)), float(law.pressure(closure))
        if pressure and sample is region.surfaces[0]:  # the roughness of others ends alike
            known[2] = self.cells.edge_width_of(region, sample, pressure)
        if len(region.surfaces) > 1:
            mean = Control(force=pressure * sample.area)
            known[10:] = _read(model, model.press(mean, start=state.guess)) / sizes
        if not state.force:  # the closure is that of others of the samples
            return known
        area, _, stiffness = _read(model, state)
        if pressure and (others := self.coarser.get(id(sample))):
            probe = replace(probe, by_cells=self._by_cells(probe, others, law, float(closure)))
        errors = probe.measure(
            read(state),
            approach,
            (0.0, 0.0),
            start=state.guess,
            by_force=True,
            stiffnesses=(stiffness * sample.area, math.nan),
        ).by_cause
        known[3] = state.force
        for row, cause in enumerate(("grid", "slopes")):
            known[row], *others = errors[cause][:4]
            known[4 + 3 * row : 7 + 3 * row] = others / sizes / [area, 1.0, 1.0]
        return known

    def _by_cells(
        self, probe: ErrorProbe, others: Sequence[Surface], law: PatchLaw, closure: float
    ) -> Array:
        """Return errors by the cells of a worn sample, which wore on fewer cells once more.

        Near full contact its force is steep over the approach: all are those under its pressure.

        Args:
            probe: What has the model of the sample.
            others: The samples that wore on fewer cells.
            law: The law of the sample.
            closure: Its closure [mm].

        Returns:
            Errors of the force at the approach, contact area fraction and mean gap, shape (3,).
        """
        surface, found = probe.model.surface, []
        control = Control(force=float(law.pressure(closure)) * surface.area)
        for one in (surface, *others):
            model = replace(probe.model, surface=one, highest=probe.model.reference_height)
            state = probe.on_body(model, probe.order).press(control)
            found.append([state.approach, state.contact_area_fraction, state.mean_separation])
        nearer, area, gap = error_by_cells(*found)
        return np.array([nearer * float(law.stiffness(closure)) * surface.area, area, gap])


def nearer_by(control: Control, distance: float) -> Control:
    """Return a control whose plane is nearer, where its approach is held.

    Args:
        control: The control.
        distance: How much nearer it is [mm].
    """
    if control.approach is None:
        return control
    return replace(control, approach=control.approach + distance)


def _rounded(law: PatchLaw, closure: float) -> float:
    """Return the closure of a law at the nearest power of `_ROUNDED` to its pressure [mm]."""
    if not (pressure := float(law.pressure(closure))):
        return closure
    power = _ROUNDED ** round(math.log(pressure, _ROUNDED))
    closures = np.linspace(*law.range, PLACES)
    return float(np.interp(power, law.pressure(closures), closures))


def _gap(law: PatchLaw, closure: float) -> float:
    """Return the mean gap of a law at a closure, or the least one that samples are judged at."""
    point = law.at(closure, extend=True)
    return max(float(point.separation), _LEAST_SEPARATION * law.initial_separation)


def _read(model: HalfSpaceModel, state: ContactState) -> tuple[float, float, float]:
    """Return area fraction, mean gap [mm] and stiffness −dp/dū [MPa/mm] of a sample."""
    stiffness = model.stiffness(state, turns=False).interface or math.nan
    return state.contact_area_fraction, state.mean_separation, stiffness / model.surface.area


def _scatter(areas: Array, read: Array) -> Array:
    """Return standard deviations of area, mean gap and stiffness among samples, shape (3,).

    Those of area and stiffness are relative, those of the gap as it is; 0 of a single sample.

    Args:
        areas: Areas of the samples, which they count by, shape (n,) [mm²].
        read: What `_read` returns of them under one mean pressure, shape (n, 3).
    """
    if len(areas) < 2:
        return np.zeros(3)
    shares = areas / areas.sum()
    means = shares @ read
    apart = np.sqrt(shares @ (read - means) ** 2 / (1.0 - shares @ shares))
    return stated(apart / [means[0], 1.0, means[2]])


def causes_of(samples: Sequence[RegionSamples]) -> list[str]:
    """Return the causes of errors that are measured.

    Args:
        samples: Those of every region; single ones tell no error of their mean.
    """
    several = any(len(region.surfaces) > 1 for region in samples)
    return [cause for cause in CAUSES if several or cause != "samples"]


def check_requests(bodies: Mapping[str, BodyFacts | None]) -> Iterator[MemoryRequest]:
    """Yield the memory that measuring the errors of a load step takes beside that of the run.

    Args:
        bodies: What is known of the bodies, by their section of the scene.
    """
    raised = {key: body for key, body in bodies.items() if body and body.degree == 1}
    if sum(8 * body.unknowns for body in raised.values()) > MOST_CHECKED_UNKNOWNS:
        return
    for key, body in raised.items():
        asked = body_request(key, f"{body.element[0]}2", 8 * body.unknowns, 0, in_parts=True)
        purpose = f"[{key}] with quadratic elements, which tell the error (output.check),"
        yield replace(asked, key="output.check", purpose=purpose, shared=_TOLD * asked.shared)


def separation_of(law: PatchLaw, closure: float, reference: float) -> float:
    """Return the height of the plane over the mean plane of samples at a closure [mm].

    Args:
        law: Their law.
        closure: The closure [mm].
        reference: Height of the plane at zero approach over the mean plane [mm].
    """
    return max(law.initial_separation - closure, _LEAST_SEPARATION * reference)


def interpolation_errors(law: PatchLaw, closure: Array) -> Array:
    """Return what a law may err between its rows at closures [MPa].

    Its error is relative to the pressure, or to a small share of its largest where that is more.

    Args:
        law: The law.
        closure: Closures, shape (n,) [mm].
    """
    least = LEAST_LOAD * float(law.rows.pressure.max(initial=0.0))
    return np.asarray(law.interpolation_error * np.maximum(law.pressure(closure), least))


def mean_error(samples: Sequence[Surface], pooled: int = 1) -> float:
    """Return the error of the mean of samples over the standard deviation among them.

    It is not exceeded in 19 of 20 sets of as many; 0 for a single sample, whose scatter is unknown.

    Args:
        samples: The samples, which count by their areas.
        pooled: Number of quantities whose variances are averaged.

    Source:
        Student, Biometrika 6 (1908), 1-25.
    """
    areas = np.array([sample.area for sample in samples])
    count = float(areas.sum() ** 2 / (areas @ areas))
    if count <= 1.0:
        return 0.0
    return float(scipy.special.stdtrit(pooled * (count - 1.0), _SHARE)) / math.sqrt(count)


def omission_notes(samples: Sequence[RegionSamples], step: LoadStep) -> Iterator[str]:
    """Yield what the measured errors of a load step leave out.

    Args:
        samples: Those of every region.
        step: The load step.
    """
    alone = [region.name for region in samples if len(region.surfaces) == 1]
    if alone:
        yield (
            f"{', '.join(alone)}: the error is that for this one sample of the roughness; what "
            "others would change is not known (law.seeds gives a spectrum several)"
        )
    if step.shear_errors and step.step > MOST_REMEMBERED:
        yield Caution(
            f"the error of the shear by its load steps is that of the last {MOST_REMEMBERED} of "
            f"{step.step}: earlier ones are not remembered, and what they erred by is not known "
            "where contacts have stuck since"
        )
    if math.inf in [error for cause, error in step.errors if cause == "mesh"]:
        yield Caution(
            "the error by mesh was not measured: quadratic elements, which would tell that of "
            f"linear ones, have more than {MOST_CHECKED_UNKNOWNS} unknowns on this mesh; take a "
            "coarser mesh with quadratic elements, whose error linear ones tell"
        )
