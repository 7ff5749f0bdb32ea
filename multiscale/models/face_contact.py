"""Patch laws on the contact face of finite elements.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from patchlaw.geometry import Control, PatchGrid, ShearControl
from patchlaw.geometry.sliding import SAFE, slide_in_steps
from patchlaw.micro.model import LEAST_CLOSING, NormalStiffness, Stiffness
from patchlaw.multiscale.laws.interpolation import LawPoint
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.worn_laws import RunningInLaws
from patchlaw.multiscale.loading.load_step import CLEAR, LoadStep, PatchState
from patchlaw.multiscale.models.problem import BeyondLaws, LawModel, Slid
from patchlaw.support import Array, Indices, InputError, NotConverged

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro import FaceEquilibrium, FacePair, LawContactProblem, LoadedFace


class FaceContact(LawModel):
    """Laws on the contact face of finite elements (Waddad et al. 2016, section 3.2).

    Args:
        problem: The body with the laws on its contact face.
        table: The laws, which also give contact area, contacts and separation.
        face: The patches on its contact face.
        wear: Depths that wear off per distance slid and pressure, one for every law, (N,) [mm²/N];
            None: nothing wears.
        longer: Returns laws that go further than these, and the body with them on its contact face;
            None where that cannot be. Collective.

    Attributes:
        face: The patches on its contact face.
        further_fields: Return functions on the mesh of the first body, at a load step just solved,
            that are written with the other fields; collective.
        slips_before: What load steps left behind of friction before the latest one.
        rubs: Coefficients of friction of the laws of faces that slide as wholes, (N,); None: none.
    """

    on_mesh = True

    def __init__(
        self,
        problem: LawContactProblem,
        table: LawTable,
        face: LoadedFace | FacePair,
        wear: Array | None = None,
        longer: Callable[[LawTable], tuple[LawContactProblem, LawTable] | None] | None = None,
    ) -> None:
        super().__init__(table)
        self._longer = longer or (lambda table: None)
        self._wear, self.wears = wear, wear is not None
        self._slid = Slid()
        self.further_fields: Sequence[Callable[[LoadStep], Any]] = ()
        self.face = face
        self.slips_before: Any = None
        self.rubs: Array | None = None
        self._last: FaceEquilibrium | None = None
        self._take(problem, table)

    _laws: Any
    """The laws of the face, all of them together."""

    def _take(self, problem: LawContactProblem, table: LawTable) -> None:
        self._problem, self.table, self._laws = problem, table, problem.forces.laws
        if self._wear is not None and problem.sliders is not None:
            problem.forces.slip_wear = self._wear[problem.sampling.patch]

    @property
    def _known(self) -> FaceEquilibrium:
        if self._last is None:
            raise ValueError("no load step has been accepted yet")
        return self._last

    @property
    def solved(self) -> tuple[LawContactProblem, FaceEquilibrium]:
        """The body with the laws on its face, and the contact at the latest load step.

        Raises:
            ValueError: Before the first load step.
        """
        return self._problem, self._known

    @property
    def point_pressures(self) -> Array:
        """Pressures at this rank's quadrature points of the face at the latest load step [MPa]."""
        return self.face.on_first(self._known.sample_pressure)

    @property
    def point_stiffnesses(self) -> Array:
        """Interface stiffnesses −dp/dū of the laws at this rank's points, (n,) [MPa/mm]."""
        patch = self._problem.sampling.patch
        return self.face.on_first(self._stiffness_at(patch, self._known.sample_closure))

    @property
    def point_worn_depths(self) -> Array:
        """Depths that have worn off at this rank's points of the face, shape (n,) [mm]."""
        return self.face.on_first(self._known.sample_worn_depth)

    @property
    def point_separations(self) -> Array:
        """Mean gaps of the laws at this rank's points at the latest load step, (n,) [mm]."""
        patch = self.face.sampling("pointwise").patch
        return self._at(patch, self._known.sample_closure, extend=True).separation

    def point_transmissivities(self, cause: str | None, errors: Sequence[float]) -> Array:
        """Return T along x and y at this rank's points, with a cause of error varied, (n, 2) [mm³].

        Args:
            cause: As for `Transmissivity.varied`; or "wear", its steps, which the mean gap errs by.
            errors: Of every law, as there.
        """
        patch, separation = self.face.sampling("pointwise").patch, self.point_separations
        found, depth = np.zeros((len(separation), 2)), self._known.sample_worn_depth
        if cause == "wear":
            separation, cause = separation + self.wear_errors[3], None
        for index, (law, error) in enumerate(zip(self.table.laws, errors, strict=True)):
            at = patch == index
            if isinstance(self._laws, RunningInLaws):
                found[at] = self._laws.leak(index, separation[at], depth[at], cause, error)
            elif law.transmissivity is not None:
                found[at] = law.transmissivity.varied(cause, separation[at], error)
        return found

    def face_pressures(self) -> Array:
        """Return the places and pressures of quadrature points; see `Model`."""
        first: Any = self.face.sides[0]
        first = first.quadrature
        own = np.column_stack([first.x, first.y, self.point_pressures])
        return np.concatenate(self.face.comm.allgather(own))

    def facet_pressures(self) -> tuple[Array, Array]:
        """Return the facets of the face and their mean pressures; see `Model`."""
        corners, means = self.face.facet_means(self.point_pressures[:, None])
        return corners, means[:, 0]

    def facet_shear(self) -> tuple[Array, Array, Array] | None:
        """Return the facets of the face, what they bear and what of their contact slips."""
        shear, sliders = self._known.shear, self._problem.sliders
        if shear is None or sliders is None or self._problem.forces.mode != "pointwise":
            return None
        patch, closure = self._problem.sampling.patch, self._known.sample_closure

        def area(at: Array) -> Array:
            return self._at(patch, at, extend=True).contact_area_fraction

        sticks = self._problem.forces.sticking(self._known)
        touching, sticking = area(closure), area(np.minimum(sticks, closure))
        values = np.column_stack([shear.sample_stress, touching, touching - sticking])
        corners, means = self.face.facet_means(self.face.on_first(values))
        slips = np.full(len(means), np.nan)
        np.divide(means[:, 3], means[:, 2], out=slips, where=means[:, 2] > 0.0)
        return corners, means[:, :2], slips

    def field_state(self, step: LoadStep, parts: PatchGrid) -> Any:
        """Return this rank's displacements, and the pressures of patches or at its points."""
        of_patches = isinstance(self.table.patches, PatchGrid)
        shown = step.patches.pressure_MPa if of_patches else self.point_pressures
        further = [make(step) for make in self.further_fields]
        if self.wears:
            from patchlaw.macro.mesh.contact_face import point_field

            first: Any = self.face.sides[0]
            mesh, points = first.body.mesh.mesh, first.quadrature
            further.append(point_field(mesh, "worn_depth", points, self.point_worn_depths))
        return (self._known.displacement, step.body_state), shown, further

    def field_record(self, state: Any) -> Array:
        """Return the stresses and closures of the samples of all ranks, with their places."""
        known, sampling = self._known, self._problem.sampling
        shear = np.zeros((len(sampling.x), 0)) if known.shear is None else known.shear.sample_stress
        normal = known.sample_pressure, known.sample_closure, known.sample_worn_depth
        own = np.column_stack([sampling.x, sampling.y, *normal, shear])
        return np.concatenate(self.face.comm.allgather(own))

    def field_state_again(self, record: Array, step: LoadStep, parts: PatchGrid) -> Any:
        """Return what fields are made from; see `Model.field_state_again`.

        Displacements follow from the stresses by one linear solve.
        """
        sampling, last = self._problem.sampling, self._last
        places, (pressure, closure, worn, *shear) = record[:, :2], record[:, 2:].T
        own = np.column_stack([sampling.x, sampling.y])
        rows = scipy.spatial.cKDTree(places).query(own)[1] if len(own) else np.zeros(0, np.intp)
        along = np.reshape(shear, (-1, len(record))).T[rows]
        moved = self._problem.displacement_under(pressure[rows], along, step.body_state)
        self._last = replace(
            self._known,
            displacement=moved,
            sample_pressure=pressure[rows],
            sample_closure=closure[rows],
            sample_worn_depth=worn[rows],
        )
        try:
            return self.field_state(step, parts)
        finally:
            self._last = last

    def write_fields(self, path: Path, states: Mapping[int, Any]) -> None:
        """Write the fields of the body; where laws hold at points it alone has the pressures."""
        from patchlaw.macro.fields import write_displaced

        of_patches = isinstance(self.table.patches, PatchGrid)

        def pressures(number: int, counter: bool) -> Any:
            return states[number][1] if of_patches or not counter else None

        moved = {number: state[0] for number, state in states.items()}
        write_displaced(path, self.face, moved, pressures, lambda number: states[number][2])

    @property
    def meshed_bodies(self) -> list[Any]:
        """The body, and the counter-body where that is a mesh."""
        return [one.body for one in self.face.sides]

    @property
    def unknowns(self) -> int:
        """Degrees of freedom of the body, or of both."""
        return self.face.body.dofs

    @property
    def past(self) -> Any:
        """What load steps left behind of friction and wear; set it to take them back."""
        return self._problem.past, self._last, self._slid

    @past.setter
    def past(self, past: Any) -> None:
        self._problem.past, self._last, self._slid = past

    @property
    def slips(self) -> Any:
        """What load steps left behind of friction; None without."""
        return self._problem.sliders and self._problem.sliders.memory

    def press(self, control: Control) -> LoadStep:
        """Solve one load step, with longer laws where these end too early; see `Model.press`."""
        while True:
            before, slips = self.past, self.slips
            try:
                step = self._pressed(control)
            except BeyondLaws:
                self.past = before
                if (longer := self._longer(self.table)) is None:
                    raise
                self._go_on_with(*longer)
            except Exception:
                self.past = before
                raise
            else:
                self.slips_before = slips
                return step

    def _go_on_with(self, problem: LawContactProblem, table: LawTable) -> None:
        """Take longer laws, under which the latest load step is found again."""
        last, shorter = self.state(), self._problem
        self._take(problem, table)
        if self._problem.sliders and shorter.sliders:
            self._problem.sliders.follow(shorter.sliders)
        self._problem.forces.worn = shorter.forces.worn
        if last is not None:
            self._solve_again(last)

    def _pressed(self, control: Control) -> LoadStep:
        try:
            state = self._slid_to(control)
            step = self._step(control, state)
        except NotConverged as error:
            if not any(law.is_flat for law in self.table.laws):
                raise
            problem = "a flat patch, whose pressure is a function of closure nowhere"
            raise self.beyond_law(control, problem) from error
        self._last = state
        return step

    def _slid_to(self, control: Control) -> FaceEquilibrium:
        """Find the equilibrium of a load step, at the end of what the face slides and wears."""
        problem, further = self._problem, control.slid - self._slid.distance
        if self._wear is not None and problem.sliders is not None:
            return self._fretted(control, self._wear)
        if self._wear is None or not further > 0.0:
            return problem.solve(control)
        start, linear = self._last or problem.solve(control), [0]
        each = further * self._wear[problem.sampling.patch]
        forces = {id(start): self._slid.forces}

        def press(share: float, before: FaceEquilibrium, _: Any) -> FaceEquilibrium:
            problem.go_back_to(before)
            state = problem.solve(control, share * each)
            linear[0] += state.linear_iterations
            forces[id(state)] = forces[id(before)] + share * further * state.patch_force
            return state

        def moved(middle: FaceEquilibrium, twice: FaceEquilibrium) -> tuple[float, float, float]:
            change = np.abs(twice.sample_pressure - middle.sample_pressure)
            return float(problem.sampling.patch_sums(change).sum()), middle.force, twice.force

        found = slide_in_steps(press, start, moved, start.force)
        once, end = self._read_off(found.once), self._read_off(found.state)  # goes on from the last
        errors = np.add(self._slid.errors, SAFE * np.abs(np.subtract(once, end)))
        self._slid = Slid(control.slid, tuple(errors.tolist()), forces[id(found.state)])
        return replace(found.state, iterations=found.iterations, linear_iterations=linear[0])

    def _fretted(self, control: Control, wear: Array) -> FaceEquilibrium:
        """Find the equilibrium of a load step whose slip wears.

        The way is the mean slip in proportion to the pressure: worn volume over k times force.
        """
        before = 0.0 if self._last is None else self._worn_off(self._last)[0]
        state = self._problem.solve(control)
        worn, per_way = self._worn_off(state)[0] - before, float(wear @ state.patch_force)
        self._slid = self._slid._replace(
            distance=self._slid.distance + (worn / per_way if per_way > 0.0 else 0.0)
        )
        return state

    def _read_off(self, state: FaceEquilibrium) -> tuple[float, ...]:
        """Return what errors by the steps of wear are of, see `micro.wear.Worn`; go back to it."""
        self._problem.go_back_to(state)
        areas = self.face.areas / self.face.areas.sum()
        means = (
            float(areas @ self._means(name)) for name in ("contact_area_fraction", "separation")
        )
        volume, largest = self._worn_off(state)
        return state.force, state.approach, *means, volume / float(self.face.areas.sum()), largest

    def _worn_off(self, state: FaceEquilibrium) -> tuple[float, float]:
        """Return volume [mm³] and largest depth [mm] that have worn off the face; collective."""
        depth = state.sample_worn_depth
        volume = float(self._problem.sampling.patch_sums(depth).sum())
        return volume, max(self.face.comm.allgather(float(depth.max(initial=0.0))))

    def _at(self, patch: Indices, closure: Array, *, extend: bool = False) -> LawPoint:
        """Return what laws give at closures of all samples, as far as these have worn."""
        point: LawPoint = self._laws.at(patch, closure, self._problem.forces.worn, extend=extend)
        return point

    def _means(self, name: str, *, extend: bool = True) -> Array:
        """Return means over the patches of what laws give, beyond tables on their tangents."""
        return self._problem.patch_means(lambda *at: getattr(self._at(*at, extend=extend), name))

    @property
    def wear_errors(self) -> tuple[float, ...]:
        """Errors by the steps of wear, see `micro.wear.Worn`."""
        return self._slid.errors

    @property
    def wear_by_zones(self) -> bool:
        """Whether regions wear by coefficients of their own."""
        return self._wear is not None and float(np.ptp(self._wear)) > 0.0

    @property
    def worn_depth_between(self) -> Array:
        """What mean and largest worn depth err by between the points of a facet, (2,) [mm]."""
        _, largest = self._worn_off(self._known)
        _, means = self.face.facet_means(self.point_worn_depths[:, None])
        return np.array([0.0, largest - float(means.max(initial=0.0))])

    def _of_wear(self, state: FaceEquilibrium) -> dict[str, Any]:
        """Return what has worn off the face."""
        if not self.wears:
            return {}
        (volume, largest), rubs = self._worn_off(state), self.rubs
        return {
            "slid_mm": self._slid.distance,
            "worn_volume_mm3": volume,
            "mean_worn_depth_mm": volume / float(self.face.areas.sum()),
            "worn_depth_mm": largest,
        } | ({} if rubs is None else {"dissipated_mJ": float(np.sum(rubs * self._slid.forces))})

    def stiffness(self) -> NormalStiffness:
        """Return −dF/dū and dF/dδ at the latest load step, by one linear solve.

        On faces without patches −dF/dū alone, the integral of −dp/dū of the laws over the face.
        """
        if not isinstance(self.table.patches, PatchGrid):
            rates = self._problem.patch_means(self._stiffness_at)
            return NormalStiffness(float(rates @ self.face.areas))
        try:
            to = self._problem.approach_response()
        except NotConverged as error:
            return NormalStiffness(iterations=error.iterations)
        sampling, area = self._problem.sampling, float(self.face.areas.sum())
        point = self._at(sampling.patch, self._known.sample_closure, extend=True)
        closed = point.closing * self._problem.closing_with(to.way, to.moved.array_r)
        rates = closed * self._laws.interface_stiffness(point, sampling.patch)
        gaps, own = (float(sampling.patch_sums(one).sum()) for one in (closed, rates))
        if not gaps > LEAST_CLOSING * area:  # near full contact the mean gap hardly closes
            return NormalStiffness(None, to.stiffness, to.iterations)
        return NormalStiffness(area * own / gaps, to.stiffness, to.iterations)

    def _stiffness_at(self, patch: Indices, closure: Array) -> Array:
        return np.asarray(self._laws.interface_stiffness(self._at(patch, closure), patch))

    def vibration_tangents(self, direction: Array | None) -> tuple[str, Array]:
        """Return where the contact is sampled, and its stiffnesses against small vibrations.

        Args:
            direction: The direction in which the plane slides, along the axes of the face, (2,);
                None where it does not.
        """
        (problem, state), sliding = self.solved, None
        if direction is not None:
            if self.rubs is not None:  # it slides as a whole
                sliding = np.outer(self.rubs[problem.sampling.patch], direction)
            elif problem.sliders is not None:
                sliding = np.outer(problem.sliders.coefficient, direction)
        forces = problem.forces
        return forces.mode, forces.vibration_tangents(state, sliding)

    def tangential_stiffness(self) -> Stiffness:
        """Return the derivative of the shear force along the shift at the latest load step."""
        value, iterations = self._problem.tangential_stiffness()
        return Stiffness(value if np.isfinite(value) else None, iterations)

    def state(self) -> Any:
        """Return the latest plane, pressures and sliders, which determine the displacements."""
        last = self._last
        if last is None:
            return None
        sliders = self._problem.sliders
        left: Any = None if sliders is None else sliders.record()
        if self.wears:
            left = [self._problem.forces.record_of_wear, *self._slid, left]
        return last.approach, last.tilt, last.patch_pressure, self._problem.stated.body_state, left

    def restore(self, state: Any) -> None:
        """Find the equilibrium under a plane again, from the pressures.

        It agrees with the earlier one, and load steps from it with those of a run that was not
        interrupted, to the residual of Newton's method, a share of all contact forces: what starts
        the method, displacements of up to 32 load steps, is not kept. The largest differences of a
        column were 1.4e-10 on a fretted face, and 9e-10 in the energy lost under laws of patches in
        shear; on the former 7e-14 under residuals of 1e-11, for 6 to 16 % more linear iterations.
        """
        if state is not None:
            slips = state[-1]
            if self.wears:
                self._problem.forces.record_of_wear, *slid, slips = state[-1]
                self._slid = Slid(*slid)
            if self._problem.sliders and slips is not None:
                self._problem.sliders.restore(slips)
            self._solve_again(state)

    def _solve_again(self, state: Any) -> None:
        """Find an equilibrium again, where nothing slips further."""
        approach, tilt, pressure, body_state, _ = state
        sliders, forces, shear = self._problem.sliders, self._problem.forces, None
        memory, worn, forces.slip_wear = self.slips, forces.slip_wear, None
        if sliders is not None:
            x, y = map(float, memory.shift)
            shear = ShearControl(shift=(x, y))
        if pressure.any():
            self._problem.start_from(pressure[self._problem.sampling.patch])
        control = Control(approach=approach, tilt=tilt, body_state=body_state, shear=shear)
        self._last = self._problem.solve(control)
        forces.slip_wear = worn
        if sliders is not None:
            sliders.memory = memory

    def _step(self, control: Control, state: FaceEquilibrium) -> LoadStep:
        """Return the load step, with area, contacts and separation of the laws."""
        names = "contact_area_fraction", "separation"
        try:
            area_fraction, separation = (self._means(name, extend=False) for name in names)
            stiffness = self._problem.patch_means(self._stiffness_at)
        except InputError as error:
            falls = not all(law.is_function for laws in self.table.levels for law in laws)
            raise self.beyond_law(control, str(error), falls=falls) from error
        return LoadStep.of_patches(
            self.table.patches,
            plane=(state.approach, *state.tilt),
            load=(state.force, *state.moment),
            patches=PatchState(state.patch_closure, state.patch_pressure, area_fraction, stiffness),
            separation=separation,
            **self._of_contacts(state),
            **self._of_wear(state),
            shear=state.shear,
            slip_area_fraction=self._slip_area_fraction(state, area_fraction),
            newton_iterations=state.iterations,
            linear_iterations=state.linear_iterations,
            reason=state.reason,
            imbalance=(state.force - state.reaction) / state.force if state.force else 0.0,
            warnings=(CLEAR,)
            * (control.force is None and control.tilt is None and not state.force),
        )

    def _slip_area_fraction(self, state: FaceEquilibrium, area_fraction: Array) -> float | None:
        """Return which part of the face slips; None without friction.

        Args:
            state: The contact.
            area_fraction: Contact area fractions of the patches, shape (N,).
        """
        if state.shear is None:
            return None
        at = self._problem.forces.sticking(state)
        sticks = self._problem.patch_means(
            lambda patch, _: self._at(patch, at, extend=True).contact_area_fraction
        )
        return float(np.average(area_fraction - sticks, weights=self.face.areas))

    def _of_contacts(self, state: FaceEquilibrium) -> dict[str, Any]:
        """Return the numbers of contacts in the patches, and what else regions have.

        Where laws are those of samples, contacts are counted on the area of the samples, and the
        pressure has a largest value on the face.
        """
        laws = self._laws
        if isinstance(self.table.patches, PatchGrid):
            every = np.arange(len(laws))
            return {"contacts": laws.at(every, state.patch_closure, extend=True).contacts}
        areas = self.face.areas
        counted_on = np.array([law.sample_area for law in self.table.laws])
        density = self._problem.patch_means(
            lambda patch, closure: self._at(patch, closure).contacts / counted_on[patch]
        )
        peaks = self._problem.patch_largest(lambda *at: self._at(*at, extend=True).pressure)
        return {
            "contacts": round(float(density @ areas)),
            "areas": areas,
            "peak_pressure_MPa": float(peaks.max()),
        }
