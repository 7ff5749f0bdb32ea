"""Products and cycles of multigrid for many vectors at once.

A product with one vector waits for the entries of the matrix; with 16 vectors, which read them
once, each takes a quarter of the time.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from petsc4py import PETSc

from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.node_matrices import block_diagonal
from patchlaw.macro.linear_solvers.options import largest_eigenvalue, users_options
from patchlaw.macro.linear_solvers.solvers import LinearSolver
from patchlaw.support import Array

Corrections = Callable[[Array], Array]
"""Takes this rank's rows of vectors, shape (m, k), to what a preconditioner returns for them."""

_AT_ONCE = 16
"""Vectors that go through a cycle together; more save nothing and take memory."""


def products(matrix: PETSc.Mat, columns: Array) -> Array:
    """Return the products of a matrix with this rank's rows of some vectors, shape (m, k).

    Args:
        matrix: The matrix.
        columns: The vectors, shape (n, k).

    Note:
        Collective.
    """
    if not (_takes_many(matrix) and columns.shape[1]):
        return one_by_one(matrix, matrix.mult)(columns)
    size = matrix.getLocalSize()[1], matrix.getSize()[1]
    right = PETSc.Mat().createDense(
        (size, (None, columns.shape[1])), array=np.asfortranarray(columns), comm=matrix.comm
    )
    right.assemble()
    product = matrix.matMult(right)
    found = product.getDenseArray().copy(order="F")
    for one in (product, right):  # PETSc keeps what Python drops
        one.destroy()
    return found


def one_by_one(matrix: PETSc.Mat, function: Callable[[PETSc.Vec, PETSc.Vec], None]) -> Corrections:
    """Return what takes some vectors, one after another, to what a function writes for them.

    Args:
        matrix: A matrix of the vectors' sizes.
        function: Writes its second vector for its first.
    """
    x, y = matrix.createVecs()

    def result(columns: Array) -> Array:
        found = np.empty((y.local_size, columns.shape[1]), order="F")
        with compat.errors_of_callbacks():
            for k, column in enumerate(columns.T):
                x.array[:] = column
                function(x, y)
                found[:, k] = y.array_r
        return found

    return result


def corrections(solver: LinearSolver) -> Corrections:
    """Return the preconditioner of a solver for many vectors.

    That of a multigrid of our own with Chebyshev smoothing takes them at once, any other, and that
    of a user's options, one by one.

    Args:
        solver: The solver, set up; keep it as long as the result.
    """
    matrix, smooth = solver.getOperators()[0], solver.smoothing
    if smooth is None or users_options() or not _takes_many(matrix):
        return one_by_one(matrix, solver.pc.apply)
    coarsest = solver.pc.getMGCoarseSolve()
    below = one_by_one(coarsest.getOperators()[0], coarsest.solve)
    for level in range(1, solver.pc.getMGLevels()):
        smoother = solver.pc.getMGSmoother(level)
        below = _Grid(smoother, solver.pc.getMGInterpolation(level), smooth, below)

    def result(columns: Array) -> Array:
        parts = np.split(columns, range(_AT_ONCE, columns.shape[1], _AT_ONCE), axis=1)
        return np.hstack([below(part) for part in parts])

    return result


def _takes_many(matrix: PETSc.Mat) -> bool:
    # products of symmetric blocks with dense matrices are wrong: findings/petsc_symmetric_dense.sh
    return matrix.getType() in ("seqaij", "mpiaij", "seqbaij", "mpibaij")


class _Grid:
    """A cycle of multigrid from a grid downwards, for many vectors.

    Args:
        smoother: PETSc's Chebyshev iteration on the grid.
        interpolation: From the next coarser grid.
        smooth: Least and largest eigenvalue that it smooths, over its largest.
        below: The cycle from there downwards.
    """

    def __init__(
        self,
        smoother: PETSc.KSP,
        interpolation: PETSc.Mat,
        smooth: tuple[float, float],
        below: Corrections,
    ) -> None:
        self._matrix, diagonal = smoother.getOperators()
        self._steps = smoother.getTolerances()[3]
        self._ends = [share * largest_eigenvalue(smoother) for share in smooth]
        self._weights: Array | PETSc.Mat
        if smoother.pc.getType() == "jacobi":
            self._weights = 1.0 / diagonal.getDiagonal().array_r[:, None]
        else:
            self._weights = block_diagonal(diagonal.invertBlockDiagonal(), diagonal.comm)
        self._up, self._down = interpolation, interpolation.transpose(PETSc.Mat())
        self._below = below

    def __call__(self, columns: Array) -> Array:
        """Return the corrections for residuals."""
        found, left = np.zeros_like(columns, order="F"), columns.copy(order="F")
        self._smooth(found, left)
        change = products(self._up, self._below(products(self._down, left)))
        found += change
        left -= products(self._matrix, change)
        self._smooth(found, left, last=True)
        return found

    def _smooth(self, found: Array, left: Array, *, last: bool = False) -> None:
        """Add steps of Chebyshev's iteration to what was found, and keep what is left.

        Source: Saad, Iterative methods for sparse linear systems, 2nd edition, algorithm 12.1.
        """
        low, high = self._ends
        middle, half = 0.5 * (high + low), 0.5 * (high - low)
        ratio, change = half / middle, self._weighted(left) / middle
        for step in range(self._steps):
            if step:
                before, ratio = ratio, 1.0 / (2.0 * middle / half - ratio)
                change *= ratio * before
                change += (2.0 * ratio / half) * self._weighted(left)
            found += change
            if not last or step + 1 < self._steps:
                left -= products(self._matrix, change)

    def _weighted(self, left: Array) -> Array:
        if isinstance(self._weights, PETSc.Mat):
            return products(self._weights, left)
        return np.asarray(self._weights * left)
