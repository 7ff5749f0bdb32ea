"""Solves on some degrees of freedom with the matrix and the preconditioner of all of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.errors import NotConverged
from macro.solvers import reason_name


class FreeSolver:
    """Conjugate gradients on the degrees of freedom that are not held.

    Args:
        matrix: Symmetric positive definite matrix A of all of them.
        preconditioner: A preconditioner of it.

    Note:
        Every method is collective.
    """

    def __init__(self, matrix: PETSc.Mat, preconditioner: PETSc.PC) -> None:
        self._free = matrix.createVecRight()
        self._free.set(1.0)
        operator = PETSc.Mat().createPython(
            matrix.getSizes(), _Restricted(matrix.mult, self._free), comm=matrix.comm
        )
        operator.setUp()
        self._ksp = PETSc.KSP().create(matrix.comm)
        self._ksp.setOperators(operator)
        self._ksp.setType("cg")
        self._ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        self._ksp.setTolerances(max_it=1000)
        self._ksp.pc.setType("python")
        self._ksp.pc.setPythonContext(_Restricted(preconditioner.apply, self._free))

    def hold(self, dofs: NDArray[np.intp]) -> None:
        """Hold degrees of freedom, and free all others.

        Args:
            dofs: Local indices of what this rank owns.
        """
        self._free.set(1.0)
        self._free.array[dofs] = 0.0

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
        residual.pointwiseMult(residual, self._free)
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


class _Restricted:
    """A linear map on the free degrees of freedom, the identity on the others."""

    def __init__(self, apply: Any, free: PETSc.Vec) -> None:
        self._apply, self._free = apply, free
        self._part = free.duplicate()

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write P A P x + (1 − P) x."""
        self._part.pointwiseMult(self._free, x)
        self._apply(self._part, y)
        y.pointwiseMult(y, self._free)
        y.axpy(1.0, x)
        y.axpy(-1.0, self._part)

    apply = mult
