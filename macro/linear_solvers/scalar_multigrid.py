"""Algebraic multigrid of scalar problems on this process, such as networks of conductances.

Classical coarsening (hypre's BoomerAMG) sees jumps of the coefficients in the entries of a matrix.
On maps of the gaps between rough surfaces of 256² to 1024² cells, whose conductances differ by 10¹⁵
and more, conjugate gradients took 15 to 19 iterations to 1e-12. Smoothed aggregation (PETSc's GAMG)
took 28 to 71, and on gaps that are closed at random it failed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from patchlaw.macro.linear_solvers.options import PREFIX, default_options
from patchlaw.support.arrays import Array

_SCALAR = f"{PREFIX}leak_"
_CLASSICAL: Mapping[str, object] = {"pc_type": "hypre", "pc_hypre_type": "boomeramg"}


def scalar_multigrid(matrix: sparse.csr_matrix) -> Callable[[Array], Array]:
    """Return a cycle of multigrid for a symmetric positive definite M-matrix.

    The user's options are those with the prefix ``patchlaw_leak_``.

    Args:
        matrix: The matrix, whole on this process.

    Returns:
        What makes an approximate solution from a right side, shape (n,).
    """
    index = PETSc.IntType
    rows = matrix.indptr.astype(index), matrix.indices.astype(index), matrix.data
    operator = PETSc.Mat().createAIJ(matrix.shape, csr=rows, comm=PETSc.COMM_SELF)
    operator.setOption(PETSc.Mat.Option.SPD, True)
    cycle = PETSc.PC().create(PETSc.COMM_SELF)
    cycle.setOptionsPrefix(_SCALAR)
    cycle.setOperators(operator)
    with default_options(_SCALAR, _CLASSICAL):
        cycle.setFromOptions()
        cycle.setUp()
    solution, right = operator.createVecs()

    def apply(values: Array) -> Array:
        right.array[:] = values
        cycle.apply(right, solution)
        return np.array(solution.array)

    return apply
