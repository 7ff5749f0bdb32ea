"""Newton's method by PETSc's SNES, with inner tolerances that follow the residual."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.errors import NotConverged
from macro.contact.equilibrium import Equilibrium
from macro.linear_solvers.options import (
    KRYLOV_DEFAULTS,
    PREFIX,
    WeakContext,
    default_options,
    reason_name,
)

NONLINEAR_DEFAULTS: Mapping[str, object] = {
    "snes_type": "newtonls",
    "snes_linesearch_type": "bt",
    "snes_rtol": 1e-9,
    "snes_max_it": 50,
}
"""Newton with backtracking; ``snes_rtol`` is relative to the problem's scale, not to the initial
residual. On the paper's scene it leaves 2e-11 of the force and of the largest patch pressure."""

_LOOSEST = 0.1
"""Relative tolerance of linear solves far from the solution."""

_SPARE = 0.3
"""Share of the tolerance that the last linear solve aims at."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewtonReport:
    """Iterations and residuals of a solve.

    Args:
        iterations: Newton steps.
        linear_iterations: Iterations of the linear solver, all steps together.
        residuals: ‖r‖ relative to the scale before each step and at the end.
        reason: Name of PETSc's reason to stop.
    """

    iterations: int
    linear_iterations: int
    residuals: NDArray[np.float64]
    reason: str


class NewtonSolver:
    """Solves a problem repeatedly with one preconditioner.

    A linear system is solved to the tolerance max(min(ρ, 0.1), 0.3 rtol/ρ), where ρ is the relative
    residual. A tolerance proportional to ρ keeps convergence quadratic (Dembo, Eisenstat & Steihaug
    1982, doi 10.1137/0719025), and the lower bound avoids needless iterations in the last step. A
    user's ``-patchlaw_ksp_rtol`` or ``-patchlaw_snes_ksp_ew`` replaces this rule.

    Args:
        problem: The equations.
        preconditioner: A linear solver whose preconditioner is set up and used for every tangent.

    Attributes:
        snes: PETSc's solver.
        forcing: Whether tolerances of linear solves follow the residual.

    Note:
        Collective.
    """

    def __init__(self, problem: Equilibrium, preconditioner: PETSc.KSP) -> None:
        self._problem = problem
        self._residuals: list[float] = []
        base = preconditioner.getOperators()[1]
        user = PETSc.Options(PREFIX)
        self.forcing = not (user.hasName("ksp_rtol") or user.hasName("snes_ksp_ew"))
        self.snes = PETSc.SNES().create(base.comm)
        self.snes.setOptionsPrefix(PREFIX)
        self.snes.setFunction(lambda _, *vectors: problem.residual(*vectors), base.createVecLeft())
        self.snes.setJacobian(self._tangent, problem.tangent, base)
        self.snes.setConvergenceTest(self._converged)
        with default_options(PREFIX, {**KRYLOV_DEFAULTS, **NONLINEAR_DEFAULTS}):
            self.snes.setFromOptions()
        self.snes.ksp.pc.setType("python")
        self._preconditioner = _SharedPreconditioner(preconditioner.pc)
        self.snes.ksp.pc.setPythonContext(WeakContext(self._preconditioner))

    def solve(self, solution: PETSc.Vec, *, what: str, remedy: str) -> NewtonReport:
        """Solve from an initial guess.

        Args:
            solution: The initial guess; receives the solution.
            what: What is being solved, for the error.
            remedy: What to change when it fails, for the error.

        Raises:
            NotConverged: With the name of PETSc's reason.
        """
        self._residuals = []
        self.snes.solve(None, solution)
        reason = reason_name(PETSc.SNES.ConvergedReason, self.snes.reason)
        if self.snes.reason < 0:
            raise NotConverged(what, reason=reason, iterations=int(self.snes.its), remedy=remedy)
        return NewtonReport(
            iterations=int(self.snes.its),
            linear_iterations=int(self.snes.getLinearSolveIterations()),
            residuals=np.array(self._residuals),
            reason=reason,
        )

    def _tangent(
        self, snes: PETSc.SNES, displacement: PETSc.Vec, _tangent: PETSc.Mat, _base: PETSc.Mat
    ) -> None:
        self._problem.update_tangent(displacement)
        if self.forcing:
            now, wanted = self._residuals[-1], snes.getTolerances()[0]
            snes.ksp.setTolerances(rtol=max(min(_LOOSEST, now), _SPARE * wanted / now))

    def _converged(self, snes: PETSc.SNES, _its: int, norms: tuple[float, float, float]) -> int:
        scale = self._problem.scale
        self._residuals.append(norms[2] / scale if scale > 0.0 else norms[2])
        done = norms[2] <= snes.getTolerances()[0] * scale
        return int(PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE) if done else 0


class _SharedPreconditioner:
    """Another solver's preconditioner.

    PETSc keeps a solver's matrix in its preconditioner. If two solvers shared one, the first would
    solve with the matrix of the second.
    """

    def __init__(self, preconditioner: PETSc.PC) -> None:
        self._preconditioner = preconditioner

    def apply(self, _pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the preconditioner's y for x."""
        self._preconditioner.apply(x, y)
