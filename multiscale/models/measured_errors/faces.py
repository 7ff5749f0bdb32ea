"""Errors of load steps on faces under laws of samples, by cause, measured in the run.

Each cause is varied while all others stay, under what the load step prescribes: elements of a body
to first order from the known solution where they are linear, by another one where they are
quadratic; the laws by what they err at the pressures of the step, see `samples` beside this module,
and the quadrature by their pressures at more points. One linear solution tells what these change,
to first order: the response of the contact to the approach, which tells the error of the approach,
too.

Errors of elements are set in proportion to the changes from linear to quadratic ones, of the force
as of area, mean gap and stiffness, which are read off the laws at the closures there.
The factors were set before they were tried, on bodies drawn at random, against meshes refined twice
(docs/accuracy.md).

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

from patchlaw.geometry import Control
from patchlaw.geometry.sliders import MOST_REMEMBERED, SliderRecord
from patchlaw.micro.half_space.error_probe import ZERO
from patchlaw.micro.model import LEAST_CLOSING
from patchlaw.multiscale.bodies.bodies import free_bodies
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.machine import MemoryRequest
from patchlaw.multiscale.models.measured_errors.errors import MeasuredErrors
from patchlaw.multiscale.models.measured_errors.samples import (
    KEPT,
    NEAR,
    SampleProbe,
    interpolation_errors,
    mean_error,
)
from patchlaw.multiscale.scene.memory import body_request
from patchlaw.multiscale.scene.parts import BodyFacts
from patchlaw.multiscale.scene.surfaces import RegionSamples
from patchlaw.support import Array, Indices
from patchlaw.support.readable import Caution

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro import FaceEquilibrium, FacePair, LawContactProblem, LoadedFace
    from patchlaw.macro.contact.face_laws import Sampling
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
have so many unknowns at most; other elements with so many are kept for later load steps. Creases
between the facets of a faceted side disturb a uniform stress by 1e-4 to 1e-3 in places that no
degree of elements resolves on the same mesh."""
_LINE = 1e-3
"""Share of the pressures up to which what is read off laws changes in proportion."""
_SAME_FORCE = 16.0
"""Ratio of forces up to which displacements by elements are in proportion to them: errors kept in
proportion from a sixteenth of the force on were 0.98 to 1.19 of fresh ones in 32 cases of 17 drawn
bodies."""
_TOLD = 0.57
"""Memory of the products that tell the error of linear elements over that of a solve: 1230 of 2150
B an unknown of a cube of 73,167 (Q2), 740 of 1610 of 151,959 (P2)."""
_OF_FACE_NODE = 30_000.0
"""Memory of two ways of sliders that load steps in parts have come, for each node of the face [B]:
up to 9 samples, with 60 springs in two directions and some 20 load steps each."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LawErrorProbe(SampleProbe):
    """Measures the errors of the latest load step on a face with laws of samples.

    Args, besides those of `SampleProbe`:
        problem: The body with the laws on its contact face, at the load step.
        face: The contact face.
        state: The contact there.
        problem_with: Returns the problem on a face of the same bodies, with laws.
        step: The load step.
        worn: Whether laws and samples are those of depths near to what has worn off.
        new_laws: The laws of the samples before they wore; of new samples those of `table`.
        zero: Error of the height that approaches count from [mm].
        elsewhere: By name other faces of small bodies, each with laws and the problem there.
    """

    problem: LawContactProblem
    face: LoadedFace | FacePair
    state: FaceEquilibrium
    problem_with: Callable[[Any, LawTable], LawContactProblem]
    step: LoadStep
    worn: bool = False
    new_laws: Sequence[PatchLaw]
    zero: float = 0.0
    elsewhere: dict[str, tuple[Any, Any, Any]] = field(default_factory=dict)
    _of_regions: dict[str, Array] = field(default_factory=dict, init=False)
    _read_under: dict[float, Array] = field(default_factory=dict, init=False)

    @cached_property
    def control(self) -> Control:
        """What the load step prescribed of the plane."""
        return self.problem.stated if self.step.by_force else self.problem.same_approach()

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
            known = not self.zero or self.step.by_force or self.problem.sliders
            force = 0.0 if known else float(self._by_zero()[0])
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
        area, _, stiffness = self.answer[1:4]
        sizes = np.array([area or 1.0, 1.0, stiffness or 1.0])
        # changes may cancel in a mean: at least what the laws say where all pressures err alike
        others = {
            cause: np.maximum(error[1:4] / sizes, self._going_with(parts[cause] / force))
            for cause, error in answer.items()
        }
        others[ZERO] = answer[ZERO][1:4] / sizes
        if step.by_force:
            parts[ZERO] = self.response.stiffness * self.zero
        sums = self.response.sampling.patch_sums
        for cause, error in pressure.items():
            others[cause] = self._of_regions.get(cause, np.zeros(3))
            if cause in ("laws", "edges"):  # by the pressure, and what the gap closes by for it
                share = self._going_with(float(sums(error).sum()) / force)
                others[cause] = np.maximum(others[cause], share)
            if not step.by_force:  # besides, all go with the force
                others[cause] = others[cause] + self._going_with(parts[cause] / force)
        touching = [step.contact_area_fraction, 1.0, 1.0]
        return MeasuredErrors(
            by_cause={c: np.append(parts[c], others[c] * touching) for c in self.causes},
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
        known, sizes, by = self._under(1.0), np.ones(3), max(share, _LINE)
        moved = np.max([abs(self._under(1.0 + one) - known) for one in (by, -by)], axis=0)
        sizes[::2] = known[::2]
        moved = np.divide(share / by * moved, sizes, out=errors.copy(), where=sizes > 0.0)
        return np.array([min(share, moved[0]), *np.maximum(errors, moved)[1:]])

    def _under(self, times: float) -> Array:
        """Return what `_read_off` returns under so many times the pressures; collective."""
        if times not in self._read_under:
            sampling = self.problem.sampling
            pressure = max(times, 0.0) * self.state.sample_pressure
            closure = self._closures_under(pressure, sampling.patch)
            self._read_under[times] = self._read_off(closure, sampling)
        return self._read_under[times]

    def _read_off(self, closure: Array, sampling: Sampling, closing: Array | None = None) -> Array:
        """Return area, gap [mm] and stiffness [MPa/mm] by the laws, shape (3,).

        Args:
            closure: Closures of this rank's samples, shape (n,) [mm].
            sampling: The samples.
            closing: What these close in by with the approach. The stiffness is then −dp̄/dū by the
                mean gap ū, else the mean of those of the laws.

        Note:
            Collective.
        """

        def mean(values: Array) -> float:
            return float(sampling.patch_sums(values).sum() / whole)

        laws, whole = self.table.together(), sampling.patch_sums(np.ones_like(closure)).sum()
        point = laws.at(sampling.patch, closure, extend=True)
        stiffness = mean(point.stiffness)
        if closing is not None:
            closed = closing * point.closing
            rates = laws.interface_stiffness(point, sampling.patch)
            stiffness = mean(closed * rates) / max(mean(closed), LEAST_CLOSING)
        return np.array([mean(point.contact_area_fraction), mean(point.separation), stiffness])

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

        factors = np.array([mean_error(region.surfaces) for region in self.samples])
        sums = self.response.sampling.patch_sums
        forces = sums(pressure)

        def means(at: Array) -> Array:
            weighted = sums(pressure * at)
            return np.divide(weighted, forces, out=np.zeros_like(forces), where=forces > 0.0)

        (grid, slopes, widths), of_regions = self.of_cells(means(closure), forces, factors)
        self._of_regions.update(of_regions)
        # without load an unknown error is none
        return {
            "laws": self._by_law(interpolation_errors, closure, patch) * (pressure > 0.0),
            "samples": factors[patch] * self._by_law(PatchLaw.pressure_scatter, closure, patch),
            "grid": np.where(pressure > 0.0, grid[patch], 0.0) * pressure,
            "slopes": np.where(pressure > 0.0, slopes[patch], 0.0) * pressure,
            "edges": self._at_edges(widths),
        }

    def _closures_under(self, pressure: Array, patch: Indices) -> Array:
        """Return the closures of the laws of regions under pressures, shape (n,) [mm]."""
        return self._by_law(PatchLaw.closure_under, pressure, patch)

    def _by_law(
        self, function: Callable[[PatchLaw, Array], Array], values: Array, patch: Indices
    ) -> Array:
        """Return a function of the law at every sample, and of values there, shape (n,)."""
        found = np.zeros_like(values)
        for region, law in enumerate(self.table.laws):
            here = patch == region
            found[here] = function(law, values[here])
        return found

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
        points = self.answer + self.by_points()
        measure = partial(self._by_elements, points)
        mesh = self._in_proportion("mesh", measure)
        return mesh, np.abs(points - self.answer)

    def _by_elements(self, points: Array) -> Array:
        """Return the errors by elements.

        Args:
            points: The answer with a finer quadrature.
        """
        from patchlaw.macro.contact import other_elements as on

        own, known = on.bodies_of(self.face), self.answer
        mesh, quadratic, below = np.zeros_like(known), known, np.zeros_like(known)
        if any(body.degree == 2 for body in own):
            linear = partial(on.face_on, choose=lambda b: b.linear if b.degree == 2 else b)
            mesh += OF_QUADRATIC * np.abs(self._answer_of_kind("linear", linear) - known)
        if any(body.degree == 1 for body in own):
            error, quadratic = self._of_linear(points)
            mesh, below = mesh + error, np.abs(quadratic - points)
        if mesh[0] >= _BY_CREASES * abs(known[0]) or 8 * self._most > _MOST_KEPT_UNKNOWNS:
            return mesh

        def by_creases() -> Array:  # by quadratic elements on cells cut into eight
            found = self._answer_of_kind("cut", on.refined_face, same=False)
            return np.zeros_like(known) if found is None else np.abs(found - quadratic)

        return np.maximum(mesh, below + OF_REFINED * self._in_proportion("creases", by_creases))

    def _in_proportion(self, kind: str, measure: Callable[[], Array]) -> Array:
        """Return errors by displacements in proportion to the pressures, measured once.

        Force, area and gap err by these in proportion to the stiffness besides. They are measured
        again where the force is another one, where the bodies are loaded otherwise, and where
        pressures move, as under planes that tilt and on faces that wear. The shear errs by the part
        that the force does, see `LawShearProbe`.

        Args:
            kind: What displaces.
            measure: Returns the errors of the answer.
        """
        sizes = np.abs(self.answer)
        sizes[:4] *= self.response.stiffness
        if kind == "creases":
            sizes[4:] = 0.0
        elif not self.pressed:
            return measure()
        else:  # what pressing alone shears by goes with the force
            sizes[4:6] = self.state.force
        return self._once(kind, measure, sizes, _SAME_FORCE, _SAME_FORCE)

    def _once(
        self,
        of: Hashable,
        measure: Callable[[], Array],
        sizes: Array,
        rise: float = KEPT,
        fall: float = 1.0,
    ) -> Array:
        """Return errors in proportion to their sizes, measured once for forces that are near.

        Args:
            of: What they are of, see `recalled`, which the last two are of.
            measure: Returns them.
            sizes: Their sizes, of the same shape.
            rise: See there.
            fall: See there.
        """
        if self.worn or self.control.tilt != (0.0, 0.0):
            return measure()
        step, force = self.step, self.state.force
        of = of, step.body_state, step.by_shift  # a shear is a force or a shift
        shares = self.recalled(of, force, rise * NEAR, fall * NEAR)
        if shares is not None:
            return shares * sizes
        errors = measure()
        shares = np.divide(errors, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)
        self.tell_later(of, force, shares)
        return errors

    @property
    def pressed(self) -> bool:
        """Whether what the face shears by, if anything, is that of the pressing alone."""
        return True

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
        if face is not None and (problem is None or table is not self.table):
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
        """Return what a problem on the same elements bears, in the order of the answer.

        See `LawContactProblem.forces_at`.
        """
        borne, closure = problem.forces_at(self.state, self.control.body_state, self.response)
        return np.insert(borne, 1, self._read_on(problem, closure, self.response))

    @cached_property
    def answer(self) -> Array:
        """What discretisation may be off by; see `_answer_of`."""
        return self._answer_of(self.state, self.problem, self.response)

    def answer_on(
        self, problem: LawContactProblem, *, same: bool = True, nearer: float = 0.0
    ) -> Array:
        """Return the answer on another face, under the same plane.

        Args:
            problem: The problem there.
            same: Whether its meshes are the same. On other unknowns the answer is then that to
                first order.
            nearer: How much nearer the plane is [mm].
        """
        from patchlaw.macro.contact import other_elements as on

        control, before = self.load_step(problem)
        to = self.response
        if not same:
            on.start_from_mesh(problem, self.state, self.problem.sampling)
        else:
            moved = on.carried(self.state.displacement, self.face, problem.face)
            problem.start_at(moved, self.state.plane, control.body_state)
            more = problem.face.body.dofs - self.face.body.dofs
            if more > 0:
                end = problem.first_order_step(control, self.problem, before)
                return self._answer_of(end, problem, to)
            if more < 0:
                return self._answer_of(problem.step_on_lines(control, self.problem), problem, to)
        if control.approach is not None:
            control = replace(control, approach=control.approach + nearer)
        found = problem.solve(control)
        return self._answer_of(found, problem, to if same else problem.approach_response())

    def load_step(self, problem: LawContactProblem) -> tuple[Control, SliderRecord | None]:
        """Return what a problem on another face is solved under, and what was left behind there."""
        return self.control, None

    def _answer_of(
        self, end: FaceEquilibrium, problem: LawContactProblem, to: ApproachResponse
    ) -> Array:
        """Return what is compared at the end of a load step, shape (4,).

        It is the force at the approach of the run [N], to first order where the force is
        prescribed, and what is read off the laws: area, gap [mm] and stiffness, over those known.
        """
        force = end.force
        if self.step.by_force:
            force -= self.response.stiffness * (end.approach - self.state.approach)
        return np.array([force, *self._read_on(problem, end.sample_closure, to)])

    def _read_on(self, problem: LawContactProblem, closure: Array, to: ApproachResponse) -> Array:
        """Return what `_read_off` does at closures of a problem.

        Args:
            problem: The problem.
            closure: The closures, shape (n,) [mm].
            to: The response to the approach there, or that of the run on the same meshes.
        """
        from patchlaw.macro.contact import other_elements as on

        sampling, moved = problem.sampling, to.moved.array_r
        if to is self.response:
            moved = on.carried(moved, self.face, problem.face)
        if self.worn:  # the laws are those of the nearest depths: at equal pressures
            closure = self._closures_under(problem.forces.pressure(closure), sampling.patch)
        return self._read_off(closure, sampling, problem.closing_with(to.way, moved))


def causes_of(samples: Sequence[RegionSamples]) -> list[str]:
    """Return the causes of errors that are measured.

    Args:
        samples: Those of every region; single ones tell no error of their mean.
    """
    several = any(len(region.surfaces) > 1 for region in samples)
    return [cause for cause in CAUSES if several or cause != "samples"]


def check_requests(
    bodies: Mapping[str, BodyFacts | None], *, rubs: bool = False
) -> Iterator[MemoryRequest]:
    """Yield the memory that measuring the errors of a load step takes beside that of the run.

    Args:
        bodies: What is known of the bodies, by their section of the scene.
        rubs: Whether their faces are sheared with friction.
    """
    if rubs:  # nodes lie as far apart along the face as below it
        known = [body for body in bodies.values() if body]
        layers = [(b.unknowns / 3.0 * b.depth**2 / b.area) ** (1.0 / 3.0) for b in known]
        nodes = sum(b.unknowns / 3.0 / max(n, 1.0) for b, n in zip(known, layers, strict=True))
        purpose = "load steps in parts, which tell the error of the shear (output.check),"
        yield MemoryRequest(key="output.check", purpose=purpose, shared=_OF_FACE_NODE * nodes)
    raised = {key: body for key, body in bodies.items() if body and body.degree == 1}
    if sum(8 * body.unknowns for body in raised.values()) > MOST_CHECKED_UNKNOWNS:
        return
    for key, body in raised.items():
        asked = body_request(key, f"{body.element[0]}2", 8 * body.unknowns, 0, in_parts=True)
        purpose = f"[{key}] with quadratic elements, which tell the error (output.check),"
        yield replace(asked, key="output.check", purpose=purpose, shared=_TOLD * asked.shared)


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
