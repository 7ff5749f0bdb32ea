"""A block pressed by a rigid plane through its contact laws: one load step at a time."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.collective import together
from geometry.errors import InputError
from macro.block import Block
from macro.equilibrium import Equilibrium
from macro.interface import ContactLaw, Interface, Mode
from macro.newton import NewtonReport, NewtonSolver
from macro.prediction import DisplacementBasis

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


class PressedBlock:
    """A block under a rigid plane, solved for one approach after the other by Newton's method.

    The tangent is the exact derivative; conjugate gradients are preconditioned by the multigrid of
    the block alone, which is made once. A load step starts from the best combination of all
    earlier solutions.

    Args:
        block: The elastic block.
        interface: Patches on its top.
        laws: One law per patch, in flat order, the same on every rank.
        mode: ``"patchwise"``: the closure averaged over a patch gives one pressure for it;
            ``"pointwise"``: the law holds at every quadrature point.

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
        self._interface, self._sampling = interface, interface.sampling(mode)
        self.equilibrium = Equilibrium(block, self._sampling, laws)
        self.newton = NewtonSolver(self.equilibrium, block.solver)
        self._basis = DisplacementBasis(self.equilibrium, self._sampling)
        self._closure: Array = np.zeros(len(self._sampling.weight))

    def press(self, approach: float, tilt: tuple[float, float] = (0.0, 0.0)) -> PressState:
        """Find the equilibrium at an approach.

        Args:
            approach: Approach of the plane at the middle of the patches [mm].
            tilt: Change of the approach along x and y [mm/mm].

        Raises:
            NotConverged: When Newton's method fails; the earlier solutions stay what they were,
                so that a smaller step can be tried.
        """
        began = time.perf_counter()
        equilibrium = self.equilibrium
        equilibrium.approach = self._rigid_approach(approach, tilt)
        solution = equilibrium.block.stiffness.createVecRight()
        self._basis.start(solution)
        report = self.newton.solve(
            solution,
            what=f"the block at an approach of {approach:g} mm",
            remedy="take more load steps (load.steps)",
        )
        self._basis.add(solution)
        comm = equilibrium.block.mesh.comm
        seconds = comm.allreduce(time.perf_counter() - began, op=MPI.MAX)
        return self._state(approach, solution, report, seconds)

    def patch_means(self, functions: Sequence[Callable[[Array], Array]]) -> Array:
        """Average functions of closure over the patches, at the latest equilibrium.

        Args:
            functions: One function of closures (n,) [mm] per patch.

        Returns:
            The means over the samples of each patch, shape (N,).

        Raises:
            Exception: What a function raises on one rank, on every rank.

        Note:
            Collective.
        """
        comm, sampling = self.equilibrium.block.mesh.comm, self._sampling
        values = together(comm, lambda: sampling.by_patch(functions, self._closure))
        return sampling.patch_sums(values) / self._interface.areas

    def _rigid_approach(self, approach: float, tilt: tuple[float, float]) -> Array:
        """Return the plane's approach at this rank's samples, shape (n,) [mm]."""
        patches, sampling = self._interface.patches, self._sampling
        middle = np.add(patches.origin, np.multiply(0.5, patches.lengths))
        return approach + tilt[0] * (sampling.x - middle[0]) + tilt[1] * (sampling.y - middle[1])

    def _state(
        self, approach: float, solution: PETSc.Vec, report: NewtonReport, wall_s: float
    ) -> PressState:
        self._closure = closure = self.equilibrium.closure(solution)
        forces = self._sampling.patch_sums(self.equilibrium.pressure(closure))
        areas = self._interface.areas
        return PressState(
            approach=approach,
            displacement=solution.array_r.copy(),
            closure=self._sampling.patch_sums(closure) / areas,
            pressure=forces / areas,
            force=float(forces.sum()),
            reaction=self.equilibrium.block.reaction(solution),
            newton_iterations=report.iterations,
            linear_iterations=report.linear_iterations,
            residuals=report.residuals,
            reason=report.reason,
            wall_s=wall_s,
        )
