"""A body with contact laws on a face, under a rigid plane: load steps, and what changes them.

What an equilibrium changes with motions of the plane and with stresses, to first order, takes the
linear solver of Newton's method.

Theory: sections 11 and 15 of ``docs/theory.md``.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import Control, Friction, RigidPlane, ShearControl
from patchlaw.geometry.sliders import SliderRecord, SliderResponse
from patchlaw.macro import compat
from patchlaw.macro.contact.contact_forces import ContactForces
from patchlaw.macro.contact.face_equilibrium import FaceEquilibrium, checked_reaction
from patchlaw.macro.contact.face_laws import ContactLaw, ContactLaws, Sampling
from patchlaw.macro.contact.face_sliders import FaceSliders, ShearLines
from patchlaw.macro.contact.initial_guess import DisplacementBasis, FirstSteps
from patchlaw.macro.contact.loaded_face import ContactFace, Mode
from patchlaw.macro.contact.newton import ContactPreconditioner, Equilibrium, Newton
from patchlaw.macro.contact.pressed_plane import Lines, Prediction
from patchlaw.macro.linear_solvers.node_matrices import Stiffened, springs_at
from patchlaw.macro.linear_solvers.options import UNSYMMETRIC
from patchlaw.macro.linear_solvers.selection import from_vertices
from patchlaw.macro.linear_solvers.solvers import solve_linear, solved_among
from patchlaw.support import Array, Indices, InputError, together

_ROUGHLY = 1e-3
"""Relative residual of the displacements under a uniform pressure, the first initial guess."""

_REMEDIES = {"": "take more load steps (load.steps)"}

_LINEAR, _STIFFNESS = 1e-9, 1e-8
"""Relative residuals of the response to the approach, and of displacements by the shift."""
_OF_CHANGE = 1e-8
"""Residual of what linear elements have left over what quadratic ones changed. An error is told to
1 % with 1e-4, but depends on the number of ranks then."""
_BEYOND = 4
"""Steps for displacements that linear elements do not have: within 4 % of what 40 tell of a force
on 20 random bodies, which is 0.70 to 1.00 of what quadratic elements change."""
_SMALL, _SAME, _MOST_SETS = 1e-6, 1e-6, 12
"""Step that tells which springs slip, over the largest slip; change of the slope at which they are
found; and solutions for it at most."""


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
        moved: Displacements of the body with the approach, a vector of PETSc.
        way: What motions of the plane, 1, x − xc and y − yc, go with it, shape (3,).
        iterations: Linear iterations that it took.
    """

    stiffness: float
    closing: Array
    closure: Array
    sampling: Sampling
    moved: PETSc.Vec
    way: Array
    iterations: int

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
        friction: Friction of the face, or of each law, whose sliders move on with every load step
            that converges; None: none. Tangents are unsymmetric with it, and GMRES solves for them.

    Attributes:
        face: The patches.
        sampling: Where the laws are evaluated.
        sliders: The sliders of the face, with what load steps left behind; None without friction.
        stated: What the latest load step prescribes, without the moments of what pulls the body.

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
        self.face = face
        self._preload: Array | None = None
        self.stated = Control(approach=0.0)
        self.forces = ContactForces(face, mode, laws, crown, friction)
        self.sampling, self.sliders = self.forces.sampling, self.forces.sliders
        self._undeformed_gap = self.forces.gap
        self.equilibrium = Equilibrium(face.body, self.forces)
        self._preconditioner = ContactPreconditioner(self.equilibrium)
        options = None if friction is None else UNSYMMETRIC
        self.newton = Newton(self.equilibrium, self._preconditioner, options)
        self.basis = DisplacementBasis(self.equilibrium)
        self._first_steps = FirstSteps(self.equilibrium, self.basis, self._preconditioner.update)
        self._guess: PETSc.Vec | None = None
        self._plane: Array = np.zeros(3)
        self._closure: Array = np.zeros(len(self.sampling.weight))
        # at the latest equilibrium, which its closures tell from others
        self._response: ApproachResponse | None = None
        self._tangential: tuple[tuple[Array, SliderRecord], tuple[float, int]] | None = None

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
        self.stated, forces = control, self.forces
        control = self._with_pulls(control)
        forces.prescribe(control, self._plane)
        started = 0 if len(self.basis) else self._start()
        solution = self.equilibrium.body.stiffness.createVecRight()
        what = f"the block at {control}"
        report = self.newton.solve(solution, what, _REMEDIES, self._first_steps)
        closure = forces.closure(solution)
        state = forces.state(
            closure,
            iterations=report.iterations,
            linear_iterations=started + report.linear_iterations,
            residuals=report.residuals,
            reason=report.reason,
            shear=forces.shear_state(closure, solution),
        )
        reaction = self._checked_reaction(control, state, solution)
        forces.accept(closure, solution)
        self._closure, self._plane = state.sample_closure, forces.plane.copy()
        self.basis.add(solution, state.sample_pressure, forces.last_shear)
        moved = solution.array_r.copy()
        compat.collect_garbage(solution.comm)
        return replace(state, displacement=self._with_preload(moved), reaction=reaction)

    def _with_pulls(self, control: Control) -> Control:
        """Return a control with the moments of what pulls the body, where the plane turns."""
        if not control.free[1:].any():
            return control
        x, y = np.add(control.moment, self.face.pull_moments(control.body_state)).tolist()
        return replace(control, moment=(x, y))

    def _checked_reaction(
        self, control: Control, state: FaceEquilibrium, displacement: PETSc.Vec
    ) -> float:
        """Return what the supports of the body bear, see `macro.contact.face_equilibrium`."""
        stress = None if (shear := state.shear) is None else shear.sample_stress
        load, on_supports = displacement.duplicate(), displacement.duplicate()
        self.forces.write_stresses(state.sample_pressure, stress, load)
        self.forces.write_on_supports(state.sample_pressure, stress, on_supports)
        return checked_reaction(
            self.face,
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

    def start_from(self, pressure: Array, tolerance: float | None = None) -> None:
        """Take the displacements by pressures of the samples for the latest solution.

        Shear stresses are those of the latest load step.

        Args:
            pressure: Pressures of this rank's samples, shape (n,), not all 0 [MPa].
            tolerance: Relative residual; None: that of the body's solver.

        Note:
            Collective; one linear solve.
        """
        shear = self.forces.last_shear
        displacement, _ = self._displacement(pressure, tolerance, shear=shear)
        self.basis.add(displacement, pressure, shear)

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
        self._plane = plane.motion
        control = Control(approach=plane.approach, tilt=plane.tilt, shear=shear)
        self.forces.prescribe(control, self._plane)
        return start, self.forces.closure(start)

    def forces_at(
        self, known: FaceEquilibrium, body_state: float, to: ApproachResponse
    ) -> tuple[Array, Array]:
        """Return what the laws bear at the displacements of a contact on the same elements.

        Pressures are weighted by how closures change with the approach. Their sum on other samples
        is larger by what the force under the approach is, to first order. Shear stresses follow the
        sliders as they are.

        Args:
            known: The contact.
            body_state: Position among the states of the bodies' loads there, see `Control`.
            to: Its response to the approach.

        Returns:
            The weighted force and, with friction, the shear force, shape (1,) or (3,) [N]; and the
            closures of this rank's samples there, shape (n,) [mm].

        Note:
            Collective.
        """
        shear = None if known.shear is None else ShearControl(shift=known.shear.shift)
        control = self.forces.control
        moved, closure = self._at(known.displacement, known.plane, body_state, shear)
        weight, levers = self.sampling.weight, self.forces.levers
        closing = self.closing_with(to.way, to.moved.array_r)
        found = [weight @ (closing * self.forces.pressure(closure))]
        if (response := self.forces.respond(closure, moved)) is not None:
            found += (weight @ response.stress).tolist()
        self.forces.prescribe(control, self._plane)
        return np.asarray(levers.summed(np.array(found))), closure

    def closing_with(self, way: Array, moved: Array) -> Array:
        """Return what a motion of the plane closes all samples of this rank by, shape (n,) [mm].

        Args:
            way: What it is of 1, x − xc and y − yc, shape (3,).
            moved: This rank's owned displacements with it, shape (m,) [mm].

        Note:
            Collective.
        """
        displacement = self.equilibrium.body.stiffness.createVecRight()
        displacement.array[:] = moved
        closing = self.forces.levers.matrix @ way - self.sampling.displacements(displacement)
        return np.asarray(closing)

    @property
    def past(self) -> Any:
        """What load steps left behind; set it to take them back.

        Plane, wear, friction, and what was prescribed, with the bodies' other loads.
        """
        return self.forces.past, self._closure, self._plane, self.stated

    @past.setter
    def past(self, past: Any) -> None:
        self.forces.past, self._closure, self._plane, self.stated = past
        self._load_bodies(self.stated.body_state)

    def go_back_to(self, state: FaceEquilibrium) -> None:
        """Take an earlier equilibrium of this problem for the latest one, with what had worn off.

        Args:
            state: The equilibrium.
        """
        self._closure, self.forces.worn = state.sample_closure, state.sample_worn_depth
        self._plane = state.plane.motion
        self.forces.prescribe(self.forces.control, self._plane)

    # --- first order changes of the latest equilibrium

    def same_approach(self) -> Control:
        """Return what prescribes the latest plane by its approach; it turns where it was free."""
        approach, *slopes = map(float, self._plane)
        control = self.stated
        tilt = None if control.tilt is None else (slopes[0], slopes[1])
        return replace(control, approach=approach, force=None, tilt=tilt)

    @contextmanager
    def _prescribed(self, control: Control) -> Iterator[None]:
        """Let something be prescribed of the latest plane for a while."""
        known = self.forces.control
        self.forces.prescribe(control, self._plane)
        try:
            yield
        finally:
            self.forces.prescribe(known, self._plane)

    def approach_response(self) -> ApproachResponse:
        """Return what the latest equilibrium changes with the approach, to first order.

        The plane turns with it where it is free to, so that its moments stay.

        Raises:
            NotConverged: When the linear solve fails.

        Note:
            Collective; one linear solve, and none where it is known.
        """
        if self._response is None or self._response.closure is not self._closure:
            with self._prescribed(self._with_pulls(self.same_approach())):
                self._response = self._approached()
        return self._response

    def _approached(self) -> ApproachResponse:
        forces, sampling, closure = self.forces, self.sampling, self._closure
        stiffness, load = self._linearised(), self.equilibrium.matrix.createVecLeft()
        sampling.values.array[:] = risen = forces.pressure_change(sampling.weight)
        sampling.operator.mult(sampling.values, load)
        moved, iterations = self._moved_by(load, _LINEAR)
        change = forces.pressure_change(sampling.weight * sampling.displacements(moved))
        change = risen - change
        closing = np.divide(change, stiffness, out=np.zeros_like(change), where=stiffness > 0.0)
        way = np.array([1.0, 0.0, 0.0])
        if forces.control.tilt is None:  # the plane turns so that closures change as they do
            levers = forces.levers.matrix[stiffness > 0.0]
            turned = (closing + sampling.displacements(moved))[stiffness > 0.0] - 1.0
            matrix = forces.levers.stiffness(sampling.weight * (stiffness > 0.0))[1:, 1:]
            sums = forces.levers.summed(levers.T @ (sampling.weight[stiffness > 0.0] * turned))
            way[1:] = np.linalg.lstsq(matrix, sums[1:], rcond=1e-12)[0]
        whole = float(forces.loads(change)[0])
        return ApproachResponse(whole, closing, closure, sampling, moved, way, iterations)

    def first_order_step(
        self, control: Control, lower: LawContactProblem, before: SliderRecord | None
    ) -> FaceEquilibrium:
        """Return how a load step ends, to first order from the latest guess.

        Args:
            control: What the load step prescribes.
            lower: The same problem on linear elements, whose solution the guess is.
            before: What load steps before it left behind of friction, on all ranks; None without.

        Raises:
            NotConverged: When the linear solve fails, or the shear force is not transmitted.

        Note:
            Collective; a few products with the tangent, and a linear solve on linear elements.
        """
        guess, moved, left, transfer = self._beyond_linear(control, lower)
        transfer.multAdd(lower._moved_from(before, control, left), moved, moved)
        closure = self.forces.closure(guess)
        guess.axpy(-1.0, moved)
        return self._end_on(self._lines_at(closure), guess)

    def step_on_lines(self, control: Control, other: LawContactProblem) -> FaceEquilibrium:
        """Return how a load step ends on fewer unknowns, to first order from where it ended.

        Laws and sliders are lines at the closures and slips of the same samples there.

        Args:
            control: What the load step prescribes.
            other: The same problem on more unknowns, at the end of the load step.

        Raises:
            NotConverged: When the linear solve fails, or the shear force is not transmitted.

        Note:
            Collective; one linear solve.
        """
        guess, shear = self._guess, None
        assert guess is not None
        self.forces.prescribe(self._with_pulls(control), self._plane)
        lines, residual = self._lines_at(other._closure), guess.duplicate()
        if self.sliders is not None:
            slip = other._rubbing.memory.path[:, -1, 1:]
            found = self.sliders.at_slip(*lines, slip)
            shear = ShearLines(slip, lines.closure, found.stress, found)
        self.equilibrium.linearise(guess, [Prediction(lines, 0.0, shear)], residual)
        self._preconditioner.update()
        guess.axpy(-1.0, self._moved_by(residual, _OF_CHANGE)[0])
        return self._end_on(lines, guess)

    def _lines_at(self, closure: Array) -> Lines:
        return Lines(closure, self.forces.pressure(closure), self.forces.stiffness(closure))

    def _end_on(self, lines: Lines, at: PETSc.Vec) -> FaceEquilibrium:
        """Return how a load step ends at displacements on laws that are lines."""
        forces, shear = self.forces, None
        closure = forces.closure_on_lines(self.sampling.displacements(at), lines)
        pressure = lines.at(closure)
        if self.sliders is not None:
            pressed = np.where(pressure > 0.0, pressure, forces.pressure(closure))  # springs touch
            found = self.sliders.respond(closure, forces.along(at), pressed, lines.stiffness)
            shear = self.sliders.step(found)[1]
        force = float(forces.loads(pressure)[0])
        return replace(forces.state(closure, shear=shear), force=force)

    def _beyond_linear(
        self, control: Control, lower: LawContactProblem
    ) -> tuple[PETSc.Vec, PETSc.Vec, PETSc.Vec, PETSc.Mat]:
        """Return what displacements that only quadratic elements have take of what is unbalanced.

        From a solution on linear elements these leave nothing out of balance. Few steps do at the
        nodes that they do not have (Bank 1996, Acta Numerica 5, 1-43, on hierarchical bases).

        Args:
            control: What is prescribed.
            lower: The same problem on linear elements.

        Returns:
            The latest guess, the displacements there by which it is too large, what is then out of
            balance on linear elements, and the interpolation from these.
        """
        forces, guess = self.forces, self._guess
        assert guess is not None
        forces.prescribe(self._with_pulls(control), self._plane)
        residual, between = guess.duplicate(), guess.duplicate()
        self.equilibrium.residual(guess, residual)
        self.equilibrium.update_tangent(guess)
        own, others = ([one.body for one in problem.face.sides] for problem in (self, lower))
        transfer = from_vertices(own, kept=others)
        between.array[:] = np.diff(transfer.getValuesCSR()[0]) > 1  # a vertex stays where it is
        body = self.equilibrium.body
        springs = springs_at(forces.points, forces.slope * (forces.mode == "pointwise"))
        blocks = Stiffened(body.stiffness, body.stiffnesses, springs).block_diagonal()
        moved, rest = solved_among(self.equilibrium.tangent, blocks, residual, between, _BEYOND)
        left = transfer.createVecRight()
        transfer.multTranspose(rest, left)
        return guess, moved, left, transfer

    def _moved_from(
        self, before: SliderRecord | None, control: Control, load: PETSc.Vec
    ) -> PETSc.Vec:
        """Return the displacements by a further load at the end of the latest load step.

        Args:
            before: What load steps before it left behind of friction, on all ranks; None without.
            control: What it prescribed.
            load: The load.
        """
        sliders, found = self.sliders, None
        if sliders is not None and before is not None:
            at, memory = self._lines_at(self._closure), sliders.memory
            try:
                sliders.restore(before)
                found = sliders.at_slip(*at, memory.path[:, -1, 1:])
            finally:
                sliders.memory = memory
        with self._prescribed(self._with_pulls(control)):
            self._linearised(found)
            return self._moved_by(load, _OF_CHANGE)[0]

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
        approach, *slopes = map(float, self._plane)
        with self._prescribed(Control(approach=approach, tilt=(slopes[0], slopes[1]))):
            self._rubbing.hold_shift()
            self._linearised(self._slipping_as_plane())
            change, _, _ = self._stressed(stresses[:, 0], stresses[:, 1:])
            return float(self.forces.loads(change[:, 0])[0]), self._rubbing.total(change[:, 1:])

    def tangential_stiffness(self) -> tuple[float, int]:
        """Return the slope of the shear force over the plane's shift, body included [N/mm].

        The shift changes on in the direction of its last change, under what else is prescribed of
        the plane. Springs at their bound slip on or come off it, as the slips and closures of their
        samples change. These follow from a linear problem with the springs that slip, which are
        told by a step so small that no others reach their bound, until they are the same.

        Returns:
            The slope, NaN where the springs that slip are not found, and the linear iterations.

        Raises:
            NotConverged: When the linear solve fails.

        Note:
            Collective; a few linear solves.
        """
        at = self._closure, self._rubbing.memory
        if self._tangential is None or any(map(operator.is_not, at, self._tangential[0])):
            self._tangential = at, self._tangential_stiffness()
            return self._tangential[1]
        return self._tangential[1][0], 0  # as known

    def _tangential_stiffness(self) -> tuple[float, int]:
        sliders, ahead = self._rubbing, self._rubbing.memory.direction
        sliders.hold_shift()
        found, before, iterations = self._slipping_as_plane(), np.inf, 0
        for _ in range(_MOST_SETS):
            stiffness = self._linearised(found)
            stress = found.by_slip @ ahead
            change, moved, used = self._stressed(np.zeros(len(stress)), stress)
            value, iterations = float(sliders.total(change[:, 1:]) @ ahead), iterations + used
            if abs(value - before) <= _SAME * abs(value):
                return value, iterations
            before, closing = value, np.zeros_like(stiffness)
            np.divide(change[:, 0], stiffness, out=closing, where=stiffness > 0.0)
            found = self._small_step(ahead - self.forces.along(moved), closing)
        return np.nan, iterations

    def interface_stiffness(self) -> float:
        """Return the tangential stiffness of the laws, without the body [N/mm]; collective."""
        by_slip, ahead = self._slipping_as_plane().by_slip, self._rubbing.memory.direction
        return float(ahead @ self._rubbing.total(by_slip.reshape(-1, 4)).reshape(2, 2) @ ahead)

    def gone_in_parts(self, parts: int) -> tuple[Array, Array]:
        """Return what load steps in parts lead to; see `FaceSliders.gone_in_parts`."""
        of_springs = self.forces.of_springs
        return self._rubbing.gone_in_parts(of_springs, partial(of_springs, rate=True), parts)

    @property
    def _rubbing(self) -> FaceSliders:
        assert self.sliders is not None
        return self.sliders

    def _linearised(self, found: SliderResponse | None = None) -> Array:
        """Move the tangent to the latest equilibrium, and return the stiffnesses of the laws.

        Args:
            found: The shear stresses there; None: none.
        """
        stiffness = self.forces.stiffness(self._closure)
        self.forces.linearise(stiffness, found)
        self._preconditioner.update()
        return stiffness

    def _stressed(self, pressure: Array, shear: Array) -> tuple[Array, PETSc.Vec, int]:
        """Return what stresses beside those of the laws change: all stresses, shape (n, 3) [MPa].

        The others are the displacements, and the linear iterations.
        """
        load = self.equilibrium.matrix.createVecLeft()
        self.forces.write_stresses(pressure, shear, load)
        moved, iterations = self._moved_by(load, _STIFFNESS)
        change = np.column_stack([pressure, shear])
        change -= self.forces.stress_change(self.forces.stretched(moved))
        return change, moved, iterations

    def _moved_by(self, load: PETSc.Vec, tolerance: float) -> tuple[PETSc.Vec, int]:
        """Return the displacements by a load under the tangent, and the linear iterations."""
        equilibrium, solver = self.equilibrium, self.newton.snes.ksp
        solver.setOperators(equilibrium.tangent, equilibrium.matrix)
        solver.setTolerances(rtol=tolerance)  # Newton's method sets its own for every solve
        moved = load.duplicate()
        iterations = solve_linear(solver, load, moved) if load.norm() else 0
        compat.collect_garbage(load.comm)
        return moved, iterations

    def _slipping_as_plane(self) -> SliderResponse:
        """Return the shear stresses with the springs that slip where samples slip as the plane."""
        way = np.tile(self._rubbing.memory.direction, (len(self._closure), 1))
        return self._small_step(way, np.zeros_like(self._closure))

    def _small_step(self, way: Array, closing: Array) -> SliderResponse:
        """Return the shear stresses after a step so small that it tells which springs slip.

        Args:
            way: Changes of slips, shape (n, 2).
            closing: Changes of closures, shape (n,).
        """
        forces, closure, slip = self.forces, self._closure, self._rubbing.memory.sliders.slip
        largest = float(np.abs(slip).max(initial=0.0))
        small = _SMALL * float(forces.comm.allreduce(largest, op=MPI.MAX))
        stiffness = forces.stiffness(closure)
        pressure = np.maximum(forces.pressure(closure) + small * stiffness * closing, 0.0)
        at = closure + small * closing, pressure, stiffness, slip + small * way
        return self._rubbing.at_slip(*at)

    # --- what load steps are made of

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
        self.forces.write_stresses(pressure, shear, load)
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
        values = together(self.face.comm, lambda: function(sampling.patch, self._closure))
        return sampling.patch_sums(values) / self.face.areas

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
        return np.asarray(np.max(self.face.comm.allgather(largest), axis=0))
