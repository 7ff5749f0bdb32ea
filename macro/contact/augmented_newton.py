"""Equilibrium of a block whose top stands on unilateral springs, by generalised Newton's method.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from geometry.rigid_plane import Control
from geometry.slope_search import slope_search
from macro import compat
from macro.contact.equilibrium import Equilibrium
from macro.contact.face_nodes import TopNodes
from macro.contact.loaded_face import LoadedFace
from macro.contact.rough_face import PlaneOverNodes, not_found
from macro.linear_solvers.constrained import ConstrainedPreconditioner
from macro.linear_solvers.node_matrices import node_submatrix, springs_at
from macro.linear_solvers.options import WeakContext, reason_name

Array = NDArray[np.float64]

LOOSEST = 0.03
"""Largest relative residual of linear solves, and tolerance of the first equilibrium."""

SPARE = 0.3
"""Share of a tolerance that an inner solve aims at."""

_MOST_STEPS, _MOST_ITERATIONS = 60, 1000
"""Newton steps of an equilibrium, and linear iterations of a step."""


class AugmentedLaw:
    """The law p = ⟨p₀ + k d⟩ of this rank's quadrature points; a `ContactLaw`.

    Args:
        distance: Distances d₀ of the points from the plane at no approach and no tilt, shape (n,)
            [mm]; the penetration d is the closure minus d₀.

    Attributes:
        distance: As given.
        slope: Stiffness k of the points, shape (n,) [MPa/mm].
        multiplier: Pressures p₀ at no penetration, shape (n,) [MPa].
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


class FacetNewton:
    """Newton's method under fixed multipliers, with a line search on the slope of the energy.

    Args:
        equilibrium: The equations.
        law: Law of the quadrature points; multipliers and stiffnesses may change between solves.
        face: The contact face whose quadrature points they are.
        top: Nodes of the top.
        plane: The plane over the nodes.

    Note:
        Everything here is collective.
    """

    def __init__(
        self,
        equilibrium: Equilibrium,
        law: AugmentedLaw,
        face: LoadedFace,
        top: TopNodes,
        plane: PlaneOverNodes,
    ) -> None:
        self._equilibrium, self._law, self._face = equilibrium, law, face
        self._top, self._plane, block = top, plane, equilibrium.body
        self._preconditioner = StiffPreconditioner(
            block.stiffness, block.solver.pc, face.points_by_dofs, layers=3 - block.degree
        )
        self._ksp = PETSc.KSP().create(block.stiffness.comm)
        self._ksp.setPC(self._preconditioner.pc)
        self._ksp.setOperators(equilibrium.tangent, block.stiffness)
        self._ksp.setType("cg")
        self._ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)

    def solve(self, displacement: PETSc.Vec, tolerance: float, control: Control) -> tuple[int, int]:
        """Find the equilibrium.

        Args:
            displacement: Initial guess; receives the solution [mm].
            tolerance: Norm of the residual relative to that of the contact forces.
            control: What is prescribed, for an error.

        Returns:
            Newton steps and linear iterations.

        Raises:
            NotConverged: When Newton's method, its line search or a linear solve fails.
        """
        equilibrium, spent = self._equilibrium, 0
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
            rtol = max(min(LOOSEST, norm / scale), SPARE * tolerance * scale / norm)
            self._ksp.setTolerances(rtol=rtol, max_it=_MOST_ITERATIONS)
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
        self._equilibrium.update_tangent(displacement)
        slope = self._law.stiffness(self._equilibrium.forces.closure(displacement))
        points = self._face.quadrature
        rows, columns = np.nonzero((points.values != 0.0) & (slope > 0.0)[:, None])
        loaded = self._top.sum_of_ranks(points.nodes[rows, columns], np.ones(len(rows))) > 0.0
        free = self._equilibrium.forces.control.free
        motions = self._plane.levers.scaled(free)[loaded]
        motions = motions @ self._plane.supported_motions(free, loaded)
        self._preconditioner.update(slope / points.weight, self._top.dofs[loaded], motions)

    def _advance(self, displacement: PETSc.Vec, residual: PETSc.Vec, step: PETSc.Vec) -> bool:
        """Subtract a share of a step after which the slope of the energy along it has fallen."""
        start = displacement.copy()

        def slope_after(share: float) -> float:
            displacement.waxpy(-share, step, start)
            self._equilibrium.residual(displacement, residual)
            return -float(residual.dot(step))

        return slope_search(slope_after, -float(residual.dot(step)), 1.0) is not None


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

    Attributes:
        pc: The preconditioner for PETSc.

    Note:
        Everything here is collective.
    """

    def __init__(
        self, matrix: PETSc.Mat, preconditioner: PETSc.PC, points_by_dofs: PETSc.Mat, layers: int
    ) -> None:
        self._matrix, self._points = matrix, points_by_dofs
        self._work = matrix.createVecRight()
        self._constrained = ConstrainedPreconditioner(matrix, preconditioner, layers)
        self._projection = self._constrained.projection
        self._dofs: NDArray[np.intp] = np.empty(0, dtype=np.intp)
        self._factors: Any = None
        self.pc = PETSc.PC().create(matrix.comm)
        self.pc.setOperators(matrix)
        self.pc.setType("python")
        self.pc.setPythonContext(WeakContext(self))

    def update(self, stiffness: Array, dofs: NDArray[np.intp], motions: Array) -> None:
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
        self._projection.project(work)
        work.axpby(1.0, -1.0, x)  # (1 − P) x, which is zero but at the dofs with springs
        rest = work.array_r[self._dofs]
        work.set(0.0)
        if self._factors is not None:
            work.array[self._dofs] = self._factors.solve(rest)
        y.axpy(1.0, work)
        self._projection.project(work)
        y.axpy(-1.0, work)
