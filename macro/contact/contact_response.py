"""What a contact at its latest equilibrium changes with motions of the plane, to first order.

Theory: sections 11 and 15 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry.rigid_plane import way_of_approach
from patchlaw.geometry.sliders import SliderResponse
from patchlaw.macro import compat
from patchlaw.macro.contact.face_sliders import FaceSliders
from patchlaw.macro.contact.loaded_face import Sampling
from patchlaw.macro.contact.newton import ContactPreconditioner, Equilibrium, Newton
from patchlaw.macro.linear_solvers.solvers import solve_linear
from patchlaw.support.arrays import Array

_LINEAR = 1e-9
"""Relative residual of the response to the approach."""

_STIFFNESS = 1e-8
"""Relative residual of displacements by the shift, for the tangential stiffness."""
_FIRST_STEP = 1e-8
"""Relative residual of the first step on other elements, which changes forces by parts of them."""
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
    """

    stiffness: float
    closing: Array
    closure: Array
    sampling: Sampling
    moved: PETSc.Vec
    way: Array

    def force_changes(self, pressures: Array) -> Array:
        """Return what errors of the laws change the force by at most, by patch, shape (N,) [N].

        Args:
            pressures: Their sizes at this rank's samples, shape (n,) [MPa].

        Note:
            Collective.
        """
        return np.asarray(self.sampling.patch_sums(np.abs(self.closing) * pressures))


class ContactResponse:
    """First order changes of a body with contact laws, by its linear solver.

    Args:
        equilibrium: The equations.
        preconditioner: Preconditioner of the tangent.
        newton: Newton's method, whose linear solver it is.

    Note:
        Every method is collective.
    """

    def __init__(
        self, equilibrium: Equilibrium, preconditioner: ContactPreconditioner, newton: Newton
    ) -> None:
        self._equilibrium, self._sampling = equilibrium, equilibrium.forces.sampling
        self._preconditioner, self._newton = preconditioner, newton

    def _closed_in(self, way: Array) -> tuple[Array, PETSc.Vec, int]:
        """Return what closing in changes.

        Args:
            way: What samples close in by [mm].

        Returns:
            The change of pressures, (n,), the displacements, and the linear iterations.
        """
        equilibrium, sampling = self._equilibrium, self._sampling
        forces = equilibrium.forces
        load = equilibrium.matrix.createVecLeft()
        risen = forces.pressure_change(sampling.weight * way)
        sampling.values.array[:] = risen
        sampling.operator.mult(sampling.values, load)
        moved, iterations = self._moved_by(load, _LINEAR)
        sampling.operator.multTranspose(moved, sampling.values)
        change = risen - forces.pressure_change(sampling.values.array_r.copy())
        return np.asarray(change), moved, iterations

    def _moved_by(self, load: PETSc.Vec, tolerance: float) -> tuple[PETSc.Vec, int]:
        """Return the displacements by a load under the tangent, and the linear iterations."""
        equilibrium, solver = self._equilibrium, self._newton.snes.ksp
        solver.setOperators(equilibrium.tangent, equilibrium.matrix)
        solver.setTolerances(rtol=tolerance)  # Newton's method sets its own for every solve
        moved = load.duplicate()
        iterations = solve_linear(solver, load, moved) if load.norm() else 0
        compat.collect_garbage(load.comm)
        return moved, iterations

    def to_motions(self, closure: Array, *, turns: bool) -> tuple[Array, float, int]:
        """Return changes of closures with the approach, (n,), dF/dδ [N/mm], and the iterations.

        Args:
            closure: Closures of this rank's samples at the equilibrium, shape (n,) [mm].
            turns: Whether the plane turns so that moments stay; its slopes are prescribed.

        Raises:
            NotConverged: When a linear solve fails.
        """
        forces, sampling = self._equilibrium.forces, self._sampling
        forces.linearise(forces.stiffness(closure))
        self._preconditioner.update()
        levers = forces.levers.matrix[:, : 3 if turns else 1]
        closing = np.empty_like(levers)
        loads, iterations = np.zeros((3, 3)), 0
        for k, way in enumerate(levers.T):
            change, _, used = self._closed_in(way)
            iterations += used
            closing[:, k] = way - sampling.values.array_r / sampling.weight
            loads[:, k] = forces.loads(change)
        motion = way_of_approach(loads, turns=turns)
        changes = np.asarray(closing @ motion[: levers.shape[1]])
        return changes, float(loads[0] @ motion), iterations

    def to_approach(self, closure: Array) -> ApproachResponse:
        """Return the response to the approach, under what is prescribed of the plane.

        Args:
            closure: Closures of this rank's samples at the equilibrium, shape (n,) [mm].

        Raises:
            NotConverged: When the linear solve fails.
        """
        forces, sampling = self._equilibrium.forces, self._sampling
        stiffness = forces.stiffness(closure)
        forces.linearise(stiffness)
        self._preconditioner.update()
        change, moved, _ = self._closed_in(np.ones_like(sampling.weight))
        closing = np.divide(change, stiffness, out=np.zeros_like(change), where=stiffness > 0.0)
        way = np.array([1.0, 0.0, 0.0])
        if forces.control.tilt is None:  # the plane turns so that closures change as they do
            levers = forces.levers.matrix[stiffness > 0.0]
            turned = (closing + sampling.displacements(moved))[stiffness > 0.0] - 1.0
            matrix = forces.levers.stiffness(sampling.weight * (stiffness > 0.0))[1:, 1:]
            sums = forces.levers.summed(levers.T @ (sampling.weight[stiffness > 0.0] * turned))
            way[1:] = np.linalg.lstsq(matrix, sums[1:], rcond=1e-12)[0]
        whole = float(forces.loads(change)[0])
        return ApproachResponse(whole, closing, closure, sampling, moved, way)

    def to_residual(self, guess: PETSc.Vec) -> float:
        """Return the force that one step of Newton's method from displacements comes to [N].

        Args:
            guess: The displacements.

        Raises:
            NotConverged: When the linear solve fails.
        """
        equilibrium, forces = self._equilibrium, self._equilibrium.forces
        residual = guess.duplicate()
        equilibrium.residual(guess, residual)
        equilibrium.update_tangent(guess)
        self._preconditioner.update()
        moved, _ = self._moved_by(residual, _FIRST_STEP)
        self._sampling.operator.multTranspose(moved, self._sampling.values)
        change = forces.pressure_change(self._sampling.values.array_r.copy())
        return float(forces.loads(forces.pressure(forces.closure(guess)) + change)[0])

    def to_stresses(self, closure: Array, stresses: Array) -> tuple[float, Array]:
        """Return what stresses beside those of the laws change under a plane that stays.

        Args:
            closure: Closures of this rank's samples at the equilibrium, shape (n,) [mm].
            stresses: Pressures and shear stresses that come in addition, shape (n, 3) [MPa].

        Returns:
            The changes of the force and, shape (2,), of the shear force [N].

        Raises:
            NotConverged: When the linear solve fails.
        """
        forces = self._equilibrium.forces
        sliders = forces.sliders
        assert sliders is not None
        sliders.hold_shift()
        forces.linearise(forces.stiffness(closure), self.interface_to_shift(closure))
        self._preconditioner.update()
        load = self._equilibrium.matrix.createVecLeft()
        forces.write_stresses(stresses[:, 0], stresses[:, 1:], load)
        moved, _ = self._moved_by(load, _STIFFNESS)
        change = stresses - forces.stress_change(moved)
        return float(forces.loads(change[:, 0])[0]), sliders.total(change[:, 1:])

    def to_shift(self, closure: Array) -> tuple[float, int]:
        """Return the slope of the shear force where the shift goes on as it changed last [N/mm].

        Springs at their bound slip on or come off it, as the slips and closures of their samples
        change. These follow from a linear problem with the springs that slip, which are told by a
        step so small that no others reach their bound, until they are the same.

        Args:
            closure: Closures of this rank's samples at the equilibrium, shape (n,) [mm].

        Returns:
            The slope, NaN where the springs that slip are not found, and the linear iterations.

        Raises:
            NotConverged: When the linear solve fails.
        """
        forces = self._equilibrium.forces
        sliders = forces.sliders
        assert sliders is not None
        sliders.hold_shift()
        ahead, stiffness = sliders.memory.direction, forces.stiffness(closure)
        found = self.interface_to_shift(closure)
        before, iterations = np.inf, 0
        for _ in range(_MOST_SETS):
            forces.linearise(stiffness, found)
            self._preconditioner.update()
            change, way, used = self._sheared(ahead, found)
            value, iterations = float(sliders.total(change[:, 1:]) @ ahead), iterations + used
            if abs(value - before) <= _SAME * abs(value):
                return value, iterations
            before = value
            closing = np.divide(
                change[:, 0], stiffness, out=np.zeros_like(closure), where=stiffness > 0.0
            )
            found = self._small_step(sliders, closure, way, closing)
        return np.nan, iterations

    def interface_to_shift(self, closure: Array) -> SliderResponse:
        """Return the shear stresses with the springs that slip where samples slip as the plane.

        Args:
            closure: Closures of this rank's samples at the equilibrium, shape (n,) [mm].
        """
        sliders = self._equilibrium.forces.sliders
        assert sliders is not None
        way = np.tile(sliders.memory.direction, (len(closure), 1))
        return self._small_step(sliders, closure, way, np.zeros_like(closure))

    def _small_step(
        self, sliders: FaceSliders, closure: Array, way: Array, closing: Array
    ) -> SliderResponse:
        """Return the shear stresses after a step so small that it tells which springs slip.

        Args:
            sliders: The sliders, at the equilibrium.
            closure: Closures there, shape (n,) [mm].
            way: Changes of slips, shape (n, 2).
            closing: Changes of closures, shape (n,).
        """
        forces, slip = self._equilibrium.forces, sliders.memory.sliders.slip
        largest = float(np.abs(slip).max(initial=0.0))
        small = _SMALL * float(forces.comm.allreduce(largest, op=MPI.MAX))
        stiffness = forces.stiffness(closure)
        pressure = np.maximum(forces.pressure(closure) + small * stiffness * closing, 0.0)
        return sliders.at_slip(closure + small * closing, pressure, stiffness, slip + small * way)

    def _sheared(self, ahead: Array, found: SliderResponse) -> tuple[Array, Array, int]:
        """Return what a shift of the plane changes, and the linear iterations.

        Args:
            ahead: The shift, shape (2,).
            found: The shear stresses that the forces are linearised with.

        Returns:
            The changes of pressures and shear stresses, shape (n, 3), and of slips, shape (n, 2).
        """
        forces, stress = self._equilibrium.forces, found.by_slip @ ahead
        load = self._equilibrium.matrix.createVecLeft()
        forces.write_stresses(np.zeros(len(stress)), stress, load)
        moved, iterations = self._moved_by(load, _STIFFNESS)
        change = -forces.stress_change(moved)
        change[:, 1:] += stress
        way = ahead - forces.along(moved)
        return change, way, iterations
