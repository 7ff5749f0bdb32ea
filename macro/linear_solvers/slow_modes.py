"""Displacements that a multigrid method damps least, and a preconditioner that solves for them.

Algebraic multigrid interpolates each displacement component from its own kind, and so it misses the
rotations by which a thin or locally held body bends. A few modes then stay, whose eigenvalues are
hundredths of the others'. They are found once, by Lanczos' method in conjugate gradients (Golub &
Van Loan 2013, section 11.3), and solved for exactly beside every cycle (balancing; Mandel 1993, doi
10.1002/cnm.1640090307). A plate with a lining on the rim of a piston took 79 iterations to 1e-8
without and 26 to 31 with them, rings of flat cells 31 to 43 and 14 to 18; bodies that need up to 18
have none.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.support.arrays import Array

_ENOUGH = 18
"""Iterations to `_SMALL` up to which nothing is gained."""
_MOST_ITERATIONS = 60
_SMALL = 1e-8
_SLOW = 0.3
"""Eigenvalue of the preconditioned matrix below which a mode counts as slow."""
_MOST_MODES = 24
_FIRST_LOOK, _NO_SLOW = 6, 0.4
"""Iterations after which the search ends if its smallest Ritz value is at least so large. It then
is 0.45 to 0.56 on bodies that need up to 12 iterations, and at most 0.06 on those that need more
than 20 (pads, flanges, L shapes, rings of flat cells; 11,000 to 83,000 unknowns). Between them,
with 14 to 20 iterations, it is 0.25 to 0.33: there the search goes on."""
_HIDDEN = 0.1
"""Part of the share 1/√n of one mode in the random residual of n unknowns. What is left of the
residual must be less: Ritz values do not show a single slow mode so soon, the residual does."""
_SAME = 1e-8
"""Share of a mode's energy below which it is a copy of another one, by rounding."""


def slow_modes(matrix: PETSc.Mat, preconditioner: PETSc.PC) -> Array:
    """Return the modes of a preconditioned matrix with its smallest eigenvalues.

    Args:
        matrix: Symmetric positive definite.
        preconditioner: Likewise.

    Returns:
        This rank's rows of the modes, shape (n, k); none where conjugate gradients are fast.

    Note:
        Collective.
    """
    residual, step = matrix.createVecs()
    rng = np.random.default_rng(matrix.comm.rank)
    residual.array[:] = rng.standard_normal(residual.local_size)
    corrected, product = residual.duplicate(), residual.duplicate()
    preconditioner.apply(residual, corrected)
    corrected.copy(step)
    energy, first = residual.dot(corrected), residual.norm()
    basis, lengths, ratios = list[Array](), list[float](), list[float]()
    while len(basis) < _MOST_ITERATIONS and residual.norm() > _SMALL * first:
        matrix.mult(step, product)
        # on a few cells both are rounding before the residual is, and then of any sign
        if not (energy > 0.0 and (curvature := step.dot(product)) > 0.0):
            break
        basis.append(corrected.array_r / energy**0.5)
        lengths.append(energy / curvature)
        residual.axpy(-lengths[-1], product)
        preconditioner.apply(residual, corrected)
        energy, before = residual.dot(corrected), energy
        ratios.append(energy / before)
        step.aypx(ratios[-1], corrected)
        left = residual.norm() / first * residual.size**0.5
        if len(basis) == _FIRST_LOOK and left <= _HIDDEN:
            if _ritz(lengths, ratios)[0][0] >= _NO_SLOW:
                break
    if len(basis) <= _ENOUGH:
        return np.zeros((residual.local_size, 0))
    values, vectors = _ritz(lengths, ratios)
    slow = np.flatnonzero(values < _SLOW)[:_MOST_MODES]
    modes = np.zeros((residual.local_size, slow.size), order="F")
    for vector, shares in zip(basis, vectors[:, slow], strict=True):
        for k, share in enumerate(shares):
            modes[:, k] += share * vector
    return modes


def _ritz(lengths: list[float], ratios: list[float]) -> tuple[Array, Array]:
    """Return Ritz values, ascending, and their vectors by the steps of conjugate gradients.

    Args:
        lengths: Lengths of the n steps.
        ratios: Energy of each new residual over that of the one before, shape (n,).
    """
    length, ratio = np.array(lengths), np.array(ratios[:-1])
    diagonal = 1.0 / length
    diagonal[1:] += ratio / length[:-1]
    beside = -np.sqrt(ratio) / length[:-1]
    values, vectors = np.linalg.eigh(np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1))
    return values, vectors


class Balanced:
    """A preconditioner M beside an exact solution Q for some modes W.

    With Q = W (Wᵀ A W)⁻¹ Wᵀ it is Q + (1 − Q A) M (1 − A Q), symmetric and positive definite like
    M, and as good as M on all that is no combination of the modes.

    Args:
        matrix: A.
        preconditioner: M.
        modes: This rank's rows of W, shape (n, k).

    Note:
        Collective.
    """

    def __init__(self, matrix: PETSc.Mat, preconditioner: PETSc.PC, modes: Array) -> None:
        self._preconditioner, self._comm = preconditioner, matrix.comm.tompi4py()
        self._work, product = matrix.createVecs()
        self._forces = np.empty_like(modes)  # A W
        for k, mode in enumerate(modes.T):
            self._work.array[:] = mode
            matrix.mult(self._work, product)
            self._forces[:, k] = product.array_r
        self._modes = modes
        self._inverse = np.linalg.pinv(self._sum(modes.T @ self._forces), _SAME, hermitian=True)

    def apply(self, _pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write y for x; PETSc calls this."""
        shares = self._inverse @ self._sum(self._modes.T @ x.array_r)
        x.copy(self._work)
        self._work.array[:] -= self._forces @ shares
        self._preconditioner.apply(self._work, y)
        shares -= self._inverse @ self._sum(self._forces.T @ y.array_r)
        y.array[:] += self._modes @ shares

    def _sum(self, values: Array) -> Any:
        return self._comm.allreduce(values, op=MPI.SUM)
