"""A block pressed by a rigid plane through its contact laws: one load step at a time."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.collective import together
from geometry.errors import InputError, NotConverged
from macro.block import Block
from macro.interface import ContactLaw, Interface, Mode, Sampling
from macro.prediction import DisplacementBasis
from macro.solvers import (
    LINEAR_DEFAULTS,
    NONLINEAR_DEFAULTS,
    PREFIX,
    default_options,
    reason_name,
    user_set,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class PressState:
    """Equilibrium of the block at one approach; the same on every rank but for the displacement.

    Args:
        approach: Approach of the rigid plane at the middle of the interface [mm].
        displacement: This rank's owned displacements, dof by dof [mm].
        closure: Mean closure of the patches, shape (N,) [mm].
        pressure: Mean pressure of the patches, shape (N,) [MPa].
        force: Force on the interface [N].
        reaction: Force that the bottom bears [N]; equals ``force`` in equilibrium.
        newton_iterations: Newton steps.
        linear_iterations: Iterations of the linear solver, all Newton steps together.
        residuals: Norm of the residual before each Newton step and at the end, relative to the
            norm of the interface's load there.
        reason: Name of PETSc's reason to stop.
        wall_s: Wall time of the slowest rank [s].
    """

    approach: float
    displacement: Array
    closure: Array
    pressure: Array
    force: float
    reaction: float
    newton_iterations: int
    linear_iterations: int
    residuals: Array
    reason: str
    wall_s: float


class _Tangent:
    """J = K + B diag(p'/w) Bᵀ as an operator; B has few columns or few rows with entries."""

    def __init__(self, stiffness: PETSc.Mat, sampling: Sampling) -> None:
        self._stiffness, self._operator = stiffness, sampling.operator
        self.slope = sampling.operator.createVecRight()
        self._sampled = self.slope.duplicate()

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self._stiffness.mult(x, y)
        self._operator.multTranspose(x, self._sampled)
        self._sampled.pointwiseMult(self._sampled, self.slope)
        self._operator.multAdd(self._sampled, y, y)

    multTranspose = mult


class PressedBlock:
    """Solves K u = B p(closure(u)) by Newton's method for one approach after the other.

    The tangent is the exact derivative, applied without being assembled; conjugate gradients are
    preconditioned by the multigrid of the block alone, which is made once. Inner tolerances follow
    the residual (Dembo, Eisenstat & Steihaug 1982, doi 10.1137/0719025), which keeps convergence
    quadratic without solving any system further than its Newton step deserves.

    Args:
        block: The elastic block.
        interface: Patches on its top.
        laws: One law per patch, in flat order, the same on every rank.
        mode: ``"patchwise"`` or ``"pointwise"``.

    Raises:
        InputError: When there is not one law per patch, or no such mode.

    Note:
        Construction and ``press`` are collective.
    """

    def __init__(
        self,
        block: Block,
        interface: Interface,
        laws: Sequence[ContactLaw],
        mode: Mode = "patchwise",
    ) -> None:
        if len(laws) != interface.patches.count:
            raise InputError(
                "every patch needs a law", value=len(laws), allowed=f"{interface.patches.count}"
            )
        self._block, self._interface, self._laws = block, interface, laws
        self._sampling = interface.sampling(mode)
        self._comm = block.mesh.comm
        self._approach = np.zeros(len(self._sampling.weight))
        self._samples = self._sampling.operator.createVecRight()
        self._basis = DisplacementBasis(block.stiffness, self._sampling)
        self._tangent = _Tangent(block.stiffness, self._sampling)
        self._load = block.stiffness.createVecRight()
        self._load_norm = 0.0
        self._snes = self._nonlinear_solver()

    def press(self, approach: float, tilt: tuple[float, float] = (0.0, 0.0)) -> PressState:
        """Find the equilibrium at an approach, starting from what earlier solutions suggest.

        Args:
            approach: Approach of the plane at the middle of the interface [mm].
            tilt: Change of the approach along x and y [mm/mm].

        Raises:
            NotConverged: When Newton's method fails; what was known before is kept, so that a
                smaller step can be tried.
        """
        began = time.perf_counter()
        self._approach = self._rigid_approach(approach, tilt)
        solution = self._block.stiffness.createVecRight()
        self._basis.start(self._laws, self._approach, solution)
        self._residuals: list[float] = []
        with default_options(PREFIX, NONLINEAR_DEFAULTS):
            self._snes.solve(None, solution)
        reason = reason_name(PETSc.SNES.ConvergedReason, self._snes.reason)
        if self._snes.reason < 0:
            raise NotConverged(
                f"the block at an approach of {approach:g} mm",
                reason=reason,
                iterations=self._snes.its,
                remedy="take more load steps (load.steps)",
            )
        self._basis.add(solution)
        seconds = time.perf_counter() - began
        return self._state(approach, solution, reason, self._comm.allreduce(seconds, op=MPI.MAX))

    def _rigid_approach(self, approach: float, tilt: tuple[float, float]) -> Array:
        """Return the plane's approach at this rank's samples, shape (n,) [mm]."""
        patches, sampling = self._interface.patches, self._sampling
        middle = np.add(patches.origin, np.multiply(0.5, patches.lengths))
        return approach + tilt[0] * (sampling.x - middle[0]) + tilt[1] * (sampling.y - middle[1])

    def _closure(self, displacement: PETSc.Vec) -> Array:
        self._sampling.operator.multTranspose(displacement, self._samples)
        return self._approach - self._samples.array_r / self._sampling.weight

    def _laws_at(self, displacement: PETSc.Vec) -> tuple[Array, Array]:
        """Return pressures and stiffnesses; an error of one rank's laws is raised on all."""
        closure = self._closure(displacement)
        return together(self._comm, lambda: self._sampling.evaluate(self._laws, closure))

    def _residual(self, _snes: PETSc.SNES, displacement: PETSc.Vec, residual: PETSc.Vec) -> None:
        pressure, _ = self._laws_at(displacement)
        self._samples.array[:] = pressure
        self._sampling.operator.mult(self._samples, self._load)
        self._load_norm = self._load.norm()
        self._block.stiffness.mult(displacement, residual)
        residual.axpy(-1.0, self._load)

    def _update_tangent(
        self, snes: PETSc.SNES, displacement: PETSc.Vec, _tangent: PETSc.Mat, _base: PETSc.Mat
    ) -> None:
        _, stiffness = self._laws_at(displacement)
        self._tangent.slope.array[:] = stiffness / self._sampling.weight
        if self._forcing:
            current, wanted = self._residuals[-1], snes.getTolerances()[0]
            rtol = max(min(0.1, current), 0.3 * wanted / current)
            snes.ksp.setTolerances(rtol=min(rtol, 0.1))

    def _converged(self, snes: PETSc.SNES, _its: int, norms: tuple[float, float, float]) -> int:
        scale = self._load_norm
        self._residuals.append(norms[2] / scale if scale > 0.0 else norms[2])
        done = norms[2] <= snes.getTolerances()[0] * scale
        return int(PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE) if done else 0

    def _nonlinear_solver(self) -> PETSc.SNES:
        stiffness, snes = self._block.stiffness, PETSc.SNES().create(self._comm)
        tangent = PETSc.Mat().createPython(stiffness.getSizes(), self._tangent, comm=self._comm)
        tangent.setUp()
        snes.setOptionsPrefix(PREFIX)
        snes.setFunction(self._residual, stiffness.createVecLeft())
        snes.setJacobian(self._update_tangent, tangent, stiffness)
        snes.setConvergenceTest(self._converged)
        self._forcing = not user_set("ksp_rtol") and not user_set("snes_ksp_ew")
        with default_options(PREFIX, {**LINEAR_DEFAULTS, **NONLINEAR_DEFAULTS}):
            snes.ksp.setPC(self._block.solver.pc)
            snes.setFromOptions()
        return snes

    def _state(
        self, approach: float, solution: PETSc.Vec, reason: str, wall_s: float
    ) -> PressState:
        pressure, _ = self._laws_at(solution)
        forces = self._sampling.patch_sums(pressure)
        areas = self._interface.areas
        return PressState(
            approach=approach,
            displacement=solution.array_r.copy(),
            closure=self._sampling.patch_sums(self._closure(solution)) / areas,
            pressure=forces / areas,
            force=float(forces.sum()),
            reaction=self._block.reaction(solution),
            newton_iterations=int(self._snes.its),
            linear_iterations=int(self._snes.getLinearSolveIterations()),
            residuals=np.array(self._residuals),
            reason=reason,
            wall_s=wall_s,
        )
