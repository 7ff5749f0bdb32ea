"""A body with contact laws on a face, under a rigid plane: one load step at a time.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.materials import Material
from geometry.rigid_plane import Control, RigidPlane
from geometry.sliders import SliderRecord
from geometry.spring_bed import Friction
from macro import compat
from macro.contact.contact_forces import ContactLaw, ContactLaws
from macro.contact.contact_preconditioner import ContactPreconditioner
from macro.contact.equations import Equilibrium
from macro.contact.face_equilibrium import FaceEquilibrium, FaceShear
from macro.contact.face_layer import FaceLayer
from macro.contact.first_steps import FirstSteps
from macro.contact.frictional_forces import FrictionalForces, SliderMemory, contact_forces
from macro.contact.initial_guess import DisplacementBasis
from macro.contact.loaded_face import ContactFace, Mode
from macro.contact.newton import Newton
from macro.contact.opposite_half_space import OppositeHalfSpace
from macro.contact.sampling import Sampling
from macro.linear_solvers.options import UNSYMMETRIC
from macro.linear_solvers.solvers import solve_linear
from support.collective import together
from support.errors import InputError

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


_LINEAR = 1e-9
"""Relative residual of the response to the approach."""

_RESPONSE = 1e-6
"""Relative difference of a half-space's displacements in the response."""

_STIFFNESS = 1e-10
"""Relative residual of the tangential stiffness."""

_ROUGHLY = 1e-3
"""Relative residual of the displacements under a uniform pressure, the first initial guess."""


class ApproachResponse(NamedTuple):
    """First order change of a contact with the approach of the plane.

    Operators of body and laws are symmetric, so that it also tells what errors of laws change: the
    force at the approach by ∫ λ Δp dA, where laws err by pressures Δp.

    Attributes:
        stiffness: dF/dδ [N/mm].
        closing: λ, the change of this rank's closures with the approach, shape (n,); 0 where laws
            have no stiffness.
        closure: The closures, shape (n,) [mm].
        sampling: The samples.
    """

    stiffness: float
    closing: Array
    closure: Array
    sampling: Sampling

    def force_changes(self, pressures: Array) -> Array:
        """Return what errors of the laws change the force by at most, by patch, shape (N,) [N].

        Args:
            pressures: Their sizes at this rank's samples, shape (n,) [MPa].

        Note:
            Collective.
        """
        return np.asarray(self.sampling.patch_sums(np.abs(self.closing) * pressures))


class LawContactProblem:
    """A body with contact laws under a rigid plane, solved by Newton's method.

    Each load step prescribes the plane's approach or force, and its tilt or zero moment. All take
    the same Newton's method in the displacements, and about as many linear solves. The tangent is
    the exact derivative, and conjugate gradients are preconditioned by the body's multigrid. The
    initial guess is the best combination of earlier solutions; far from the equilibrium
    `FirstSteps` come before Newton's method.

    Args:
        face: Patches on the contact face of an elastic body.
        laws: One law per patch, in flat order, or all of them together; the same on every rank.
        mode: ``"patchwise"``: the closure averaged over a patch gives one pressure for it;
            ``"pointwise"``: the law holds at every quadrature point.
        crown: Depth of the face below its plane at points (x, y) of the plane, beside that of the
            mesh, such as of a crowned face [mm]; None: none.
        friction: Friction of the face, whose sliders move on with every load step that converges;
            None: none. Tangents are unsymmetric with it, and GMRES solves for them.
        opposite: Elastic constants of a half-space on the other side, which is displaced under the
            whole face, sideways too where there is friction; None: a rigid plane.

    Raises:
        InputError: When there is not one law per patch, or no such mode.

    Note:
        Construction and ``solve`` are collective.
    """

    def __init__(
        self,
        face: ContactFace,
        laws: Sequence[ContactLaw] | ContactLaws,
        mode: Mode = "patchwise",
        *,
        crown: Callable[[Array, Array], Array] | None = None,
        friction: Friction | None = None,
        opposite: Material | None = None,
    ) -> None:
        if len(laws) != face.patches.count:
            raise InputError(
                "every patch needs a law", value=len(laws), allowed=f"{face.patches.count}"
            )
        self._face, self._sampling = face, face.sampling(mode)
        body, sampling = face.body, self._sampling
        self._undeformed_gap = together(face.comm, lambda: sampling.below(crown))
        self._flat_gap = self._undeformed_gap
        self._opposite = None
        if opposite is not None:
            self._opposite = OppositeHalfSpace(sampling, face.patches.lengths, opposite)
        self._preload: Array | None = None
        self._flat_preload: Array = np.zeros((len(sampling.weight), 2))
        self.forces = contact_forces(face, mode, laws, self._undeformed_gap, friction)
        self.equilibrium = Equilibrium(body, self.forces)
        self._preconditioner = ContactPreconditioner(
            self.equilibrium, face if mode == "pointwise" else None, sampling, body.solver
        )
        options = None if friction is None else UNSYMMETRIC
        self.newton = Newton(self.equilibrium, self._preconditioner, options)
        update = self._preconditioner.update
        layer = None
        if mode == "pointwise":
            layer = FaceLayer(self.equilibrium, sampling, face.points_by_dofs)
        self._first_steps = FirstSteps(self.equilibrium, sampling, update, layer)
        condensed = " or, on a very soft body, coupling.newton = 'condensed'"
        steps = "take more load steps (load.steps)"
        self._remedies = {"": steps + condensed if mode == "patchwise" else steps}
        self.basis = DisplacementBasis(self.equilibrium, self._sampling)
        self._plane: Array = np.zeros(3)
        self._closure: Array = np.zeros(len(self._sampling.weight))

    def solve(self, control: Control) -> FaceEquilibrium:
        """Find the equilibrium of one load step.

        A force and a moment of zero are met to `geometry.plane_equilibrium.TOLERANCE`. Without
        any force the plane touches the highest patch, with the prescribed tilt or the last one.

        Args:
            control: What is prescribed of the plane.

        Raises:
            NotConverged: When Newton's method fails, or nothing can hold the plane; the earlier
                solutions stay what they were, so that a smaller step can be tried.
        """
        self._load_bodies(control.body_state)
        if control.tilt is None and control.force:
            control = replace(control, moment=self._face.pull_moments(control.body_state))
        if self._opposite is None or control.force == 0.0:
            self.forces.gap = self._flat_gap
            return self._solved(control)
        contact, what = _Pressed(self, control), f"the half-space at {control}"
        if isinstance(self.forces, FrictionalForces):
            self._shear(self._opposite, contact, self.forces, what)
        else:
            self._opposite.follow(contact, what)
        return contact.state

    def _shear(
        self,
        opposite: OppositeHalfSpace,
        contact: _Pressed,
        forces: FrictionalForces,
        what: str,
    ) -> None:
        """Find the equilibrium beside a half-space that shear stresses displace as well."""
        preload = self._flat_preload

        def remaining(sheared: Array) -> Array:
            along_x, along_y, wider = (opposite.at_samples(part) for part in sheared)
            forces.preload = preload + np.stack([along_x, along_y], axis=1)
            contact.wider = wider
            opposite.follow(contact, what)
            state = contact.latest
            assert state.shear is not None
            found = opposite.by_shear(state.shear.sample_stress, state.sample_pressure)
            return found - sheared

        opposite.shear(remaining, what)

    def _solved(self, control: Control) -> FaceEquilibrium:
        """Find the equilibrium in the gap as it is; see `solve`."""
        equilibrium = self.equilibrium
        self.forces.prescribe(control, self._plane)
        started = 0 if len(self.basis) else self._start()
        solution = equilibrium.body.stiffness.createVecRight()
        residuals, spent = self._first_steps.take(self.newton.snes.ksp, solution, self.basis)
        report = self.newton.solve(solution, f"the block at {control}", self._remedies)
        self._closure, body = self.forces.closure(solution), equilibrium.body
        shear = self._accepted(solution)
        self.basis.add(solution, self.forces.pressure(self._closure))
        self._plane = self.forces.plane.copy()
        state = self.forces.state(
            self._closure,
            displacement=solution.array_r + (0.0 if self._preload is None else self._preload),
            reaction=body.reaction(solution),
            iterations=len(residuals) + report.iterations,
            linear_iterations=started + spent + report.linear_iterations,
            residuals=np.concatenate([residuals, report.residuals]),
            reason=report.reason,
            shear=shear,
        )
        compat.collect_garbage(solution.comm)
        return state

    def _accepted(self, solution: PETSc.Vec) -> FaceShear | None:
        """Move sliders on to a solution, and return its shear; None without friction."""
        forces = self.forces
        if not isinstance(forces, FrictionalForces):
            return None
        shear = forces.accept(self._closure, solution)
        self._stuck = shear.stuck
        return shear

    @property
    def sampling(self) -> Sampling:
        """Where the laws are evaluated."""
        return self._sampling

    @property
    def memory(self) -> SliderMemory | None:
        """What the load steps so far left behind of friction; set it to take load steps back."""
        return self.forces.memory if isinstance(self.forces, FrictionalForces) else None

    @memory.setter
    def memory(self, memory: SliderMemory | None) -> None:
        if isinstance(self.forces, FrictionalForces) and memory is not None:
            self.forces.memory = memory

    def slider_record(self) -> SliderRecord | None:
        """Return what the load steps so far left behind of friction, of all ranks together."""
        return self.forces.record() if isinstance(self.forces, FrictionalForces) else None

    def restore_sliders(self, record: SliderRecord) -> None:
        """Go on from what load steps left behind, on any number of ranks.

        Args:
            record: What `slider_record` returned.

        Raises:
            InputError: When it is that of another face, or of other laws.
        """
        assert isinstance(self.forces, FrictionalForces)
        self.forces.restore(record)

    def follow_sliders(self, other: LawContactProblem) -> None:
        """Go on from what load steps left behind under other laws on the same face.

        Args:
            other: The problem with these laws.
        """
        mine, theirs = self.forces, other.forces
        if isinstance(mine, FrictionalForces) and isinstance(theirs, FrictionalForces):
            mine.follow(theirs)

    def tangential_stiffness(self) -> tuple[float, int]:
        """Return the derivative of the shear force along the plane's shift, body included [N/mm].

        The shift changes on in the direction of its last change, under what else is prescribed of
        the plane. Springs that stick follow it, those that slip keep their stresses.

        Returns:
            The derivative, and the linear iterations that it took.

        Raises:
            NotConverged: When the linear solve fails.

        Note:
            Collective; one linear solve, or some against a half-space.
        """
        forces, equilibrium = self.forces, self.equilibrium
        assert isinstance(forces, FrictionalForces)
        stuck, ahead = self._stuck, forces.memory.direction
        forces.linearise_sticking(forces.stiffness(self._closure), stuck)
        self._preconditioner.update()
        load, moved = equilibrium.matrix.createVecLeft(), equilibrium.matrix.createVecRight()
        solver, iterations = self.newton.snes.ksp, 0
        solver.setOperators(equilibrium.tangent, equilibrium.matrix)
        solver.setTolerances(rtol=_STIFFNESS)

        def stresses(way: Array) -> Array:
            nonlocal iterations
            stress = stuck[:, None] * way
            forces.write_stresses(np.zeros(len(stress)), stress, load)
            iterations += solve_linear(solver, load, moved) if load.norm() else 0
            return np.asarray(stress - stuck[:, None] * forces.along(moved))

        way = np.broadcast_to(ahead, (len(stuck), 2))
        if self._opposite is not None:
            way = way - self._opposite.moved_along(lambda part: stresses(way - part))
        total = float(forces.total(stresses(way)) @ ahead)
        compat.collect_garbage(load.comm)
        return total, iterations

    def sticking_stiffness(self) -> float:
        """Return the tangential stiffness of what sticks, without the body [N/mm]; collective."""
        forces = self.forces
        assert isinstance(forces, FrictionalForces)
        return float(forces.total(self._stuck[:, None])[0])

    def start_from(self, pressure: Array) -> None:
        """Take the displacements by mean pressures of the patches for the latest solution.

        Shear stresses are those of the latest load step.

        Args:
            pressure: Pressures, shape (N,) [MPa].

        Note:
            Collective; one linear solve.
        """
        if pressure.any():
            samples = pressure[self._sampling.patch]
            self.basis.add(self._displacement(samples, sheared=True)[0], samples)

    def start_at(self, displacement: Array, plane: RigidPlane, body_state: float = 0.0) -> None:
        """Take a displacement for the latest solution, such as that on other elements.

        Args:
            displacement: This rank's owned displacements, preload included, shape (n,) [mm].
            plane: The plane there.
            body_state: Position among the states of what else loads the bodies, see `Control`.

        Note:
            Collective.
        """
        self._load_bodies(body_state)
        start = self.equilibrium.body.stiffness.createVecRight()
        start.array[:] = displacement - (0.0 if self._preload is None else self._preload)
        self._plane = np.array([plane.approach, *plane.tilt])
        self.forces.prescribe(Control(approach=plane.approach, tilt=plane.tilt), self._plane)
        self.basis.add(start, self.forces.pressure(self.forces.closure(start)))

    def same_approach(self) -> Control:
        """Return what prescribes the latest plane by its approach; it turns where it was free."""
        approach, *slopes = map(float, self._plane)
        control = self.forces.control
        tilt = None if control.tilt is None else (slopes[0], slopes[1])
        return replace(control, approach=approach, force=None, tilt=tilt)

    def approach_response(self) -> ApproachResponse:
        """Return what the latest equilibrium changes with the approach, to first order.

        The plane turns with it where it is free to, so that its moments stay.

        Raises:
            NotConverged: When the linear solve fails.

        Note:
            Collective; one linear solve, or some against a half-space.
        """
        forces, sampling, opposite = self.forces, self._sampling, self._opposite
        forces.prescribe(self.same_approach(), self._plane)
        stiffness = forces.stiffness(self._closure)
        forces.linearise(stiffness)
        self._preconditioner.update()
        way = np.ones_like(sampling.weight)
        change, _ = self._closed_in(way)
        if opposite is not None:
            contact = _Pressed(self, self.forces.control)
            moved = opposite.followed(opposite.under(change), contact, _RESPONSE)
            change, _ = self._closed_in(way - opposite.at_samples(moved))
        closing = np.divide(change, stiffness, out=np.zeros_like(change), where=stiffness > 0.0)
        return ApproachResponse(float(forces.loads(change)[0]), closing, self._closure, sampling)

    def _closed_in(self, way: Array, tolerance: float = _LINEAR) -> tuple[Array, int]:
        """Return the change of pressures where samples close in, shapes (n,), to first order.

        Args:
            way: What they close in by [mm].
            tolerance: Relative residual of the linear solve.

        Returns:
            The change, and the linear iterations that it took.
        """
        forces, sampling, equilibrium = self.forces, self._sampling, self.equilibrium
        load, moved = equilibrium.matrix.createVecLeft(), equilibrium.matrix.createVecRight()
        risen = forces.pressure_change(sampling.weight * way)
        sampling.values.array[:] = risen
        sampling.operator.mult(sampling.values, load)
        solver = self.newton.snes.ksp
        solver.setOperators(equilibrium.tangent, equilibrium.matrix)
        solver.setTolerances(rtol=tolerance)  # Newton's method sets its own for every solve
        iterations = solve_linear(solver, load, moved)
        sampling.operator.multTranspose(moved, sampling.values)
        change = risen - forces.pressure_change(sampling.values.array_r.copy())
        compat.collect_garbage(load.comm)
        return np.asarray(change), iterations

    def _load_bodies(self, state: float) -> None:
        """Let the bodies take the displacements of their other loads, and the gap with them."""
        body = self.equilibrium.body
        self._preload = body.preload(state)
        if self._preload is not None:
            moved = body.stiffness.createVecRight()
            moved.array[:] = self._preload
            self.forces.gap = self._undeformed_gap + self._sampling.displacements(moved)
            self._flat_gap = self.forces.gap
            if isinstance(self.forces, FrictionalForces):
                self._flat_preload = self.forces.preload = self.forces.along(moved)

    def _start(self) -> int:
        """Add the displacement by a uniform pressure to the basis, and return the iterations."""
        samples = np.ones(len(self._sampling.weight))
        displacement, iterations = self._displacement(samples, _ROUGHLY)
        self.basis.add(displacement, samples, solved=False)
        return iterations

    def _displacement(
        self, pressure: Array, tolerance: float | None = None, *, sheared: bool = False
    ) -> tuple[PETSc.Vec, int]:
        """Solve for the displacement by pressures of this rank's samples, and the latest shear."""
        body, sampling = self.equilibrium.body, self._sampling
        load = body.stiffness.createVecLeft()
        sampling.values.array[:] = pressure
        sampling.operator.mult(sampling.values, load)
        displacement = load.duplicate()
        if sheared:
            self.forces.write_last_shear(displacement)
            load.axpy(1.0, displacement)
        return displacement, solve_linear(body.solver, load, displacement, tolerance=tolerance)

    def patch_means(self, function: Callable[[Indices, Array], Array]) -> Array:
        """Average a function of closure over the patches, at the latest equilibrium.

        Args:
            function: Takes patch indices and closures of samples, shape (n,) [mm], and returns a
                value for each.

        Returns:
            The means over the samples of each patch, shape (N,).

        Raises:
            Exception: What the function raises on one rank, on every rank.

        Note:
            Collective.
        """
        sampling = self._sampling
        values = together(self._face.comm, lambda: function(sampling.patch, self._closure))
        return sampling.patch_sums(values) / self._face.areas

    def patch_largest(self, function: Callable[[Indices, Array], Array]) -> Array:
        """Return the largest values of a function of closure on the patches, see `patch_means`.

        Args:
            function: The function; not below zero.

        Returns:
            The largest values at the samples of each patch, shape (N,).

        Note:
            Collective.
        """
        sampling, largest = self._sampling, np.zeros(self._sampling.count)
        np.maximum.at(largest, sampling.patch, function(sampling.patch, self._closure))
        return np.asarray(np.max(self._face.comm.allgather(largest), axis=0))


class _Pressed:
    """A load step of a problem beside a half-space, see `opposite_half_space.Contact`."""

    def __init__(self, problem: LawContactProblem, control: Control) -> None:
        self._problem, self._control, self._memory = problem, control, problem.memory
        self._found: list[FaceEquilibrium] = []
        self._sunk: Array = np.zeros_like(problem._flat_gap)
        self._iterations = 0
        self.wider: Array | float = 0.0  # gaps of samples, by shear stresses [mm]

    @property
    def latest(self) -> FaceEquilibrium:
        """The latest state alone."""
        return self._found[-1]

    def pressed(self, moved: Array) -> Array:
        """Solve the load step anew, from what friction left behind before it."""
        problem, forces = self._problem, self._problem.forces
        problem.memory = self._memory
        forces.gap = problem._flat_gap + moved + self.wider
        state = problem._solved(self._control)
        self._sunk = forces.levers.matrix @ problem._plane - forces.gap - state.sample_closure
        self._found.append(state)
        return state.sample_pressure

    def held(self, moved: Array) -> Array:
        """Return the pressures on the body as it is displaced now."""
        forces = self._problem.forces
        forces.gap = self._problem._flat_gap + moved + self.wider
        closure = forces.closure_of(self._sunk)
        forces.linearise(forces.stiffness(closure))
        return forces.pressure(closure)

    def closed_in(self, way: Array, tolerance: float) -> Array:
        """Return the change of pressures where samples close in."""
        change, iterations = self._problem._closed_in(way, tolerance)
        self._iterations += iterations
        return change

    def alone(self, way: Array, softer: float = 0.0) -> Array:
        """Return that on a rigid body, or on a local compliance."""
        forces, weight = self._problem.forces, self._problem._sampling.weight
        stiffness = forces.normal_slope * weight
        stiffness = stiffness / (1.0 + softer * stiffness)
        border = forces.border(stiffness)
        change = stiffness * way
        if border.shape[1]:
            change -= border @ forces.levers.summed(border.T @ (weight * way))
        return np.asarray(change)

    @property
    def state(self) -> FaceEquilibrium:
        """The latest state, with the iterations of all."""
        return replace(
            self._found[-1],
            iterations=sum(one.iterations for one in self._found),
            linear_iterations=self._iterations + sum(one.linear_iterations for one in self._found),
        )
