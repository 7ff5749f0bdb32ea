"""Errors of load steps under laws of samples with friction: what the path of a shear has left.

Shear depends on its path. The path is gone once more through its turning points: on the same
elements, on those that `multiscale.measured_errors.samples` compares with, and with laws whose
pressures are higher by what they may be off; and through all load steps in halves, which tells the
error by the steps.

What the springs of a law leave out is told by the cells of its samples, under the mean closure and
slip (or shear stress) of their region at every turning point. Pressures and tractions see each
other there, and the same path on fewer cells tells the error of the grid. Errors of the slip under
a known shear stress are errors of the shift. Errors of the shear stress at a known slip change the
shear force as in a series of two springs: that of the interface, and that of the body. The energy
that friction takes up errs by the same causes.

How far that can be trusted: docs/accuracy.md, measured errors, and
benchmarks/shear_error_study.py --samples.

Theory: docs/theory.md, sections 13 and 15.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from patchlaw.geometry import Control, Surface
from patchlaw.geometry.rigid_plane import ShearControl
from patchlaw.geometry.sliders import Sliders
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.measured_errors.errors import MeasuredErrors
from patchlaw.multiscale.measured_errors.samples import LawErrorProbe, separation_of
from patchlaw.multiscale.measured_errors.shear import (
    BY_NORMAL,
    FEWEST_CELLS,
    error_by_steps,
    gone,
    grid_error,
    parted_path,
    path_of,
    resampled,
)
from patchlaw.support.arrays import Array
from patchlaw.support.errors import NotConverged
from patchlaw.support.parallel import shared

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro import FaceEquilibrium, LawContactProblem


class _Point(NamedTuple):
    """The means of every region at a turning point, weighted by pressure.

    Attributes:
        closure: Closures, shape (R,) [mm]; −∞ where nothing touches.
        slip: Displacements of the plane along the face against it, shape (R, 2) [mm].
        force: Normal forces, shape (R,) [N].
    """

    closure: Array
    slip: Array
    force: Array


class _OnCells(NamedTuple):
    """What cells tell of laws at the last turning point, by region.

    Attributes:
        pressure: Error of the pressure at the closure, relative, shape (R,).
        springs: Error of the shear stress over the pressure at the slip where the shift is
            prescribed, of the slip at this stress [mm] where the shear force is, and of the energy
            lost to friction per area over the pressure [mm]; shape (2, R).
        grid: The same by the cells.
        size: What they are errors of.
    """

    pressure: Array
    springs: Array
    grid: Array
    size: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class LawShearProbe(LawErrorProbe):
    """Measures the errors of the latest load step on a face with laws of samples and friction.

    Args:
        steps: All load steps, the latest last.
    """

    steps: Sequence[LoadStep]

    @cached_property
    def path(self) -> list[Control]:
        """What the turning points of the shear prescribed, the latest load step last."""
        return path_of(self.steps, every_load=True)

    @property
    def by_shift(self) -> bool:
        """Whether the shift is prescribed, and not the shear force."""
        return self.steps[-1].by_shift

    def measure(self) -> MeasuredErrors:
        """Measure the errors of the normal force at the approach, and those of the shear.

        Raises:
            NotConverged: When one of the contact problems cannot be solved.

        Note:
            Collective.
        """
        if not self.state.force:
            return replace(super().measure(), shear=dict.fromkeys(self.causes, np.zeros(2)))
        answer, pressure = self.answer_errors(), self.pressure_errors()
        sums, forces = self.response.sampling.patch_sums, self._points[-1].force
        by_region = {cause: sums(errors) for cause, errors in pressure.items()}
        shear = {c: np.array([math.hypot(x, y), lost]) for c, (_, x, y, lost) in answer.items()}
        shear.update(self._by_pressures(by_region))
        cells, floor = self._on_cells, by_region["grid"] / np.where(forces > 0.0, forces, 1.0)
        grid = np.maximum(cells.grid, BY_NORMAL * floor * cells.size)
        for cause, error in (("laws", cells.springs), ("grid", grid)):
            shear[cause] = shear[cause] + self._by_interface(error)
        ordered = {cause: shear[cause] for cause in self.causes}
        return replace(self.of_force(answer, pressure), shear=ordered)

    @property
    def causes(self) -> list[str]:
        """The causes, in their order."""
        return [*super().causes, "steps"]

    def answer_errors(self) -> dict[str, Array]:
        """Return the errors of the answer by causes that are varied by going the path again."""
        errors = super().answer_errors() | {"steps": self._by_steps()}
        normal = 1.0 if self.path[-1].force is None else self.response.stiffness
        return {cause: error * [normal, 1.0, 1.0, 1.0] for cause, error in errors.items()}

    def pressure_errors(self) -> dict[str, Array]:
        """Return by cause what the laws err by; see `LawErrorProbe.pressure_errors`."""
        errors = super().pressure_errors()
        # the cells know the error between rows at their closure, and what tractions lift
        of_cells = self._on_cells.pressure[self.response.sampling.patch]
        laws = np.maximum(errors["laws"], of_cells * self.state.sample_pressure)
        return errors | {"laws": laws}

    # --- the path on the bodies

    @cached_property
    def _own(self) -> tuple[LawContactProblem, list[_Point], Array]:
        """The path on the same elements: the problem, all turning points, and the answer."""
        problem, points = self.problem_with(self.face, self.table), list[_Point]()
        for control in self.path:
            state = problem.solve(control)
            points.append(_means(problem, state))
        return problem, points, self._answer_of(state)

    @property
    def _points(self) -> list[_Point]:
        return self._own[1]

    @property
    def answer(self) -> Array:
        """Force under a prescribed approach, or approach, shear and energy lost, shape (4,)."""
        return self._own[2]

    def answer_on(self, face: Any, *, same: bool = True) -> Array:
        """Return the answer on another face, at the end of the same path."""
        return self._gone(self.path, face)

    def _gone(
        self, path: Sequence[Control], face: Any = None, table: LawTable | None = None
    ) -> Array:
        """Return the answer at the end of a path, on another face or with other laws."""
        problem = self.problem_with(face or self.face, table or self.table)
        for control in path:
            state = problem.solve(control)
        return self._answer_of(state)

    def _answer_of(self, state: FaceEquilibrium) -> Array:
        normal = state.force if self.path[-1].force is None else state.approach
        shear = state.shear
        assert shear is not None
        along = shear.force if self.by_shift else shear.shift
        return np.array([normal, *along, shear.dissipated])

    def _by_steps(self) -> Array:
        """Return what the load steps err by, shape (4,), by going their path in smaller ones."""
        return error_by_steps(
            lambda times: self._gone(parted_path(self.steps, times)),
            self._answer_of(self.state),
            len(self.steps),
            lambda one, other: np.abs(one - other),
        )

    def _by_pressures(self, errors: dict[str, Array]) -> dict[str, Array]:
        """Return what errors of the laws' pressures change in the shear, by cause, shape (2,) each.

        Args:
            errors: Their integrals over the regions, shapes (R,) [N].
        """
        forces = self._points[-1].force
        loaded = np.where(forces > 0.0, forces, 1.0)
        known = [error for error in errors.values() if np.isfinite(error).all()]
        share = np.where(forces > 0.0, sum(known, np.zeros_like(forces)) / loaded, 0.0)
        changed, whole = np.zeros(2), float(sum(error.sum() for error in known))
        if whole > 0.0:
            both = [self._with_pressures(1.0 + sign * share) / whole for sign in (1.0, -1.0)]
            changed = np.maximum(*both)
        return {
            cause: changed * float(error.sum()) if np.isfinite(error).all() else np.full(2, np.inf)
            for cause, error in errors.items()
        }

    def _with_pressures(self, factors: Array) -> Array:
        """Return what changes where pressures are multiplied, shape (2,); infinite where it slides.

        Args:
            factors: Those of every region, shape (R,).
        """
        pairs = zip(self.table.laws, np.maximum(factors, 0.5), strict=True)
        laws = tuple(law.multiplied(float(factor)) for law, factor in pairs)
        try:
            other = self._gone(self.path, table=replace(self.table, laws=laws))
            _, x, y, lost = other - self.answer
        except NotConverged:
            return np.full(2, np.inf)
        return np.array([math.hypot(x, y), abs(lost)])

    def _by_interface(self, errors: Array) -> Array:
        """Return what errors of the interface alone change in the shear, shape (2,).

        Args:
            errors: Those of `_OnCells`, shape (2, R).
        """
        problem, forces = self._own[0], self._points[-1].force
        whole, lost = np.where(forces > 0.0, errors, 0.0) @ forces
        if not self.by_shift:
            return np.array([whole / forces.sum(), lost])
        alone, both = problem.interface_stiffness(), problem.tangential_stiffness()[0]
        return np.array([whole * (min(both / alone, 1.0) if both < alone else 1.0), lost])

    # --- the cells of samples

    @cached_property
    def _on_cells(self) -> _OnCells:
        """Go the path of every region's means on the cells of its samples; collective."""
        paths = [self._path_of(number, law) for number, law in enumerate(self.table.laws)]
        tasks = [
            (number, sample)
            for number, region in enumerate(self.samples)
            for sample in region.surfaces
            if paths[number]
        ]

        def go(task: int) -> Array:
            number, sample = tasks[task]
            return self._of_sample(number, sample, paths[number])

        found = shared(self.comm, len(tasks), go)
        errors = np.zeros((7, len(self.samples)))
        for number in {number for number, _ in tasks}:
            own = [one for (of, _), one in zip(tasks, found, strict=True) if of == number]
            areas = np.array([sample.area for sample in self.samples[number].surfaces])
            errors[:, number] = _errors_of(paths[number][-1], own, areas, by_shift=self.by_shift)
        return _OnCells(errors[0], errors[1:3], errors[3:5], errors[5:])

    def _path_of(self, number: int, law: PatchLaw) -> list[_Reached]:
        """Return what a law reaches along the means of its region, from where that touches."""
        mu, one = self.samples[number].coefficient, np.zeros(1, np.intp)
        sliders = Sliders([law.springs], np.array([law.stiffness_ratio]), one, mu)
        path, state, lost = list[_Reached](), sliders.at_rest, 0.0
        for point in self._points:
            closure, slip = point.closure[number : number + 1], point.slip[number]
            if not np.isfinite(closure[0]):
                path, state, lost = [], sliders.at_rest, 0.0
                continue
            pressure, stiffness = law.pressure(closure), law.stiffness(closure)
            found = sliders.respond(state, closure, slip[None], pressure, stiffness)
            step, p = sliders.step(state, found), float(pressure[0])
            state, lost = step.after, lost + float(step.lost[0])
            reached = float(closure[0]), p, float(stiffness[0]), slip, found.stress[0] / p
            path.append(_Reached(*reached, lost))
        return path

    def _of_sample(self, number: int, sample: Surface, path: Sequence[_Reached]) -> Array:
        """Return how a sample ends a path, on its cells and on fewer, shape (3, 5).

        Its normal forces are those at the closures of the law, without shear. The columns are this
        force [N], how much nearer the plane is where pressures and tractions see each other [mm],
        the shear force over the normal one, or the shift [mm], along x and y, and the energy lost
        to friction [N mm]. The rows are those of its cells, and of half and a quarter as many along
        a side; NaN where these are too few, or a contact is not found.
        """
        probe = self.cells.probe_of(self.samples[number], sample)
        reference = probe.model.reference_height - sample.mean_height
        friction = self.cells.friction_of(self.samples[number], sample)
        law = self.table.laws[number]
        normal, own = resampled(probe, friction, sample.grid)
        controls = []
        for reached in path:
            approach = reference - separation_of(law, reached.closure, reference)
            force = normal.press(Control(approach=approach)).force
            x, y = map(float, reached.slip if self.by_shift else force * reached.rate)
            load = ShearControl(shift=(x, y)) if self.by_shift else ShearControl(force=(x, y))
            controls.append(Control(force=force, shear=load))
        found = np.full((3, 5), np.nan)
        for row, times in enumerate((1, 2, 4)):
            grid = sample.grid[0] // times, sample.grid[1] // times
            if row and min(grid) < FEWEST_CELLS // 4:
                continue
            try:
                on_cells = (normal, own) if row == 0 else resampled(probe, friction, grid)
                state, shear = gone(*on_cells, controls)
            except NotConverged:
                continue
            end = np.array(shear.force) / state.force if self.by_shift else shear.shift
            found[row] = state.force, state.approach - approach, *end, shear.dissipated
        return found


class _Reached(NamedTuple):
    """What a law reaches at the means of a region.

    Attributes:
        closure: The closure [mm].
        pressure: The pressure there [MPa].
        stiffness: Its derivative [MPa/mm].
        slip: The displacement of the plane along the face against it, shape (2,) [mm].
        rate: Shear stresses over the pressure, shape (2,).
        lost: Energy per area that friction has taken up [N/mm].
    """

    closure: float
    pressure: float
    stiffness: float
    slip: Array
    rate: Array
    lost: float


def _errors_of(
    law: _Reached, samples: Sequence[Array], areas: Array, *, by_shift: bool
) -> list[float]:
    """Return what `_OnCells` has of one region.

    Args:
        law: What its law reaches.
        samples: How its samples end the path, see `LawShearProbe._of_sample`.
        areas: Their areas [mm²].
        by_shift: Whether the shift is prescribed.
    """
    ends = np.array(samples)
    forces = ends[:, 0, 0]
    weights = forces / forces.sum() if forces.sum() > 0.0 else np.full(len(forces), np.nan)
    on_cells = np.tensordot(weights, ends[:, :, 2:4], axes=1)
    lost = ends[:, :, 4].sum(axis=0) / areas.sum()
    by_law = law.rate if by_shift else law.slip
    shear = np.hypot(*(on_cells - [by_law, *on_cells[:2]]).T)
    energy = np.abs(lost - [law.lost, *lost[:2]]) / law.pressure
    apart = np.stack([shear, energy])
    apart[:, 2] = np.nan_to_num(apart[:, 2])
    nearer = float(weights @ ends[:, 0, 1])
    pressure = forces.sum() / areas.sum() - law.stiffness * nearer
    size = math.hypot(*by_law), law.lost / law.pressure
    errors = abs(pressure / law.pressure - 1.0), *apart[:, 0], *grid_error(*apart.T[1:]), *size
    return [float(error) if math.isfinite(error) else math.inf for error in errors]


def _means(problem: LawContactProblem, state: FaceEquilibrium) -> _Point:
    """Return the means of every region at a load step just solved; collective."""
    assert problem.sliders is not None
    sampling, slip = problem.sampling, problem.sliders.memory.sliders.slip
    pressure = state.sample_pressure
    force = sampling.patch_sums(pressure)
    loaded = np.where(force > 0.0, force, 1.0)
    closure = sampling.patch_sums(pressure * state.sample_closure) / loaded
    slips = [sampling.patch_sums(pressure * along) / loaded for along in slip.T]
    return _Point(np.where(force > 0.0, closure, -np.inf), np.stack(slips, axis=1), force)
