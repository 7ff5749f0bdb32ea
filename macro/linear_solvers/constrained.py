"""Solves in a part of the displacements with the matrix and the preconditioner of all of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.errors import NotConverged
from macro.linear_solvers.constrained_preconditioner import ConstrainedPreconditioner
from macro.linear_solvers.options import PREFIX, reason_name
from macro.linear_solvers.projection import Projection
from macro.linear_solvers.weak_contexts import WeakContext

Array = NDArray[np.float64]

TOLERANCE = 1e-10
"""What a contact may miss: residual and complementarity, relative to the contact forces.

Ten times more would leave forces known to 2e-11 and contact areas to 3e-11, but forces of single
nodes to 2e-10 of the largest: a resumed run, which starts from other guesses, shall give the same
history to 1e-10. Each tenth costs one iteration on hexahedra and two to three on quadratic
tetrahedra, of 12 and 30.
"""


def contact_tolerance() -> float:
    """Return `TOLERANCE`, or what the user asks for by ``-patchlaw_ksp_rtol``."""
    return float(PETSc.Options(PREFIX).getReal("ksp_rtol", TOLERANCE))


class ConstrainedSolver:
    """Conjugate gradients where some degrees of freedom are held, or move together.

    With P the orthogonal projection on the vectors that are left, the operator is P A P and the
    preconditioner P M P, mended (see `ConstrainedPreconditioner`). Held degrees of freedom that a rigid
    plane takes along add as many unknowns as the plane has motions, and no second solve.

    Args:
        matrix: Symmetric positive definite matrix A of all of them.
        preconditioner: A preconditioner M of it.
        layers: Of unknowns around held ones that the preconditioner is mended on.

    Note:
        Every method is collective.
    """

    def __init__(self, matrix: PETSc.Mat, preconditioner: PETSc.PC, layers: int = 2) -> None:
        self._left = Projection(matrix.comm.tompi4py())
        self._projected = _Projected(matrix, self._left)
        operator = PETSc.Mat().createPython(
            matrix.getSizes(), WeakContext(self._projected), comm=matrix.comm
        )
        operator.setUp()
        self._ksp = PETSc.KSP().create(matrix.comm)
        self._ksp.setOperators(operator)
        self._ksp.setType("cg")
        self._ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        self._ksp.setTolerances(max_it=1000)
        self._ksp.pc.setType("python")
        self._mended = ConstrainedPreconditioner(matrix, preconditioner, self._left, layers)
        self._ksp.pc.setPythonContext(WeakContext(self._mended))

    def hold(self, dofs: NDArray[np.intp], motions: Array | None = None) -> None:
        """Hold degrees of freedom but for common motions, and free all others.

        Args:
            dofs: Local indices of what this rank owns, shape (n,).
            motions: Displacements of these by every motion that is left to them, shape (n, k);
                orthonormal, all ranks together. None: they stand still.
        """
        self._left.hold(dofs, np.zeros((len(dofs), 0)) if motions is None else motions)
        self._mended.hold(dofs)

    def improve(self, solution: PETSc.Vec, residual: PETSc.Vec, tolerance: float) -> int:
        """Change what is free of a solution until its residual is small.

        Args:
            solution: Changed in place.
            residual: b − A x; overwritten.
            tolerance: Norm of the residual of what is free, at the end.

        Returns:
            Iterations.

        Raises:
            NotConverged: When conjugate gradients fail.
        """
        self._left.project(residual)
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


class _Projected:
    """P A: what PETSc calls to multiply vectors of the range of P."""

    def __init__(self, matrix: PETSc.Mat, left: Projection) -> None:
        self._matrix, self._left = matrix, left

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self._matrix.mult(x, y)
        self._left.project(y)
