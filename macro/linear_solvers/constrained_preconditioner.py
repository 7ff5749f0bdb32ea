"""Preconditioner of a block some of whose degrees of freedom are constrained.

Theory: section 12 of ``demos/theory.md``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csr_array

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_SWEEPS = 2
"""Symmetric Gauss–Seidel sweeps near the constrained degrees of freedom."""

_FROM_ZERO = int(PETSc.Mat.SORType.SYMMETRY_SWEEP) | int(PETSc.Mat.SORType.ZERO_INITIAL_GUESS)


class Projection:
    """Orthogonal projection P: identity on free degrees of freedom, Q Qᵀ on constrained ones.

    The columns of Q are the common motions that constraints leave, such as those of a rigid plane.

    Args:
        comm: MPI communicator.
    """

    def __init__(self, comm: Any) -> None:
        self._comm = comm
        self._dofs: Indices = np.empty(0, dtype=np.intp)
        self._motions: Array = np.empty((0, 0))

    def constrain(self, dofs: Indices, motions: Array) -> None:
        """Constrain degrees of freedom to motions Q; see `ConstrainedSolver.constrain`."""
        self._dofs, self._motions = dofs, motions

    def project(self, vector: PETSc.Vec) -> None:
        """Project a vector in place; collective."""
        values, q = vector.array, self._motions
        shares = q.T @ values[self._dofs]
        if shares.size:
            shares = self._comm.allreduce(shares, op=MPI.SUM)
        values[self._dofs] = q @ shares


class ConstrainedPreconditioner:
    """The preconditioner M of the unconstrained matrix A, corrected near the constraints.

    P M P, with P the projection on the free displacements, is least accurate beside constrained
    degrees of freedom, because it cuts off what M wants to move there. Symmetric Gauss–Seidel
    sweeps S ≈ A⁻¹ on the unknowns nearby, before and after it, remove that error. This is a
    multiplicative Schwarz method (Smith, Bjørstad & Gropp 1996, ch. 1):

        2 S − S A S + (1 − S A) P M P (1 − A S),

    symmetric and positive definite like M. Unknowns that are coupled with other ranks are left
    out of the sweeps, so that the products with A need no messages.

    Args:
        matrix: Symmetric positive definite matrix A.
        preconditioner: M.
        projection: P; its owner sets the constraints.
        layers: Layers of nodes around the constrained ones that are swept.

    Note:
        Everything here is collective.
    """

    def __init__(
        self, matrix: PETSc.Mat, preconditioner: PETSc.PC, projection: Projection, layers: int
    ) -> None:
        self._local = matrix.getDiagonalBlock()
        self._preconditioner, self._projection = preconditioner, projection
        self._layers = layers
        self._work = matrix.createVecRight()
        self._shared = _nodes_coupled_to_other_ranks(matrix, self._local)
        self._dofs: Indices = np.empty(0, dtype=np.intp)
        self._near: _Neighbourhood | None = None

    def constrain(self, dofs: Indices) -> None:
        """Move to other constrained degrees of freedom.

        Args:
            dofs: Local indices of those that this rank owns, shape (n,).
        """
        if np.array_equal(dofs, self._dofs):
            return
        if self._near is not None:
            self._near.square.destroy()  # else it waits for Python's garbage collector
        self._dofs = dofs
        near = _nearby(dofs, self._local, self._layers, self._shared)
        self._near = _Neighbourhood(self._local, *near) if len(near[0]) else None

    def apply(self, _pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the preconditioner's y for x."""
        near = self._near
        x.copy(self._work)
        if near is not None:
            before = near.swept(x.array_r[near.dofs])
            self._work.array[near.coupled] -= before @ near.rows
        self._projection.project(self._work)
        self._preconditioner.apply(self._work, y)
        self._projection.project(y)
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
        neighbours = _neighbours(matrix, nodes)
        self.coupled = _dofs_of(neighbours)
        self.rows = node_submatrix(matrix, nodes, neighbours)[np.isin(_dofs_of(nodes), dofs)]
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
        nodes = _neighbours(matrix, nodes)
    dofs = _dofs_of(nodes) if layers else constrained
    return dofs[~(np.isin(dofs, constrained) | np.isin(dofs // 3, excluded))], nodes


def _nodes_coupled_to_other_ranks(matrix: PETSc.Mat, local: PETSc.Mat) -> Indices:
    """Return this rank's nodes whose rows have entries in columns of other ranks.

    There, and nowhere else, the product of the matrix with random numbers differs from the
    product of the rank's own part with them.
    """
    numbers, whole = matrix.createVecs()
    part, alone = local.createVecs()
    part.array[:] = np.random.default_rng(1).standard_normal(part.local_size)
    numbers.array[:] = part.array_r
    matrix.mult(numbers, whole)
    local.mult(part, alone)
    differs = (whole.array_r != alone.array_r).reshape(-1, 3)
    return np.flatnonzero(differs.any(axis=1))


def _neighbours(matrix: PETSc.Mat, nodes: Indices) -> Indices:
    """Return the nodes that have entries in the rows of some nodes, ascending."""
    if not len(nodes):
        return nodes
    every = np.arange(matrix.getSize()[1] // 3)
    return np.unique(node_submatrix(matrix, nodes, every).indices // 3).astype(np.intp)


def node_submatrix(matrix: PETSc.Mat, rows: Indices, columns: Indices) -> csr_array:
    """Return the part of a rank's own matrix that belongs to some nodes.

    Whole nodes are taken because matrices of PETSc's type ``baij`` give no smaller parts.

    Args:
        matrix: Matrix of this process alone, three unknowns per node.
        rows: Nodes of the rows, ascending.
        columns: Nodes of the columns, ascending.
    """
    rows_of, columns_of = (
        PETSc.IS().createBlock(3, nodes.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
        for nodes in (rows, columns)
    )
    part = matrix.createSubMatrix(rows_of, columns_of)
    starts, places, entries = part.getValuesCSR()
    size = part.getSize()
    part.destroy()
    return csr_array((entries, places, starts), shape=size)


def _dofs_of(nodes: Indices) -> Indices:
    return (3 * nodes[:, None] + np.arange(3)).ravel()
