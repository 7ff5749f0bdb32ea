"""Errors of load steps under laws of samples with friction: what the path of a shear has left.

Shear depends on its path. No path is gone again on a body: the load step alone ends on other
elements, from what those before it left behind, since displacements of a body are those of its
loads, whatever came before. Where elements are linear it is told to first order. What stresses
change beside those of the laws is told by one linear solution. That tells the errors by the load
steps: the samples of the face go their way once more, through what they reached, with pressures and
slips on straight lines between, in many parts.

Laws whose pressures are higher have stiffer springs. Interface and body are two springs in series.

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
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from patchlaw.geometry import Control, ShearControl, ShearState, Surface
from patchlaw.geometry.contact_state import ContactState
from patchlaw.geometry.sliders import SliderRecord, Sliders
from patchlaw.micro import FrictionModel, HalfSpaceModel
from patchlaw.micro.half_space.error_probe import ErrorProbe, coarser
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.models.measured_errors.errors import MeasuredErrors
from patchlaw.multiscale.models.measured_errors.faces import LawErrorProbe
from patchlaw.multiscale.models.measured_errors.samples import separation_of
from patchlaw.multiscale.models.measured_errors.shear import (
    BY_NORMAL,
    FEWEST_CELLS,
    LAST,
    STEPS,
    gone,
    grid_error,
    parted_path,
    resampled,
)
from patchlaw.support import Array, NotConverged

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro.contact.face_equilibrium import FaceEquilibrium, FaceShear
    from patchlaw.macro.contact.face_sliders import FaceSliders
    from patchlaw.macro.contact.law_problem import ApproachResponse, LawContactProblem


_PARTS, _HALVED = 8, 4
"""Parts of the first load step that tell the error by the steps, of later ones 4, and then 2; load
steps up to which half as many tell what the last halving changes; of more all does."""
_FROZEN = 2.0
"""Errors by the steps over those where samples go as they went: on five paths of a slab the latter
were half of the true ones at the least."""
_OF_ENERGY = 3.0
"""Relative error by elements of the energy lost over that of the shear, at the least: in partial
slip it goes with the cube of the shear (Mindlin & Deresiewicz, J. Appl. Mech. 20 (1953), 327)."""
_NO_SHEAR = 1e-6
"""Shear force over the normal one below which errors do not count relative to it: the smallest
coefficient of friction."""
_TELLS = 1e-3
"""Part of the energy lost from which on what a load step loses tells how much those before err: a
step in which almost everything sticks may lose all of it or nothing."""
_RESIDUAL, _OF_PRESSURES = 3e-3, 3e-4
"""Residuals of tractions and of pressures on the cells of samples: shift and energy lost of 32² and
128² cells differed by 0.2 and 0.4 % at most from those with 1e-5 and 1e-8."""
_SLIDES, _STICKS = 1.0 - 1e-6, 0.02
"""Shear stress over μ times the pressure from which on a law slides: cells do so under it, too; and
up to which mean stresses that leave no shear force are those of the pressing alone."""
_SAME_LOAD, _AHEAD, _NO_SLIP = 0.02, 0.999, 0.01
"""Relative change of forces, and cosine of the turn of slips, within which a way is one; slip over
the largest that does not count."""


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
        before: What load steps before it left behind of friction, on all ranks.
    """

    before: SliderRecord

    @property
    def by_shift(self) -> bool:
        """Whether the shift is prescribed, and not the shear force."""
        return self.step.by_shift

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
        shear = {c: np.array([math.hypot(x, y), lost]) for c, (*_, x, y, lost) in answer.items()}
        # the shift of the interface and that of the body may err against each other
        along, lost = math.hypot(*self.answer[-3:-1]), self.answer[-1]
        own = min(shear["mesh"][0] / along, 1.0) if along else 0.0  # on the way back through zero
        share = max(own, answer["mesh"][0] / self.state.force)
        shear["mesh"] = np.maximum(shear["mesh"], share * np.array([along, _OF_ENERGY * lost]))
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
        """Return the errors of the answer by elements, quadrature and load steps; collective."""
        sizes = np.abs(self.answer)
        sizes[4:6] = self.state.force
        errors = self._while_pressed("steps", self._by_steps, sizes)
        return super().answer_errors() | {"steps": errors}

    def pressure_errors(self) -> dict[str, Array]:
        """Return by cause what the laws err by; see `LawErrorProbe.pressure_errors`."""
        errors = super().pressure_errors()
        # the cells know the error between rows at their closure, and what tractions lift
        of_cells = self._on_cells.pressure[self.response.sampling.patch]
        laws = np.maximum(errors["laws"], of_cells * self.state.sample_pressure)
        return errors | {"laws": laws}

    # --- the load step on other elements

    def by_points(self) -> Array:
        """Return what more quadrature points change in the answer; see `LawErrorProbe.by_points`.

        The shear errs as that by springs that have come to where they are in one step, which no
        points need remember.
        """
        with self._other("the same", lambda face: face) as same:
            whole, other = self._borne(same), self._borne_on_finer()
        *read, x, y = other - whole
        borne = max(math.hypot(*whole[-2:]), _NO_SHEAR * whole[0]) or 1.0
        share = min(math.hypot(x, y) / borne, 1.0)
        return np.array([*read, *(share * self.answer[-3:])])

    def load_step(self, problem: LawContactProblem) -> tuple[Control, SliderRecord | None]:
        """Return what the load step prescribed; sliders go on as they did in it."""
        (control,) = parted_path([self.step])
        assert problem.sliders is not None
        problem.sliders.restore(self.before, near=True)
        if not self.by_shift:  # the search for the shift begins where it ended
            shift = np.array(self._shear.shift)
            problem.sliders.memory = replace(problem.sliders.memory, shift=shift)
        return control, self.before

    def _answer_of(
        self, end: FaceEquilibrium, problem: LawContactProblem, to: ApproachResponse
    ) -> Array:
        """Return what `LawErrorProbe` compares, the shear and the energy lost, shape (7,)."""
        shear = end.shear
        assert shear is not None
        along = shear.force if self.by_shift else shear.shift
        return np.array([*super()._answer_of(end, problem, to), *along, self._lost(shear)])

    def _lost(self, there: FaceShear) -> float:
        """Return the energy lost at the end of a load step; those before err by the same part."""
        whole, change = self._shear.dissipated, there.dissipated - self._shear.dissipated
        if last := whole - self.before.dissipated:
            share = min(abs(change) / last, 1.0) * min(last / (_TELLS * whole), 1.0)
            change = math.copysign(max(abs(change), share * whole), change)
        return whole + change

    @property
    def _sliders(self) -> FaceSliders:
        sliders = self.problem.sliders
        assert sliders is not None
        return sliders

    @property
    def _shear(self) -> FaceShear:
        shear = self.state.shear
        assert shear is not None
        return shear

    @cached_property
    def _stiffness(self) -> float:
        """Tangential stiffness of contact and body [N/mm]; collective."""
        found = self.problem.tangential_stiffness()[0]
        return found if found > 0.0 else math.nan

    # --- what stresses change, to first order

    def _by_steps(self) -> Array:
        """Return what the load steps err by, in the order of the answer, shape (7,)."""

        def gone(parts: int) -> tuple[Array, float]:
            stress, lost = self.problem.gone_in_parts(parts)
            return stress, float(self._sliders.total(lost[:, None])[0])

        # of steps that are remembered; without earlier ones whole steps tell no more than parts
        (whole, lost_whole), (fine, lost_fine) = self._whole(gone), gone(_PARTS)
        few = self._sliders.memory.path.shape[1] <= _HALVED
        coarse, lost_coarse = gone(_PARTS // 2) if few else (whole, lost_whole)
        stress = _FROZEN * STEPS * (np.abs(fine - whole) + LAST * np.abs(fine - coarse))
        lost = STEPS * (abs(lost_fine - lost_whole) + LAST * abs(lost_fine - lost_coarse))
        signed = np.sign(fine - whole) * stress
        further = np.column_stack([np.zeros(len(signed)), signed])
        force, shear = self.problem.changed_by(further)
        along = np.abs(shear if self.by_shift else shear / self._stiffness)
        return np.array([abs(force), *np.zeros(3), *along, lost])

    def _whole(self, gone: Callable[[int], tuple[Array, float]]) -> tuple[Array, float]:
        """Return the stresses and the energy lost that whole load steps lead to.

        They are those of the run, unless laws have worn since, or load steps are forgotten.
        """
        if self.worn or self._sliders.forgets:
            return gone(1)
        return self._sliders.memory.stress, self._sliders.memory.dissipated

    def _by_pressures(self, errors: dict[str, Array]) -> dict[str, Array]:
        """Return what errors of the laws' pressures change in the shear, by cause, shape (2,) each.

        Springs of a law whose pressures are higher are stiffer, at the same closure in proportion.
        Under a prescribed force closures give way, and the stiffness at the same pressure counts.

        Args:
            errors: Their integrals over the regions, shapes (R,) [N].
        """
        point, sums = self._points[-1], self.response.sampling.patch_sums
        loaded = np.where(point.force > 0.0, point.force, 1.0)
        known = [error for error in errors.values() if np.isfinite(error).all()]
        share = np.where(point.force > 0.0, sum(known, np.zeros_like(loaded)) / loaded, 0.0)
        changed, whole = np.zeros(2), float(sum(error.sum() for error in known))
        if whole > 0.0:
            stress = np.array([sums(one) for one in self._sliders.memory.stress.T])
            carried, slip = np.hypot(*stress) / loaded, np.hypot(*point.slip.T)
            lost = self._shear.dissipated * share / (loaded.sum() * share.max())
            changes = []
            for stiffer in self._stiffer(share):
                error = np.abs(1.0 / stiffer - 1.0) * slip
                if self.by_shift:
                    alike = self._interface_share
                    error = np.abs(1.0 / (1.0 - alike + alike / stiffer) - 1.0) / alike * carried
                changes.append(self._by_interface(np.stack([error, lost * share.max()])))
            changed = np.maximum(*changes) / whole
        return {
            cause: changed * float(error.sum()) if np.isfinite(error).all() else np.full(2, np.inf)
            for cause, error in errors.items()
        }

    def _stiffer(self, share: Array) -> Iterator[Array]:
        """Yield how much stiffer springs are by region where pressures are higher, and lower.

        Args:
            share: The shares, shape (R,).
        """
        for sign in (1.0, -1.0):
            factors = np.maximum(1.0 + sign * share, 0.5)
            if not self.step.by_force:
                yield factors
                continue
            found = []
            for law, factor, closure in zip(
                self.table.laws, factors, self._points[-1].closure, strict=True
            ):
                here = float(law.pressure(max(closure, law.range[0])))
                pressures = np.array([here / factor, here])
                there, before = law.stiffness(law.closure_under(pressures))
                found.append(factor * there / before if here > 0.0 < before else 1.0)
            yield np.maximum(found, 0.1)

    @cached_property
    def _interface_share(self) -> float:
        """Part of the compliance along the face that is the interface's."""
        alone, both = self.problem.interface_stiffness(), self._stiffness
        return both / alone if both < alone else 1.0

    def _by_interface(self, errors: Array) -> Array:
        """Return what errors of the interface alone change in the shear, shape (2,).

        Args:
            errors: Those of `_OnCells`, shape (2, R).
        """
        forces = self._points[-1].force
        whole, lost = np.where(forces > 0.0, errors, 0.0) @ forces
        if not self.by_shift:
            return np.array([whole / forces.sum(), lost])
        return np.array([whole * self._interface_share, lost])

    # --- the cells of samples

    @cached_property
    def _points(self) -> list[_Point]:
        """The means at the turning points of the path, the latest load step last; collective."""
        sampling, path = self.response.sampling, self._sliders.memory.path
        points = []
        for closure, x, y in np.moveaxis(path, 0, 2):
            pressure = self.problem.forces.of_springs(closure)
            force = sampling.patch_sums(pressure)
            sums = [sampling.patch_sums(pressure * one) for one in (closure, x, y)]
            means = np.stack(sums, axis=1) / np.where(force > 0.0, force, 1.0)[:, None]
            reached = np.where(force > 0.0, self._as_worn(means[:, 0]), -np.inf)
            points.append(_Point(reached, means[:, 1:], force))
        largest = max(float(np.abs(one.slip).max()) for one in points)
        ways = zip([None, *points], points, [*points[1:], None], strict=False)
        return [one for before, one, after in ways if not _between(before, one, after, largest)]

    def _as_worn(self, closures: Array) -> Array:
        """Return where the laws bear what new ones do at closures, shape (R,) [mm]."""
        found = []
        for new, law, at in zip(self.new_laws, self.table.laws, closures, strict=True):
            if new is law:
                found.append(at)
                continue
            found.append(law.closure_under(new.pressure(at)))
        return np.array(found)

    @cached_property
    def _on_cells(self) -> _OnCells:
        """Go the path of every region's means on the cells of its samples; collective."""
        size = np.zeros((2, len(self.samples)))
        for number, path in enumerate(self._paths):
            if path:
                size[:, number] = path[-1].size(by_shift=self.by_shift)
        sizes = np.stack([np.ones_like(size[0]), *size, *size])
        errors = self._while_pressed("friction", self._gone_on_cells, sizes)
        return _OnCells(errors[0], errors[1:3], errors[3:], size)

    def _while_pressed(self, of: str, measure: Callable[[], Array], sizes: Array) -> Array:
        """Return errors, kept to further load steps while nothing shears; see `_once`."""
        return self._once(of, measure, sizes) if self.pressed else measure()

    def _gone_on_cells(self) -> Array:
        """Return the errors of `_OnCells`, shape (5, R)."""
        paths, pressed = self._paths, self.pressed
        errors = np.zeros((5, len(self.samples)))
        if pressed:
            paths = [path[-1:] for path in paths]
        tell = partial(self._of_sample, paths=paths, pressed=pressed)
        for number, own, areas in self.of_regions("check of friction", tell, paths):
            errors[:, number] = _errors_of(paths[number][-1], own, areas, by_shift=self.by_shift)
        return errors

    @cached_property
    def _paths(self) -> list[list[_Reached]]:
        """What the laws reach along the path, by region; collective."""
        return [self._path_of(number, law) for number, law in enumerate(self.table.laws)]

    @cached_property
    def pressed(self) -> bool:
        """Whether what the face shears by is that of the pressing alone; collective."""
        if math.hypot(*self._shear.force) > _NO_SHEAR * self.state.force:
            return False
        ends = zip(self.samples, self._paths, strict=True)
        return all(
            math.hypot(*reached.rate) <= _STICKS * region.coefficient
            for region, path in ends
            for reached in path
        )

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

    def _of_sample(
        self, number: int, sample: Surface, paths: Sequence[Sequence[_Reached]], pressed: bool
    ) -> Array:
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
        normal, own = _on(sample.grid, probe, friction)
        controls = []
        for reached in paths[number]:
            approach = reference - separation_of(law, reached.closure, reference)
            place = number, sample, approach
            if place not in self.cells.forces:
                self.cells.forces[place] = normal.press(Control(approach=approach)).force
            force = self.cells.forces[place]
            x, y = map(float, reached.slip if self.by_shift else force * reached.rate)
            load = ShearControl(shift=(x, y)) if self.by_shift else ShearControl(force=(x, y))
            controls.append(Control(force=force, shear=load))
        found = np.full((3, 5), np.nan)
        most = max(math.hypot(*reached.rate) for reached in paths[number])
        if not self.by_shift and most >= _SLIDES * friction.coefficient:
            return found
        for row, times in enumerate((1, 2, 4)):
            if row and pressed:  # what shears by the elements alone has no error by the cells
                found[row] = found[0]
                continue
            grid = sample.grid if times == 1 else coarser(sample, times)
            if row and min(sample.grid) // times < FEWEST_CELLS // 4:
                continue
            try:
                on_cells = (normal, own) if row == 0 else _on(grid, probe, friction)
                state, shear = self._gone((number, sample, grid), *on_cells, controls)
            except NotConverged:
                continue
            # a sample that does not touch where others do counts for nothing
            end = np.array(shear.force) / (state.force or 1.0) if self.by_shift else shear.shift
            found[row] = state.force, state.approach - approach, *end, shear.dissipated
        return found

    def _gone(
        self, of: Hashable, normal: HalfSpaceModel, friction: FrictionModel, path: list[Control]
    ) -> tuple[ContactState, ShearState]:
        """Return the end of a path on cells, from where an earlier load step has come on it.

        Args:
            of: What tells the cells from others.
            normal: The normal contact.
            friction: Friction on its cells.
            path: What is prescribed on the way.
        """
        nothing: tuple[list[Control], Any] = [], None
        ends = self.cells.ends.get(of, [nothing])
        known = [one for one in ends if one[0] == path[: len(one[0])]] or [nothing]
        for end in range(len(known[-1][0]) + 1, len(path) + 1):
            found = gone(normal, friction, path[end - 1 : end], known[-1][1])
            known.append((path[:end], found))
        self.cells.ends[of] = known[-2:]  # the last point may be on the way to the next
        return known[-1][1]


def _on(
    grid: tuple[int, int], probe: ErrorProbe, friction: FrictionModel
) -> tuple[HalfSpaceModel, FrictionModel]:
    """Return the normal contact of a sample and its friction on some cells, solved roughly."""
    normal, own = resampled(probe, friction, grid, _RESIDUAL)
    return replace(normal, tolerance=_OF_PRESSURES), own


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

    def size(self, *, by_shift: bool) -> tuple[float, float]:
        """Return what `_OnCells` has errors of.

        Args:
            by_shift: Whether the shift is prescribed.
        """
        return math.hypot(*(self.rate if by_shift else self.slip)), self.lost / self.pressure


def _errors_of(law: _Reached, ends: Array, areas: Array, *, by_shift: bool) -> list[float]:
    """Return the errors of `_OnCells` of one region.

    Args:
        law: What its law reaches.
        ends: How its m samples end the path, shape (m, 3, 5), see `LawShearProbe._of_sample`.
        areas: Their areas [mm²].
        by_shift: Whether the shift is prescribed.
    """
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
    errors = abs(pressure / law.pressure - 1.0), *apart[:, 0], *grid_error(*apart.T[1:])
    return [float(error) if math.isfinite(error) else math.inf for error in errors]


def _between(before: _Point | None, point: _Point, after: _Point | None, largest: float) -> bool:
    """Tell whether a path leads through a point anyway, in every region.

    It does where a load rises on without slip that counts, and on the way of a shear under one
    load.

    Args:
        before: The point before it; None of the first.
        point: The point.
        after: The point after it; None of the last.
        largest: The largest slip of all points [mm].
    """
    if after is None:
        return False
    rises = bool(np.all(after.force >= (1.0 - _SAME_LOAD) * point.force))
    if rises and max(np.abs(one.slip).max() for one in (point, after)) <= _NO_SLIP * largest:
        return True
    if before is None:
        return False
    forces = np.array([before.force, after.force])
    same = np.allclose(forces, point.force, rtol=_SAME_LOAD, atol=_SAME_LOAD * point.force.max())
    first, second = point.slip - before.slip, after.slip - point.slip
    sizes = np.hypot(*first.T) * np.hypot(*second.T)
    return bool(same and np.all((first * second).sum(axis=1) >= _AHEAD * sizes))
