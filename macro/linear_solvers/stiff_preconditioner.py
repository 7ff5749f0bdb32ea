"""Preconditioner of a block whose top stands on stiff springs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from macro.linear_solvers.constrained_preconditioner import ConstrainedPreconditioner
from macro.linear_solvers.projection import Projection
from macro.linear_solvers.weak_contexts import WeakContext

Array = NDArray[np.float64]


class StiffPreconditioner:
    """M⁻¹ = P B P + (1 − P) S⁻¹ (1 − P), for a matrix K + C with stiff springs C at some dofs.

    B is a preconditioner of K. P holds the dofs with springs but for their motions with the plane,
    and P B P is mended around them (see `ConstrainedPreconditioner`); S is the part of K + C between
    them, factorised by every rank for what it owns. The stiffer the springs, the less the two
    parts see of each other.

    Args:
        matrix: K.
        preconditioner: B.
        points_by_dofs: −w φ of every quadrature point, shape (points, dofs) [mm²].
        layers: Of unknowns that P B P is mended on.

    Attributes:
        pc: The preconditioner for PETSc.

    Note:
        Everything here is collective.
    """

    def __init__(
        self,
        matrix: PETSc.Mat,
        preconditioner: PETSc.PC,
        points_by_dofs: PETSc.Mat,
        layers: int,
    ) -> None:
        self._matrix, self._points = matrix, points_by_dofs
        self._split = _Split(matrix, preconditioner, layers)
        self.pc = PETSc.PC().create(matrix.comm)
        self.pc.setOperators(matrix)
        self.pc.setType("python")
        self.pc.setPythonContext(WeakContext(self._split))

    def update(self, slope: Array, dofs: NDArray[np.intp], motions: Array) -> None:
        """Move to other springs.

        Args:
            slope: Stiffness over weight of this rank's quadrature points [MPa/mm/mm²].
            dofs: Vertical dofs of this rank that have springs, shape (n,).
            motions: Their displacements by free motions of the plane, shape (n, k); orthonormal.
        """
        scale = self._points.createVecLeft()
        scale.array[:] = slope
        scaled = self._points.copy()
        scaled.diagonalScale(scale)
        springs = self._points.transposeMatMult(scaled)
        part = sum(_square(m.getDiagonalBlock(), dofs) for m in (self._matrix, springs))
        self._split.set(dofs, motions, csc_array(part))
        springs.destroy()
        scaled.destroy()


def _square(matrix: PETSc.Mat, dofs: NDArray[np.intp]) -> csr_array:
    """Return the rows and columns of some dofs; a copy of all would take 1 kB per dof."""
    nodes = np.unique(dofs // 3)
    at = PETSc.IS().createBlock(3, nodes.astype(PETSc.IntType), comm=matrix.comm)
    part = matrix.createSubMatrix(at, at)  # matrices of blocks give whole ones
    rows, columns, entries = part.getValuesCSR()
    among = 3 * np.searchsorted(nodes, dofs // 3) + dofs % 3
    return csr_array((entries, columns, rows), shape=part.getSize())[among][:, among]


class _Split:
    """What PETSc calls to apply the preconditioner."""

    def __init__(self, matrix: PETSc.Mat, preconditioner: PETSc.PC, layers: int) -> None:
        self._part, self._left = matrix.createVecRight(), Projection(matrix.comm.tompi4py())
        self._mended = ConstrainedPreconditioner(matrix, preconditioner, self._left, layers)
        self._dofs: NDArray[np.intp] = np.empty(0, dtype=np.intp)
        self._factors: object = None

    def set(self, dofs: NDArray[np.intp], motions: Array, square: csc_array) -> None:
        self._dofs = dofs
        self._left.hold(dofs, motions)
        self._mended.hold(dofs)
        self._factors = splu(square) if len(dofs) else None

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self._mended.apply(pc, x, y)
        x.copy(self._part)
        self._left.project(self._part)
        self._part.axpby(1.0, -1.0, x)  # (1 − P) x, at the dofs with springs alone
        rest = self._part.array_r[self._dofs]
        self._part.set(0.0)
        if self._factors is not None:
            self._part.array[self._dofs] = self._factors.solve(rest)  # type: ignore[attr-defined]
        y.axpy(1.0, self._part)
        self._left.project(self._part)
        y.axpy(-1.0, self._part)
