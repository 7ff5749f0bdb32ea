"""Contact at the quadrature points of a rough top by an augmented Lagrangian.

With d the interference of a point and the plane and k a stiffness, the pressures are

    p = ⟨p₀ + k d⟩,   ⟨·⟩ the positive part.

The pressures of one solve are the multipliers p₀ of the next, until no point in contact is behind
the plane (Alart & Curnier 1991, doi 10.1016/0045-7825(91)90022-X). For every p₀ a generalised
Newton's method with line search finds the equilibrium.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from patchlaw.geometry.rigid_plane import Control, slope_search
from patchlaw.macro import compat
from patchlaw.macro.contact.contact_forces import ContactForces
from patchlaw.macro.contact.face_nodes import TopNodes
from patchlaw.macro.contact.newton import Equilibrium
from patchlaw.macro.contact.rough_face import (
    ContactSolution,
    Guess,
    PlaneOverNodes,
    RoughFace,
    largest,
    not_found,
)
from patchlaw.macro.linear_solvers.constrained import ConstrainedPreconditioner, contact_tolerance
from patchlaw.macro.linear_solvers.node_matrices import node_submatrix, springs_at
from patchlaw.macro.linear_solvers.options import conjugate_gradients, reason_name
from patchlaw.support import Array, Indices, Locals

_LOOSEST = 0.03
"""Largest relative residual of linear solves, and tolerance of the first equilibrium."""

_SPARE = 0.3
"""Share of a tolerance that an inner solve aims at."""

_MOST_STEPS = 60
"""Newton steps of an equilibrium."""

INTERFERENCE = {1: 1e-8, 2: 1e-5}
"""Largest interference of quadrature points, and largest gap of those under pressure, relative to
the largest displacement, by the element's degree. On quadratic facets the conditions of
neighbouring points are nearly dependent, and multipliers that share a load converge slowly."""

_HARDER = 10.0
"""Factor of k between updates, and its largest factor beyond the usual one."""

_MOST_UPDATES = 40


class AugmentedLagrangian:
    """Finds contact at the quadrature points of a rough top; see the module.

    Args:
        face: The rough face.
        top: Its nodes.
        plane: The plane over them.

    Attributes:
        law: Law of the quadrature points.
        equilibrium: Equations of the body with this law.
        points: Number of pressures in a guess: this rank's quadrature points.

    Note:
        Everything here is collective.
    """

    def __init__(self, face: RoughFace, top: TopNodes, plane: PlaneOverNodes) -> None:
        self._body, self._top, self._plane = face.body, top, plane
        body, loaded = face.body, face.loaded
        (distance,) = top.with_ghosts(plane.distance)
        self._points = points = loaded.quadrature
        unit = face.modulus / _facet_sizes(points.cell, points.weight)
        self._stiff, self._soft = 1000.0 * unit, 30.0 * unit  # usual and first stiffness
        self._tolerance = contact_tolerance()
        self._interference = INTERFERENCE[body.degree]
        self.law = AugmentedLaw(np.sum(points.values * distance[points.nodes], axis=1))
        self._forces = ContactForces(loaded, "pointwise", [self.law])
        self._forces.gap = np.zeros_like(points.x)  # the law has the distances of face and plane
        self.equilibrium = Equilibrium(body, self._forces)
        self._preconditioner = StiffPreconditioner(
            body.stiffness, body.solver.pc, loaded.points_by_dofs, layers=3 - body.degree
        )
        self._ksp = conjugate_gradients(
            self.equilibrium.tangent, body.stiffness, self._preconditioner
        )
        self.points = len(points.x)

    def solve(self, control: Control, guess: Guess) -> ContactSolution:
        """Find the contact of a load step.

        Args:
            control: What the load step prescribes.
            guess: Where to start: the plane with its prescribed motions, and pressures at points.

        Raises:
            NotConverged: When an iteration fails or nothing can hold the plane.
        """
        forces, law = self._forces, self.law
        forces.control, forces.plane = control, guess.plane
        law.multiplier = np.maximum(guess.contact, 0.0)
        displacement = self._body.stiffness.createVecRight()
        displacement.array[:] = guess.displacement
        comm = self._body.comm
        steps, spent, tolerance, before = 0, 0, _LOOSEST, np.inf
        law.slope, hardest = self._soft, self._stiff
        for _ in range(_MOST_UPDATES):
            more, cycles = self._balance(displacement, tolerance, control)
            steps, spent = steps + more, spent + cycles
            closure = forces.closure(displacement)
            # interference of points without pressure, interference or gap of points under pressure
            depth = largest((law.pressure(closure) - law.multiplier) / law.slope, comm)
            allowed = self._interference * largest(displacement.array_r, comm)
            ratio = depth / max(allowed, 1e-300)
            hard = comm.allreduce(bool(np.all(law.slope >= self._stiff)), min)
            if hard and tolerance <= self._tolerance and ratio <= 1.0:
                return self._converged(displacement, steps, spent)
            law.multiplier = law.pressure(closure)
            if hard and ratio > 0.1 * before:  # the interference falls too slowly
                hardest = np.minimum(_HARDER * hardest, _HARDER * self._stiff)
            before = ratio
            law.slope = np.minimum(_HARDER * law.slope, hardest)
            if hard:
                near = min(0.1 * tolerance, _SPARE * self._interference * ratio)
                tolerance = max(self._tolerance, near)
        raise not_found(control, "MULTIPLIERS", _MOST_UPDATES)

    def _balance(
        self, displacement: PETSc.Vec, tolerance: float, control: Control
    ) -> tuple[int, int]:
        """Find the equilibrium under fixed multipliers, by generalised Newton's method.

        Args:
            displacement: Initial guess; receives the solution [mm].
            tolerance: Norm of the residual relative to that of the contact forces.
            control: What is prescribed, for an error.

        Returns:
            Newton steps and linear iterations.

        Raises:
            NotConverged: When Newton's method, its line search or a linear solve fails.
        """
        equilibrium, spent = self.equilibrium, 0
        residual, step = displacement.duplicate(), displacement.duplicate()
        for steps in range(_MOST_STEPS):
            equilibrium.residual(displacement, residual)
            norm, scale = residual.norm(), equilibrium.scale
            if norm <= tolerance * scale:
                return steps, spent
            if not scale:  # no contact
                displacement.set(0.0)
                continue
            self._linearise(displacement)
            rtol = max(min(_LOOSEST, norm / scale), _SPARE * tolerance * scale / norm)
            self._ksp.setTolerances(rtol=rtol)
            self._ksp.solve(residual, step)
            spent += int(self._ksp.its)
            if self._ksp.reason < 0:
                name = reason_name(PETSc.KSP.ConvergedReason, self._ksp.reason)
                raise not_found(control, name, spent)
            if not self._advance(displacement, residual, step):
                raise not_found(control, "LINE_SEARCH", steps)
            compat.collect_garbage(displacement.comm)  # every step leaves a field
        raise not_found(control, "NEWTON", _MOST_STEPS)

    def _linearise(self, displacement: PETSc.Vec) -> None:
        """Move the tangent and its preconditioner to a displacement."""
        self.equilibrium.update_tangent(displacement)
        slope = self.law.stiffness(self.equilibrium.forces.closure(displacement))
        points = self._points
        rows, columns = np.nonzero((points.values != 0.0) & (slope > 0.0)[:, None])
        loaded = self._top.sum_of_ranks(points.nodes[rows, columns], np.ones(len(rows))) > 0.0
        loaded &= ~self._top.held
        free = self.equilibrium.forces.control.free
        motions = self._plane.levers.scaled(free)[loaded]
        motions = motions @ self._plane.supported_motions(free, loaded)
        self._preconditioner.update(slope / points.weight, self._top.dofs[loaded], motions)

    def _advance(self, displacement: PETSc.Vec, residual: PETSc.Vec, step: PETSc.Vec) -> bool:
        """Subtract a share of a step after which the slope of the energy along it has fallen."""
        start = displacement.copy()

        def slope_after(share: float) -> float:
            displacement.waxpy(-share, step, start)
            self.equilibrium.residual(displacement, residual)
            return -float(residual.dot(step))

        return slope_search(slope_after, -float(residual.dot(step)), 1.0) is not None

    def _converged(self, displacement: PETSc.Vec, steps: int, spent: int) -> ContactSolution:
        load, forces = displacement.duplicate(), self._forces
        forces.write(displacement, load)
        pressure, plane = self.law.pressure(forces.closure(displacement)), forces.plane.copy()
        nodal_force = -load.array_r[self._top.dofs]
        gap = -self._plane.interference(plane, -displacement.array_r[self._top.dofs])
        comm = self._body.comm
        pressed = largest(nodal_force, comm)
        touching = nodal_force > 1e-6 * pressed
        if pressed:
            touching |= gap < self._interference * largest(displacement.array_r, comm)
        return ContactSolution(
            end=Guess(plane, displacement.array_r.copy(), pressure),
            nodal_force=nodal_force,
            touching=touching,
            iterations=steps,
            linear_iterations=spent,
            reason="CONVERGED_MULTIPLIERS" if pressed else "CONVERGED_NO_CONTACT",
        )


def _facet_sizes(cell: Locals, weight: Array) -> Array:
    """Return the size of the facet that every point lies on, shape (n,) [mm].

    Args:
        cell: Cell of each point, which has one facet on the top, shape (n,).
        weight: Weights of the points, shape (n,) [mm²].
    """
    _, at = np.unique(cell, return_inverse=True)
    return np.sqrt(np.bincount(at, weights=weight))[at] if len(at) else np.empty(0)


class AugmentedLaw:
    """The law p = ⟨p₀ + k d⟩ of this rank's quadrature points; a `ContactLaw`.

    Args:
        distance: Distances d₀ of the points from the plane at no approach and no tilt, shape (n,)
            [mm]; the interference d is the closure minus d₀.

    Attributes:
        distance: As given.
        slope: Stiffness k of the points, shape (n,) [MPa/mm].
        multiplier: Pressures p₀ at no interference, shape (n,) [MPa].
    """

    def __init__(self, distance: Array) -> None:
        self.distance = distance
        self.slope, self.multiplier = np.zeros_like(distance), np.zeros_like(distance)

    def pressure(self, closure: Array) -> Array:
        """Return the pressures, shape (n,) [MPa]."""
        return np.maximum(self.multiplier + self.slope * (closure - self.distance), 0.0)

    def stiffness(self, closure: Array) -> Array:
        """Return their derivatives, shape (n,) [MPa/mm]."""
        return np.where(self.pressure(closure) > 0.0, self.slope, 0.0)


class StiffPreconditioner:
    """M⁻¹ = P B P + (1 − P) S⁻¹ (1 − P), for a matrix K + C with stiff springs C at some dofs.

    B is a preconditioner of K. P constrains the dofs with springs to the motions of the plane, and
    P B P is corrected near them (see `ConstrainedPreconditioner`). S is the part of K + C between
    the dofs with springs; every rank factorises the part that it owns. The stiffer the springs,
    the weaker the two parts are coupled.

    Args:
        matrix: K.
        preconditioner: B.
        points_by_dofs: −w φ of every quadrature point, shape (points, dofs) [mm²].
        layers: Layers of nodes near which P B P is corrected.

    Note:
        Everything here is collective.
    """

    def __init__(
        self, matrix: PETSc.Mat, preconditioner: PETSc.PC, points_by_dofs: PETSc.Mat, layers: int
    ) -> None:
        self._matrix, self._points = matrix, points_by_dofs
        self._work = matrix.createVecRight()
        self._constrained = ConstrainedPreconditioner(matrix, preconditioner, layers)
        self._dofs: Indices = np.empty(0, dtype=np.intp)
        self._factors: Any = None

    def update(self, stiffness: Array, dofs: Indices, motions: Array) -> None:
        """Move to other springs.

        Args:
            stiffness: Stiffness over weight of this rank's quadrature points [MPa/mm/mm²].
            dofs: Vertical dofs of this rank that have springs, ascending, shape (n,).
            motions: Their displacements by free motions of the plane, shape (n, k); orthonormal.
        """
        springs = springs_at(self._points, stiffness)
        nodes = np.unique(dofs // 3)
        among = 3 * np.searchsorted(nodes, dofs // 3) + dofs % 3
        # a copy of all rows and columns would take 1 kB per dof
        part = sum(
            node_submatrix(matrix.getDiagonalBlock(), nodes, nodes)[among][:, among]
            for matrix in (self._matrix, springs)
        )
        springs.destroy()
        self._dofs = dofs
        self._constrained.constrain(dofs, motions)
        self._factors = splu(csc_array(part)) if len(dofs) else None

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the preconditioner's y for x; PETSc calls this."""
        work = self._work
        self._constrained.apply(pc, x, y)
        x.copy(work)
        self._constrained.project(work)
        work.axpby(1.0, -1.0, x)  # (1 − P) x, which is zero but at the dofs with springs
        rest = work.array_r[self._dofs]
        work.set(0.0)
        if self._factors is not None:
            work.array[self._dofs] = self._factors.solve(rest)
        y.axpy(1.0, work)
        self._constrained.project(work)
        y.axpy(-1.0, work)
