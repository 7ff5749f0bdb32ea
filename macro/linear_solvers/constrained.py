"""Conjugate gradients for displacements some of which are constrained, without a new matrix.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_array

from patchlaw.macro.linear_solvers.node_matrices import (
    coupled_nodes,
    dofs_of,
    node_submatrix,
    nodes_beside,
)
from patchlaw.macro.linear_solvers.options import PREFIX, conjugate_gradients, reason_name, shell
from patchlaw.support import Array, Indices, NotConverged

TOLERANCE = 1e-10
"""Tolerance of contact: residual and complementarity relative to the contact forces.

With 1e-9 total forces were known to 2e-11 and contact areas to 3e-11, but single nodal forces only
to 2e-10 of the largest. A resumed run starts from other initial guesses and must give the same
history to 1e-10. Each factor of ten costs one iteration on hexahedra and two to three on quadratic
tetrahedra, of 12 and 30.
"""

_SWEEPS = 2
"""Symmetric Gauss–Seidel sweeps near the constrained degrees of freedom."""

_FROM_ZERO = int(PETSc.Mat.SORType.SYMMETRY_SWEEP) | int(PETSc.Mat.SORType.ZERO_INITIAL_GUESS)


def contact_tolerance() -> float:
    """Return `TOLERANCE`, or the user's ``-patchlaw_ksp_rtol``."""
    return float(PETSc.Options(PREFIX).getReal("ksp_rtol", TOLERANCE))


class ConstrainedSolver:
    """Conjugate gradients where some degrees of freedom are constrained, or move together.

    With P the orthogonal projection on the displacements that the constraints allow, the operator
    is P A P and the preconditioner is that of `ConstrainedPreconditioner`. Motions of a rigid plane
    that takes constrained degrees of freedom along are part of the same solve: they add as many
    unknowns as the plane has motions.

    Args:
        matrix: Symmetric positive definite matrix A of all degrees of freedom.
        preconditioner: A preconditioner M of A.
        layers: Layers of nodes around constrained ones near which M is corrected.

    Note:
        Every method is collective.
    """

    def __init__(self, matrix: PETSc.Mat, preconditioner: PETSc.PC, layers: int = 2) -> None:
        self._matrix = matrix
        self._preconditioner = ConstrainedPreconditioner(matrix, preconditioner, layers)
        operator = shell(matrix, self)
        self._ksp = conjugate_gradients(operator, operator, self._preconditioner)

    def constrain(self, dofs: Indices, motions: Array | None = None) -> None:
        """Constrain degrees of freedom, apart from common motions, and free all others.

        Args:
            dofs: Local indices of those that this rank owns, shape (n,).
            motions: Displacements of these by every motion that is left to them, shape (n, k);
                orthonormal over all ranks. None: they stand still.
        """
        still = np.zeros((len(dofs), 0))
        self._preconditioner.constrain(dofs, still if motions is None else motions)

    def improve(self, solution: PETSc.Vec, residual: PETSc.Vec, tolerance: float) -> int:
        """Change the free part of a solution until its residual is small.

        Args:
            solution: Changed in place.
            residual: b − A x of the solution x; overwritten.
            tolerance: Norm of the projected residual to reach.

        Returns:
            Iterations.

        Raises:
            NotConverged: When conjugate gradients fail.
        """
        self._preconditioner.project(residual)
        norm = residual.norm()
        if norm <= tolerance:
            return 0
        step = solution.duplicate()
        self._ksp.setTolerances(rtol=min(max(tolerance / norm, 1e-14), 0.5))
        self._ksp.solve(residual, step)
        if self._ksp.reason < 0:
            raise NotConverged(
                "the linear solve of the rough block",
                reason=reason_name(PETSc.KSP.ConvergedReason, self._ksp.reason),
                iterations=self._ksp.its,
                remedy="see PETSc's options -patchlaw_pc_*",
            )
        solution.axpy(1.0, step)
        return int(self._ksp.its)

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the operator's product y = P A x for x in the range of P; PETSc calls this."""
        self._matrix.mult(x, y)
        self._preconditioner.project(y)


class ConstrainedPreconditioner:
    """The preconditioner M of the unconstrained matrix A, corrected near the constraints.

    P is the orthogonal projection: the identity on free degrees of freedom and Q Qᵀ on constrained
    ones, with the common motions Q that are left to these, such as those of a rigid plane. P M P is
    least accurate beside constrained degrees of freedom, because it cuts off what M wants to move
    there. Symmetric Gauss–Seidel sweeps S ≈ A⁻¹ on the unknowns nearby, before and after it, remove
    that error. This is a multiplicative Schwarz method (Smith, Bjørstad & Gropp 1996, ch. 1):

        2 S − S A S + (1 − S A) P M P (1 − A S),

    symmetric and positive definite like M. Unknowns that are coupled with other ranks are left
    out of the sweeps, so that the products with A need no messages.

    Args:
        matrix: Symmetric positive definite matrix A.
        preconditioner: M.
        layers: Layers of nodes around the constrained ones that are swept.

    Note:
        Everything here is collective.
    """

    def __init__(self, matrix: PETSc.Mat, preconditioner: PETSc.PC, layers: int) -> None:
        self._local = matrix.getDiagonalBlock()
        self._preconditioner = preconditioner
        self._comm = matrix.comm.tompi4py()
        self._motions: Array = np.empty((0, 0))  # Q
        self._layers = layers
        self._work = matrix.createVecRight()
        self._shared = coupled_nodes(matrix)
        self._dofs: Indices = np.empty(0, dtype=np.intp)
        self._near: _Neighbourhood | None = None

    def constrain(self, dofs: Indices, motions: Array) -> None:
        """Move to other constrained degrees of freedom; see `ConstrainedSolver.constrain`."""
        before, self._dofs, self._motions = self._dofs, dofs, motions
        if np.array_equal(dofs, before):
            return
        if self._near is not None:
            self._near.square.destroy()  # else it waits for Python's garbage collector
        near = _nearby(dofs, self._local, self._layers, self._shared)
        self._near = _Neighbourhood(self._local, *near) if len(near[0]) else None

    def project(self, vector: PETSc.Vec) -> None:
        """Apply P to a vector in place; collective."""
        values, q = vector.array, self._motions
        shares = q.T @ values[self._dofs]
        if shares.size:
            shares = self._comm.allreduce(shares, op=MPI.SUM)
        values[self._dofs] = q @ shares

    def apply(self, _pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the preconditioner's y for x."""
        near = self._near
        x.copy(self._work)
        if near is not None:
            before = near.swept(x.array_r[near.dofs])
            self._work.array[near.coupled] -= before @ near.rows
        self.project(self._work)
        self._preconditioner.apply(self._work, y)
        self.project(y)
        if near is not None:
            y.array[near.dofs] += before
            left = x.array_r[near.dofs] - near.rows @ y.array_r[near.coupled]
            y.array[near.dofs] += near.swept(left)


class _Neighbourhood:
    """The rows of a rank's own matrix that belong to some unknowns.

    Attributes:
        dofs: The unknowns, shape (n,).
        coupled: Unknowns of all nodes that have entries in these rows, shape (m,).
        rows: The rows, shape (n, m).
        square: Their part between the unknowns themselves.
    """

    def __init__(self, matrix: PETSc.Mat, dofs: Indices, nodes: Indices) -> None:
        self.dofs = dofs
        neighbours = nodes_beside(matrix, nodes)
        self.coupled = dofs_of(neighbours)
        self.rows = node_submatrix(matrix, nodes, neighbours)[np.isin(dofs_of(nodes), dofs)]
        square = csr_array(self.rows[:, np.searchsorted(self.coupled, dofs)])
        square.sort_indices()
        pattern = (part.astype(PETSc.IntType) for part in (square.indptr, square.indices))
        csr = (*pattern, square.data)
        self.square = PETSc.Mat().createAIJ(square.shape, csr=csr, comm=PETSc.COMM_SELF)
        self._load, self._solution = self.square.createVecs()

    def swept(self, load: Array) -> Array:
        """Return the approximate displacements of the unknowns under their load, shape (n,)."""
        self._load.array[:] = load
        self.square.SOR(self._load, self._solution, sortype=_FROM_ZERO, its=_SWEEPS)
        return self._solution.array_r.copy()


def _nearby(
    constrained: Indices, matrix: PETSc.Mat, layers: int, excluded: Indices
) -> tuple[Indices, Indices]:
    """Return the free unknowns within some layers of constrained ones, and all nodes there."""
    nodes = np.unique(constrained // 3)
    for _ in range(layers):
        nodes = nodes_beside(matrix, nodes)
    dofs = dofs_of(nodes) if layers else constrained
    return dofs[~(np.isin(dofs, constrained) | np.isin(dofs // 3, excluded))], nodes
