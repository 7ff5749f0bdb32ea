"""What a contact at its latest equilibrium changes with motions of the plane, to first order.

Theory: sections 11 and 15 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from macro import compat
from macro.contact.beside_half_space import BesideHalfSpace
from macro.contact.contact_preconditioner import ContactPreconditioner
from macro.contact.equations import Equilibrium
from macro.contact.face_sliders import FaceSliders
from macro.contact.newton import Newton
from macro.contact.sampling import Sampling
from macro.linear_solvers.solvers import solve_linear
from support.arrays import Array

_LINEAR = 1e-9
"""Relative residual of the response to the approach."""

_STIFFNESS = 1e-8
"""Relative residual of displacements by the shift, for the tangential stiffness. Its error is of
second order: 3e-9 with 1e-7 under a law of 1 µm, 3e-14 with this."""


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


class ContactResponse:
    """First order changes of a body with contact laws, by its linear solver.

    Args:
        equilibrium: The equations.
        sampling: The samples that laws are evaluated at.
        preconditioner: Preconditioner of the tangent.
        newton: Newton's method, whose linear solver it is.

    Note:
        Every method is collective.
    """

    def __init__(
        self,
        equilibrium: Equilibrium,
        sampling: Sampling,
        preconditioner: ContactPreconditioner,
        newton: Newton,
    ) -> None:
        self._equilibrium, self._sampling = equilibrium, sampling
        self._preconditioner, self._newton = preconditioner, newton

    def _closed_in(self, way: Array) -> Array:
        """Return the change of pressures where samples close in, shapes (n,), to first order.

        Args:
            way: What they close in by [mm].
        """
        equilibrium, sampling = self._equilibrium, self._sampling
        forces = equilibrium.forces
        load, moved = equilibrium.matrix.createVecLeft(), equilibrium.matrix.createVecRight()
        risen = forces.pressure_change(sampling.weight * way)
        sampling.values.array[:] = risen
        sampling.operator.mult(sampling.values, load)
        solver = self._newton.snes.ksp
        solver.setOperators(equilibrium.tangent, equilibrium.matrix)
        solver.setTolerances(rtol=_LINEAR)  # Newton's method sets its own for every solve
        solve_linear(solver, load, moved)
        sampling.operator.multTranspose(moved, sampling.values)
        change = risen - forces.pressure_change(sampling.values.array_r.copy())
        compat.collect_garbage(load.comm)
        return np.asarray(change)

    def to_approach(self, closure: Array, beside: BesideHalfSpace | None) -> ApproachResponse:
        """Return the response to the approach, under what is prescribed of the plane.

        Args:
            closure: Closures of this rank's samples at the equilibrium, shape (n,) [mm].
            beside: The body beside a half-space; None: under a rigid plane.

        Raises:
            NotConverged: When the linear solve fails.
        """
        forces, sampling = self._equilibrium.forces, self._sampling
        stiffness = forces.stiffness(closure)
        forces.linearise(stiffness)
        way = np.ones_like(sampling.weight)
        if beside is None:
            self._preconditioner.update()
            change = self._closed_in(way)
        else:
            change = beside.closed_in(way)
        closing = np.divide(change, stiffness, out=np.zeros_like(change), where=stiffness > 0.0)
        return ApproachResponse(float(forces.loads(change)[0]), closing, closure, sampling)

    def to_shift(
        self, closure: Array, stuck: Array, beside: BesideHalfSpace | None
    ) -> tuple[float, int]:
        """Return the derivative of the shear force along the latest change of the shift [N/mm].

        Args:
            closure: Closures of this rank's samples at the equilibrium, shape (n,) [mm].
            stuck: Tangential stiffness of what sticks there, shape (n,) [MPa/mm].
            beside: The body beside a half-space; None: under a rigid plane.

        Returns:
            The derivative, and the linear iterations that it took.

        Raises:
            NotConverged: When the linear solve fails.
        """
        forces = self._equilibrium.forces
        sliders = forces.sliders
        assert sliders is not None
        sliders.hold_shift()
        forces.linearise(forces.stiffness(closure), by_slip=stuck[:, None, None] * np.eye(2))
        ahead = sliders.memory.direction
        way = np.broadcast_to(ahead, (len(stuck), 2))
        if beside is None:
            self._preconditioner.update()
            return self._shear_stiffness(way, stuck, sliders)
        stress, iterations = beside.sheared(way, stuck)
        return float(sliders.total(stress) @ ahead), iterations

    def _shear_stiffness(self, way: Array, stuck: Array, sliders: FaceSliders) -> tuple[float, int]:
        """Return what shear stresses by slips (n, 2) do on these, and the linear iterations.

        The tangent of springs that stick is symmetric, and the work of what is left of the load
        makes the error one of second order.
        """
        equilibrium, forces = self._equilibrium, self._equilibrium.forces
        load, moved = equilibrium.matrix.createVecLeft(), equilibrium.matrix.createVecRight()
        solver, stress = self._newton.snes.ksp, stuck[:, None] * way
        solver.setOperators(equilibrium.tangent, equilibrium.matrix)
        solver.setTolerances(rtol=_STIFFNESS)
        forces.write_stresses(np.zeros(len(stress)), stress, load)
        iterations = solve_linear(solver, load, moved) if load.norm() else 0
        left = load.duplicate()
        equilibrium.tangent.mult(moved, left)
        left.aypx(-1.0, load)
        stress = stress - stuck[:, None] * forces.along(moved)
        work = sliders.total((stress * way).sum(axis=1, keepdims=True))
        stiffness = float(work[0]) - moved.dot(left)
        compat.collect_garbage(load.comm)
        return stiffness, iterations
