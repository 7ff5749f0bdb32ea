"""Preconditioner of a block some of whose degrees of freedom are held."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from macro.projection import Projection

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_LAYERS = 2  # of unknowns around held ones
_SWEEPS = 2
_SYMMETRIC_FROM_ZERO = PETSc.Mat.SORType.SYMMETRY_SWEEP | 16  # 16: SOR_ZERO_INITIAL_GUESS


class HeldPreconditioner:
    """The preconditioner M of all degrees of freedom, mended around those that are held.

    P M P, with P the projection on what is left, makes its largest errors beside held degrees of
    freedom: what M wants to move there is just cut off. Symmetric Gauss–Seidel sweeps S ≈ A⁻¹ on
    the unknowns close by, before and after, smooth them again (a multiplicative Schwarz method,
    Smith, Bjørstad & Gropp 1996, ch. 1):

        2 S − S A S + (1 − S A) P M P (1 − A S),

    symmetric and positive definite like M. A stands for what ranks own of it, so that the sweeps
    need no messages.

    Args:
        matrix: Symmetric positive definite matrix A.
        preconditioner: M.
        left: P; its user tells it what is held.

    Note:
        Everything here is collective.
    """

    def __init__(self, matrix: PETSc.Mat, preconditioner: PETSc.PC, left: Projection) -> None:
        self._own, self._preconditioner, self._left = (
            matrix.getDiagonalBlock(),
            preconditioner,
            left,
        )
        self._work = matrix.createVecRight()
        self._near: Indices = np.empty(0, dtype=np.intp)
        self._around = self._near

    def hold(self, dofs: Indices) -> None:
        """Move to other held degrees of freedom.

        Args:
            dofs: Local indices of what this rank owns, shape (n,).
        """
        near = dofs
        for _ in range(_LAYERS):
            near = self._neighbours(near)
        self._near = near = np.setdiff1d(near, dofs)
        if not len(near):
            return
        self._around = around = self._neighbours(near)
        self._rows = self._own.createSubMatrix(_indices(near), _indices(around))
        at = np.searchsorted(around, near)
        self._square = self._rows.createSubMatrix(_indices(np.arange(len(near))), _indices(at))
        self._load, self._sag = self._square.createVecs()

    def apply(self, _pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the preconditioner's y for x."""
        near, around = self._near, self._around
        x.copy(self._work)
        if len(near):
            before = self._swept(x.array_r[near])
            pushed, sag = self._rows.createVecs()
            sag.array[:] = before
            self._rows.multTranspose(sag, pushed)
            self._work.array[around] -= pushed.array_r
        self._left.project(self._work)
        self._preconditioner.apply(self._work, y)
        self._left.project(y)
        if len(near):
            y.array[near] += before
            pushed.array[:] = y.array_r[around]
            self._rows.mult(pushed, sag)
            y.array[near] += self._swept(x.array_r[near] - sag.array_r)

    def _swept(self, load: Array) -> Array:
        """Return S of a load."""
        self._load.array[:] = load
        self._square.SOR(self._load, self._sag, sortype=_SYMMETRIC_FROM_ZERO, its=_SWEEPS)
        return self._sag.array_r.copy()

    def _neighbours(self, dofs: Indices) -> Indices:
        """Return what a row of some degrees of freedom has entries for, sorted."""
        if not len(dofs):
            return dofs
        _, columns, _ = self._own.createSubMatrix(_indices(dofs)).getValuesCSR()
        return np.unique(columns).astype(np.intp)


def _indices(of: Indices) -> PETSc.IS:
    return PETSc.IS().createGeneral(of.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
