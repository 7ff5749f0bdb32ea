"""Conjugate gradients for displacements some of which are constrained, without a new matrix.

Theory: section 12 of ``demos/theory.md``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.errors import NotConverged
from macro.linear_solvers.constrained_preconditioner import ConstrainedPreconditioner, Projection
from macro.linear_solvers.options import PREFIX, WeakContext, reason_name

Array = NDArray[np.float64]

TOLERANCE = 1e-10
"""Tolerance of contact: residual and complementarity relative to the contact forces.

With 1e-9 total forces were known to 2e-11 and contact areas to 3e-11, but single nodal forces only
to 2e-10 of the largest. A resumed run starts from other initial guesses and must give the same
history to 1e-10. Each factor of ten costs one iteration on hexahedra and two to three on quadratic
tetrahedra, of 12 and 30.
"""

_MOST_ITERATIONS = 1000


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
        self._projection = Projection(matrix.comm.tompi4py())
        self._matrix = matrix
        operator = PETSc.Mat().createPython(matrix.getSizes(), WeakContext(self), comm=matrix.comm)
        operator.setUp()
        self._ksp = PETSc.KSP().create(matrix.comm)
        self._ksp.setOperators(operator)
        self._ksp.setType("cg")
        self._ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        self._ksp.setTolerances(max_it=_MOST_ITERATIONS)
        self._ksp.pc.setType("python")
        self._preconditioner = ConstrainedPreconditioner(
            matrix, preconditioner, self._projection, layers
        )
        self._ksp.pc.setPythonContext(WeakContext(self._preconditioner))

    def constrain(self, dofs: NDArray[np.intp], motions: Array | None = None) -> None:
        """Constrain degrees of freedom, apart from common motions, and free all others.

        Args:
            dofs: Local indices of those that this rank owns, shape (n,).
            motions: Displacements of these by every motion that is left to them, shape (n, k);
                orthonormal over all ranks. None: they stand still.
        """
        self._projection.constrain(dofs, np.zeros((len(dofs), 0)) if motions is None else motions)
        self._preconditioner.constrain(dofs)

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
        self._projection.project(residual)
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
        self._projection.project(y)
