"""Preconditioner of a block some of whose degrees of freedom are held."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csr_array

from macro.linear_solvers.projection import Projection

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_SWEEPS = 2
_FROM_ZERO = int(PETSc.Mat.SORType.SYMMETRY_SWEEP) | int(PETSc.Mat.SORType.ZERO_INITIAL_GUESS)


class ConstrainedPreconditioner:
    """The preconditioner M of all degrees of freedom, mended around those that are held.

    P M P, with P the projection on what is left, errs most beside held degrees of freedom: what M
    wants to move there is just cut off. Symmetric Gauss–Seidel sweeps S ≈ A⁻¹ on the unknowns
    close by, before and after it, smooth that away (a multiplicative Schwarz method; Smith,
    Bjørstad & Gropp 1996, ch. 1):

        2 S − S A S + (1 − S A) P M P (1 − A S),

    symmetric and positive definite like M. Unknowns that have entries with those of other ranks do
    not count as close by: the products with A need no messages then, and are whole.

    Args:
        matrix: Symmetric positive definite matrix A.
        preconditioner: M.
        left: P; its user tells it what is held.
        layers: Of unknowns around held ones that count as close by.

    Note:
        Everything here is collective.
    """

    def __init__(
        self, matrix: PETSc.Mat, preconditioner: PETSc.PC, left: Projection, layers: int
    ) -> None:
        self._own = matrix.getDiagonalBlock()
        self._preconditioner, self._left, self._layers = preconditioner, left, layers
        self._work = matrix.createVecRight()
        self._border = _border(matrix, self._own)
        self._held: Indices = np.empty(0, dtype=np.intp)
        self._close: _Surroundings | None = None

    def hold(self, dofs: Indices) -> None:
        """Move to other held degrees of freedom.

        Args:
            dofs: Local indices of what this rank owns, shape (n,).
        """
        if np.array_equal(dofs, self._held):
            return
        if self._close is not None:
            self._close.destroy()
        self._held = dofs
        close = _Surroundings(self._own, dofs, self._layers, self._border)
        self._close = close if len(close.near) else None

    def apply(self, _pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the preconditioner's y for x."""
        close = self._close
        x.copy(self._work)
        if close is not None:
            before = close.swept(x.array_r[close.near])
            self._work.array[close.around] -= close.pushed(before)
        self._left.project(self._work)
        self._preconditioner.apply(self._work, y)
        self._left.project(y)
        if close is not None:
            y.array[close.near] += before
            left = x.array_r[close.near] - close.forces(y.array_r[close.around])
            y.array[close.near] += close.swept(left)


class _Surroundings:
    """The part of a matrix of one process around some of its degrees of freedom.

    Attributes:
        near: Unknowns close to them, which they do not belong to, shape (n,).
        around: Unknowns of all nodes that these have entries with, shape (m,).
    """

    def __init__(self, matrix: PETSc.Mat, dofs: Indices, layers: int, border: Indices) -> None:
        nodes = np.unique(dofs // 3)
        for _ in range(layers):
            nodes = _neighbours(matrix, nodes)
        every = _unknowns(nodes) if layers else dofs
        chosen = ~(np.isin(every, dofs) | np.isin(every // 3, border))
        self.near = every[chosen]
        if not len(self.near):
            return
        beside = _neighbours(matrix, nodes)
        self.around = _unknowns(beside)
        self._rows = _part(matrix, nodes, beside)[chosen]
        square = csr_array(self._rows[:, np.searchsorted(self.around, self.near)])
        square.sort_indices()
        pattern = (part.astype(PETSc.IntType) for part in (square.indptr, square.indices))
        csr = (*pattern, square.data)
        self._square = PETSc.Mat().createAIJ(square.shape, csr=csr, comm=PETSc.COMM_SELF)
        self._load, self._sag = self._square.createVecs()

    def swept(self, load: Array) -> Array:
        """Return the displacements of `near` that sweeps find under their load, shape (n,)."""
        self._load.array[:] = load
        self._square.SOR(self._load, self._sag, sortype=_FROM_ZERO, its=_SWEEPS)
        return self._sag.array_r.copy()

    def pushed(self, sag: Array) -> Array:
        """Return the forces on `around` by displacements of `near`, shape (m,)."""
        forces: Array = sag @ self._rows
        return forces

    def forces(self, sag: Array) -> Array:
        """Return the forces on `near` by displacements of `around`, shape (n,)."""
        forces: Array = self._rows @ sag
        return forces

    def destroy(self) -> None:
        """Give the matrix back, which would else wait for Python's collector."""
        self._square.destroy()


def _border(matrix: PETSc.Mat, own: PETSc.Mat) -> Indices:
    """Return this rank's nodes that have entries with those of other ranks.

    There, and nowhere else, a product with random numbers is not that of the rank's own part.
    """
    numbers, whole = matrix.createVecs()
    part, alone = own.createVecs()
    part.array[:] = np.random.default_rng(1).standard_normal(part.local_size)
    numbers.array[:] = part.array_r
    matrix.mult(numbers, whole)
    own.mult(part, alone)
    differs = (whole.array_r != alone.array_r).reshape(-1, 3)
    return np.flatnonzero(differs.any(axis=1))


def _neighbours(matrix: PETSc.Mat, nodes: Indices) -> Indices:
    """Return the nodes that nodes have entries with, ascending."""
    if not len(nodes):
        return nodes
    every = np.arange(matrix.getSize()[1] // 3)
    return np.unique(_part(matrix, nodes, every).indices // 3).astype(np.intp)


def _part(matrix: PETSc.Mat, rows: Indices, columns: Indices) -> csr_array:
    """Return the part of a matrix that belongs to nodes; matrices of blocks give no less."""
    part = matrix.createSubMatrix(_blocks(rows), _blocks(columns))
    starts, places, entries = part.getValuesCSR()
    size = part.getSize()
    part.destroy()
    return csr_array((entries, places, starts), shape=size)


def _blocks(nodes: Indices) -> PETSc.IS:
    return PETSc.IS().createBlock(3, nodes.astype(PETSc.IntType), comm=PETSc.COMM_SELF)


def _unknowns(nodes: Indices) -> Indices:
    return (3 * nodes[:, None] + np.arange(3)).ravel()
