"""A body with contact laws on a face, under a rigid plane: one load step at a time.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from petsc4py import PETSc

from patchlaw.geometry.rigid_plane import Control, RigidPlane, ShearControl
from patchlaw.geometry.spring_bed import Friction
from patchlaw.macro import compat
from patchlaw.macro.contact.contact_forces import ContactForces
from patchlaw.macro.contact.contact_response import ApproachResponse, ContactResponse
from patchlaw.macro.contact.face_equilibrium import FaceEquilibrium, checked_reaction
from patchlaw.macro.contact.initial_guess import DisplacementBasis, FirstSteps
from patchlaw.macro.contact.loaded_face import ContactFace, Mode
from patchlaw.macro.contact.newton import ContactPreconditioner, Equilibrium, Newton
from patchlaw.macro.contact.pressed_plane import ContactLaw, ContactLaws
from patchlaw.macro.linear_solvers.options import UNSYMMETRIC
from patchlaw.macro.linear_solvers.solvers import solve_linear
from patchlaw.support.arrays import Array, Indices
from patchlaw.support.errors import InputError
from patchlaw.support.parallel import together

_ROUGHLY = 1e-3
"""Relative residual of the displacements under a uniform pressure, the first initial guess."""

_REMEDIES = {"": "take more load steps (load.steps)"}


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
        friction: Friction of the face, or of each law, whose sliders move on with every load step
            that converges; None: none. Tangents are unsymmetric with it, and GMRES solves for them.

    Attributes:
        sampling: Where the laws are evaluated.
        sliders: The sliders of the face, with what load steps left behind; None without friction.

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
        friction: Friction | Sequence[Friction] | None = None,
    ) -> None:
        if len(laws) != face.patches.count:
            raise InputError(
                "every patch needs a law", value=len(laws), allowed=f"{face.patches.count}"
            )
        self._face = face
        self._preload: Array | None = None
        self.forces = ContactForces(face, mode, laws, crown, friction)
        self.sampling, self.sliders = self.forces.sampling, self.forces.sliders
        self._undeformed_gap = self.forces.gap
        self.equilibrium = Equilibrium(face.body, self.forces)
        self._preconditioner = ContactPreconditioner(self.equilibrium)
        options = None if friction is None else UNSYMMETRIC
        self.newton = Newton(self.equilibrium, self._preconditioner, options)
        self._response = ContactResponse(self.equilibrium, self._preconditioner, self.newton)
        self.basis = DisplacementBasis(self.equilibrium)
        self._first_steps = FirstSteps(self.equilibrium, self.basis, self._preconditioner.update)
        self._guess: PETSc.Vec | None = None
        self._plane: Array = np.zeros(3)
        self._closure: Array = np.zeros(len(self.sampling.weight))

    def solve(self, control: Control, wearing: Array | None = None) -> FaceEquilibrium:
        """Find the equilibrium of one load step.

        A force and a moment of zero are met to `geometry.rigid_plane.TOLERANCE`. Without
        any force the plane touches the highest patch, with the prescribed tilt or the last one.

        Args:
            control: What is prescribed of the plane.
            wearing: Depth that wears off meanwhile over the pressure at the end of the step, of
                this rank's samples, shape (n,) [mm/MPa]; None: nothing wears.

        Raises:
            NotConverged: When Newton's method fails, or nothing can hold the plane; the earlier
                solutions stay what they were, so that a smaller step can be tried.
        """
        self.forces.wearing = wearing
        try:
            return self._pressed(control)
        finally:
            self.forces.wearing = None

    def _pressed(self, control: Control) -> FaceEquilibrium:
        self._load_bodies(control.body_state)
        if control.tilt is None and control.force:
            control = replace(control, moment=self._face.pull_moments(control.body_state))
        self.forces.prescribe(control, self._plane)
        state, displacement = self._solved(control)
        reaction = self._checked_reaction(control, state, displacement)
        self._closure, self._plane = state.sample_closure, self.forces.plane.copy()
        self.basis.add(displacement, state.sample_pressure, self.forces.last_shear)
        moved = displacement.array_r.copy()
        compat.collect_garbage(displacement.comm)
        return replace(state, displacement=self._with_preload(moved), reaction=reaction)

    def _solved(self, control: Control) -> tuple[FaceEquilibrium, PETSc.Vec]:
        """Find the equilibrium in the gap as it is, and the displacements; see `solve`."""
        equilibrium = self.equilibrium
        started = 0 if len(self.basis) else self._start()
        solution = equilibrium.body.stiffness.createVecRight()
        what = f"the block at {control}"
        report = self.newton.solve(solution, what, _REMEDIES, self._first_steps)
        closure = self.forces.closure(solution)
        state = self.forces.state(
            closure,
            iterations=report.iterations,
            linear_iterations=started + report.linear_iterations,
            residuals=report.residuals,
            reason=report.reason,
            shear=self.forces.accept(closure, solution),
        )
        self.forces.wear_off(closure)
        return state, solution

    def _checked_reaction(
        self, control: Control, state: FaceEquilibrium, displacement: PETSc.Vec
    ) -> float:
        """Return what the supports of the body bear, see `macro.contact.face_equilibrium`."""
        shear = state.shear
        stress = np.zeros((len(state.sample_pressure), 0)) if shear is None else shear.sample_stress
        load, on_supports = displacement.duplicate(), displacement.duplicate()
        self.forces.write_stresses(state.sample_pressure, stress, load)
        self.forces.write_on_supports(state.sample_pressure, stress, on_supports)
        return checked_reaction(
            self._face,
            displacement,
            load,
            on_supports,
            force=state.force,
            shear=(0.0, 0.0) if shear is None else shear.force,
            tolerance=self.newton.snes.getTolerances()[0],
            what=f"the body at {control}",
            iterations=state.iterations,
        )

    def _with_preload(self, displacement: Array) -> Array:
        return displacement if self._preload is None else displacement + self._preload

    def tangential_stiffness(self) -> tuple[float, int]:
        """Return the slope of the shear force over the plane's shift, body included [N/mm].

        The shift changes on in the direction of its last change, under what else is prescribed of
        the plane.

        Returns:
            The slope, NaN where it is not found, and the linear iterations that it took.

        Raises:
            NotConverged: When the linear solve fails.

        Note:
            Collective; a few linear solves.
        """
        return self._response.to_shift(self._closure)

    def interface_stiffness(self) -> float:
        """Return the tangential stiffness of the laws, without the body [N/mm]; collective."""
        assert self.sliders is not None
        by_slip = self._response.interface_to_shift(self._closure).by_slip
        ahead = self.sliders.memory.direction
        return float(ahead @ self.sliders.total(by_slip.reshape(-1, 4)).reshape(2, 2) @ ahead)

    def start_from(self, pressure: Array) -> None:
        """Take the displacements by mean pressures of the patches for the latest solution.

        Shear stresses are those of the latest load step.

        Args:
            pressure: Pressures, shape (N,) [MPa].

        Note:
            Collective; one linear solve.
        """
        if pressure.any():
            samples = pressure[self.sampling.patch]
            displacement, _ = self._displacement(samples, shear=self.forces.last_shear)
            self.basis.add(displacement, samples, self.forces.last_shear)

    def displacement_under(self, pressure: Array, shear: Array, body_state: float) -> Array:
        """Return the displacements of the body under stresses of the samples and its other loads.

        Args:
            pressure: Pressures of this rank's samples, shape (n,) [MPa].
            shear: Shear stresses along the axes of the face, shape (n, 2), without friction (n, 0)
                [MPa].
            body_state: Position among the states of what else loads the bodies, see `Control`.

        Returns:
            This rank's owned displacements, shape (m,) [mm].

        Note:
            Collective; one linear solve.
        """
        self._load_bodies(body_state)
        displacement, _ = self._displacement(pressure, shear=shear)
        return self._with_preload(displacement.array_r.copy())

    def start_at(self, displacement: Array, plane: RigidPlane, body_state: float = 0.0) -> None:
        """Take a displacement for the latest solution, such as that on other elements.

        Args:
            displacement: This rank's owned displacements, preload included, shape (n,) [mm].
            plane: The plane there.
            body_state: Position among the states of what else loads the bodies, see `Control`.

        Note:
            Collective.
        """
        start, closure = self._at(displacement, plane, body_state)
        self._guess = start
        self.basis.add(start, self.forces.pressure(closure), self.forces.last_shear)

    def _at(
        self,
        displacement: Array,
        plane: RigidPlane,
        body_state: float,
        shear: ShearControl | None = None,
    ) -> tuple[PETSc.Vec, Array]:
        """Return a displacement without preload and the closures there, as `start_at` takes it."""
        self._load_bodies(body_state)
        start = self.equilibrium.body.stiffness.createVecRight()
        start.array[:] = displacement - (0.0 if self._preload is None else self._preload)
        self._plane = np.array([plane.approach, *plane.tilt])
        control = Control(approach=plane.approach, tilt=plane.tilt, shear=shear)
        self.forces.prescribe(control, self._plane)
        return start, self.forces.closure(start)

    def forces_at(self, known: FaceEquilibrium, body_state: float, to: ApproachResponse) -> Array:
        """Return what the laws bear at the displacements of a contact on the same elements.

        Pressures are weighted by how closures change with the approach. Their sum on other samples
        is larger by what the force under the approach is, to first order. Shear stresses follow the
        sliders as they are.

        Args:
            known: The contact.
            body_state: Position among the states of the bodies' loads there, see `Control`.
            to: Its response to the approach.

        Returns:
            The weighted force and, with friction, the shear force, shape (1,) or (3,) [N].

        Note:
            Collective.
        """
        shear = None if known.shear is None else ShearControl(shift=known.shear.shift)
        control = self.forces.control
        moved, closure = self._at(known.displacement, known.plane, body_state, shear)
        weight, levers = self.sampling.weight, self.forces.levers
        closing = levers.matrix @ to.way - self.sampling.displacements(to.moved)
        found = [weight @ (closing * self.forces.pressure(closure))]
        if (response := self.forces.respond(closure, moved)) is not None:
            found += (weight @ response.stress).tolist()
        self.forces.prescribe(control, self._plane)
        return np.asarray(levers.summed(np.array(found)))

    def changed_by(self, stresses: Array) -> tuple[float, Array]:
        """Return what further stresses change at the latest equilibrium, to first order.

        Args:
            stresses: Pressures and shear stresses beside those of the laws at this rank's samples,
                shape (n, 3) [MPa].

        Returns:
            The changes of the force and, shape (2,), of the shear force, under a plane that stays
            where it is [N].

        Raises:
            NotConverged: When the linear solve fails.

        Note:
            Collective; one linear solve.
        """
        control = self.forces.control
        approach, *slopes = map(float, self._plane)
        held = Control(approach=approach, tilt=(slopes[0], slopes[1]))
        self.forces.prescribe(held, self._plane)
        try:
            return self._response.to_stresses(self._closure, stresses)
        finally:
            self.forces.prescribe(control, self._plane)

    def gone_in_parts(self, parts: int) -> tuple[Array, Array]:
        """Return what load steps in parts lead to; see `FaceSliders.gone_in_parts`."""
        assert self.sliders is not None
        return self.sliders.gone_in_parts(self.forces.pressure, self.forces.stiffness, parts)

    def first_order_force(self, control: Control) -> float:
        """Return the force under a plane that stays, to first order from the latest guess [N].

        Args:
            control: What is prescribed of the plane: its approach.

        Raises:
            NotConverged: When the linear solve fails.

        Note:
            Collective; one linear solve, of Newton's first step without friction.
        """
        self.forces.prescribe(control, self._plane)
        assert self._guess is not None
        return self._response.to_residual(self._guess)

    def go_back_to(self, state: FaceEquilibrium) -> None:
        """Take an earlier equilibrium of this problem for the latest one, with what had worn off.

        Args:
            state: The equilibrium.
        """
        self._closure, self.forces.worn = state.sample_closure, state.sample_worn_depth
        self._plane = np.array([state.approach, *state.tilt])
        self.forces.prescribe(self.forces.control, self._plane)

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
            Collective; one linear solve.
        """
        self.forces.prescribe(self.same_approach(), self._plane)
        return self._response.to_approach(self._closure)

    def approach_rates(self) -> tuple[Array, float, int]:
        """Return changes of this rank's closures with the approach, (n,), and dF/dδ [N/mm].

        The last is the number of linear iterations.

        Closures of samples without pressure count as well. The plane turns where it was free to.

        Raises:
            NotConverged: When a linear solve fails.

        Note:
            Collective; one linear solve, and two more where the plane turns.
        """
        control = self.forces.control
        approach, *slopes = map(float, self._plane)
        held = Control(approach=approach, tilt=(slopes[0], slopes[1]))
        self.forces.prescribe(held, self._plane)
        try:
            return self._response.to_motions(self._closure, turns=control.tilt is None)
        finally:
            self.forces.prescribe(control, self._plane)

    def _load_bodies(self, state: float) -> None:
        """Let the bodies take the displacements of their other loads, and the gap with them."""
        body = self.equilibrium.body
        self._preload = body.preload(state)
        if self._preload is not None:
            moved = body.stiffness.createVecRight()
            moved.array[:] = self._preload
            samples = self.forces.with_supports(moved)
            self.forces.gap = self._undeformed_gap + samples[:, 0]
            if self.sliders:
                self.sliders.preload = samples[:, 1:]

    def _start(self) -> int:
        """Add the displacement by a uniform pressure to the basis, and return the iterations."""
        samples = np.ones(len(self.sampling.weight))
        displacement, iterations = self._displacement(samples, _ROUGHLY)
        unsheared = np.zeros_like(self.forces.last_shear)
        self.basis.add(displacement, samples, unsheared, solved=False)
        return iterations

    def _displacement(
        self, pressure: Array, tolerance: float | None = None, *, shear: Array | None = None
    ) -> tuple[PETSc.Vec, int]:
        """Solve for the displacement by pressures and shear stresses of this rank's samples."""
        body = self.equilibrium.body
        load = body.stiffness.createVecLeft()
        none = np.zeros((len(pressure), self.forces.directions - 1))
        self.forces.write_stresses(pressure, none if shear is None else shear, load)
        displacement = load.duplicate()
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
        sampling = self.sampling
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
        sampling, largest = self.sampling, np.zeros(self.sampling.count)
        np.maximum.at(largest, sampling.patch, function(sampling.patch, self._closure))
        return np.asarray(np.max(self._face.comm.allgather(largest), axis=0))
