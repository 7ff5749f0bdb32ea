"""Newton's method by PETSc's SNES for load steps with laws, and its initial guesses.

Guesses minimise the energy in the space of earlier solutions. Extrapolation took 1.8 to 3.2 times
as many linear iterations over eight load steps with 4 patches and one closure for each, and 3 to
24 % more with 16 and 64 patches or laws at points.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.rigid_plane import Control
from macro.contact.equilibrium import Equilibrium
from macro.contact.loaded_face import Sampling
from macro.contact.stiff_contact import ContactPreconditioner
from macro.linear_solvers.options import (
    KRYLOV_DEFAULTS,
    PREFIX,
    default_options,
    iterating,
    reason_name,
    set_own_preconditioner,
    weakly,
)
from support.errors import NotConverged

Array = NDArray[np.float64]

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


_ROUNDING = 1e-7
"""Smallest part of a displacement that must be new to the basis; less only adds rounding."""

_STEPS, _HALVINGS = 30, 10
"""Newton steps in the basis, and halvings of each."""


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
    """Solves a problem repeatedly.

    A linear system is solved to the tolerance max(min(ρ, 0.1), 0.3 rtol/ρ), where ρ is the relative
    residual. A tolerance proportional to ρ keeps convergence quadratic (Dembo, Eisenstat & Steihaug
    1982, doi 10.1137/0719025), and the lower bound avoids needless iterations in the last step. A
    user's ``-patchlaw_ksp_rtol`` or ``-patchlaw_snes_ksp_ew`` replaces this rule.

    Args:
        problem: The equations.
        face: The contact face that laws stand on at points; None for laws of patches.
        solver: Linear solver of the body alone, whose preconditioner is set up.

    Attributes:
        snes: PETSc's solver.
        forcing: Whether tolerances of linear solves follow the residual.

    Note:
        Collective.
    """

    def __init__(self, problem: Equilibrium, face: Any, solver: PETSc.KSP) -> None:
        self._problem = problem
        self._residuals: list[float] = []
        base = solver.getOperators()[1]
        user = PETSc.Options(PREFIX)
        self.forcing = not (user.hasName("ksp_rtol") or user.hasName("snes_ksp_ew"))
        self.snes = PETSc.SNES().create(base.comm)
        self.snes.setOptionsPrefix(PREFIX)
        self.snes.setFunction(weakly(self._residual), base.createVecLeft())
        self.snes.setJacobian(weakly(self._tangent), problem.tangent, base)
        self.snes.setConvergenceTest(weakly(self._converged))
        self._preconditioner = ContactPreconditioner(problem, face, solver)
        set_own_preconditioner(self.snes.ksp, self._preconditioner)
        with default_options(PREFIX, {**KRYLOV_DEFAULTS, **NONLINEAR_DEFAULTS}):
            self.snes.setFromOptions()
        iterating(self.snes.ksp)
        self._remedy = "take more load steps (load.steps)"
        if face is None:
            self._remedy += " or, on a very soft body, coupling.newton = 'condensed'"

    def solve(self, solution: PETSc.Vec, control: Control) -> NewtonReport:
        """Solve from an initial guess.

        Args:
            solution: The initial guess; receives the solution.
            control: What the load step prescribes, for the error.

        Raises:
            NotConverged: With the name of PETSc's reason.
        """
        self._residuals = []
        self.snes.solve(None, solution)
        reason = reason_name(PETSc.SNES.ConvergedReason, self.snes.reason)
        if self.snes.reason < 0:
            raise NotConverged(
                f"the block at {control}",
                reason=reason,
                iterations=int(self.snes.its),
                remedy=self._remedy,
            )
        return NewtonReport(
            iterations=int(self.snes.its),
            linear_iterations=int(self.snes.getLinearSolveIterations()),
            residuals=np.array(self._residuals),
            reason=reason,
        )

    def _residual(self, _snes: PETSc.SNES, displacement: PETSc.Vec, residual: PETSc.Vec) -> None:
        self._problem.residual(displacement, residual)

    def _tangent(
        self, snes: PETSc.SNES, displacement: PETSc.Vec, _tangent: PETSc.Mat, _base: PETSc.Mat
    ) -> None:
        self._problem.update_tangent(displacement)
        self._preconditioner.update()
        if self.forcing:
            wanted = snes.getTolerances()[0]
            snes.ksp.setTolerances(rtol=newton_tolerance(self._residuals[-1], wanted))

    def _converged(self, snes: PETSc.SNES, _its: int, norms: tuple[float, float, float]) -> int:
        scale = self._problem.scale
        self._residuals.append(norms[2] / scale if scale > 0.0 else norms[2])
        done = norms[2] <= snes.getTolerances()[0] * scale
        return int(PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE) if done else 0


def newton_tolerance(now: float, wanted: float) -> float:
    """Return the relative tolerance of a Newton step's linear solve, see `NewtonSolver`.

    Args:
        now: Relative residual before the step.
        wanted: Relative residual that the steps aim at.
    """
    return max(min(_LOOSEST, now), _SPARE * wanted / now)


class DisplacementBasis:
    """Earlier displacements, orthonormal in the block's energy, as a basis for initial guesses.

    The block is linear, so every solution lies in the space K⁻¹ range(B), which has as many
    dimensions as there are samples. Galerkin's method in the span of the earlier solutions needs no
    linear solve and gives the initial guess of least error in the energy norm, which includes
    extrapolation. Once the basis has as many dimensions as there are patches, the guess is the
    solution.

    Args:
        equilibrium: The equations that are being solved.
        sampling: Their samples of the interface.
        size: Largest number of vectors; the oldest are dropped first.

    Attributes:
        vectors: W, this rank's degrees of freedom of the k vectors, shape (n,) each [mm]. They are
            all that is kept; three products with K for every solution replace their forces.

    Note:
        Collective.
    """

    def __init__(self, equilibrium: Equilibrium, sampling: Sampling, *, size: int = 32) -> None:
        self._equilibrium, self._sampling, self._size = equilibrium, sampling, size
        self._comm = equilibrium.body.comm
        self.vectors: list[Array] = []
        self._sampled: Array = np.empty((0, len(sampling.weight)))  # Wᵀ B of this rank's samples

    def __len__(self) -> int:
        return len(self.vectors)

    def add(self, displacement: PETSc.Vec) -> None:
        """Add the part of a displacement that is new to the basis; collective."""
        stiffness = self._equilibrium.body.stiffness
        work, force = displacement.copy(), displacement.duplicate()
        vector, before = work.array, 0.0
        for _ in range(2):  # a second pass removes what rounding left
            stiffness.mult(work, force)
            before = before or self._sum(vector @ force.array_r)
            shares = self._sum(np.array([each @ force.array_r for each in self.vectors]))
            for share, each in zip(shares, self.vectors, strict=True):
                vector -= share * each
        stiffness.mult(work, force)
        square = self._sum(vector @ force.array_r)
        if not square > _ROUNDING**2 * before:
            return
        vector /= square**0.5
        sampled = self._sampling.operator.createVecRight()
        self._sampling.operator.multTranspose(work, sampled)
        first = max(0, len(self) + 1 - self._size)
        self.vectors = [*self.vectors, vector.copy()][first:]
        self._sampled = np.vstack([self._sampled, sampled.array_r])[first:]

    def write_guess(self, into: PETSc.Vec) -> None:
        """Write the state of least energy in the basis under what is prescribed of the plane.

        It solves y = Wᵀ B p(closure(W y)) by damped Newton steps, which need not converge.
        """
        y = np.zeros(len(self))
        value, slope = self._projected(y)
        first = float(np.linalg.norm(value))
        for _ in range(_STEPS):
            if np.linalg.norm(value) <= _ROUNDING**2 * first:
                break
            step = np.linalg.solve(slope, value)
            for share in 0.5 ** np.arange(_HALVINGS):
                trial = y - share * step
                trial_value, trial_slope = self._projected(trial)
                if np.linalg.norm(trial_value) < np.linalg.norm(value):
                    break
            else:
                break
            y, value, slope = trial, trial_value, trial_slope
        into.set(0.0)
        for share, vector in zip(y, self.vectors, strict=True):
            into.array[:] += share * vector

    def _projected(self, y: Array) -> tuple[Array, Array]:
        """Return the equilibrium's residual and tangent in the basis."""
        equations, weight = self._equilibrium.forces, self._sampling.weight
        columns = self._sampled
        closure = equations.closure_of((y @ columns) / weight)
        pressure, stiffness = equations.pressure(closure), equations.stiffness(closure)
        parts = np.vstack([
            -columns @ pressure,
            (columns * (stiffness / weight)) @ columns.T,
            (columns @ equations.border(stiffness)).T,
        ])  # fmt: skip
        parts = self._sum(parts)
        stiff, border = parts[1 : len(y) + 1], parts[len(y) + 1 :]
        return y + parts[0], np.eye(len(y)) + stiff - border.T @ border

    def _sum(self, values: Any) -> Any:
        return self._comm.allreduce(values, op=MPI.SUM)
