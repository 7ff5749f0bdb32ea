"""A body with contact laws on a face, under a rigid plane: one load step at a time.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.rigid_plane import Control
from macro import compat
from macro.contact.contact_forces import ContactForces, ContactLaw
from macro.contact.equilibrium import Equilibrium
from macro.contact.loaded_face import Loadable, Mode
from macro.contact.newton import DisplacementBasis, NewtonReport, NewtonSolver
from macro.linear_solvers.options import solve_linear
from support.collective import together
from support.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class LawContactState:
    """Equilibrium of the body at one load step.

    All but the displacement is the same on every rank.

    Args:
        approach: Approach of the rigid plane at the middle of the patches [mm].
        tilt: Change of the approach along x and y [mm/mm].
        displacement: This rank's owned displacements, dof by dof, those by other loads than the
            contact included [mm].
        closure: Mean closure of the patches, shape (N,) [mm].
        pressure: Mean pressure of the patches, shape (N,) [MPa].
        force: Force on the contact face [N].
        moment: First moments of the pressures along x and y, about the middle of the patches,
            shape (2,) [N mm].
        reaction: Force that the supports bear [N]; equals ``force`` in equilibrium.
        newton_iterations: Newton steps.
        linear_iterations: Iterations of the linear solver, all Newton steps together.
        residuals: Norm of the residual before each Newton step and at the end, relative to the
            norm of the load on the face there.
        reason: Name of PETSc's reason to stop.
    """

    approach: float
    tilt: tuple[float, float]
    displacement: Array
    closure: Array
    pressure: Array
    force: float
    moment: Array
    reaction: float
    newton_iterations: int
    linear_iterations: int
    residuals: Array
    reason: str


class LawContactProblem:
    """A body with contact laws under a rigid plane, solved by Newton's method.

    Each load step prescribes the plane's approach or force, and its tilt or zero moment. All take
    the same Newton's method in the displacements, and about as many linear solves. The tangent is
    the exact derivative. Conjugate gradients are preconditioned by the multigrid of the body
    alone, which is made once. The initial guess is the best combination of earlier solutions.

    Args:
        face: Patches on the contact face of an elastic body.
        laws: One law per patch, in flat order, the same on every rank.
        mode: ``"patchwise"``: the closure averaged over a patch gives one pressure for it;
            ``"pointwise"``: the law holds at every quadrature point.
        crown: Depth of the face below its plane at points (x, y) of the plane, beside that of the
            mesh, such as of a crowned face [mm]; None: none.

    Raises:
        InputError: When there is not one law per patch, or no such mode.

    Note:
        Construction and ``solve`` are collective.
    """

    def __init__(
        self,
        face: Loadable,
        laws: Sequence[ContactLaw],
        mode: Mode = "patchwise",
        *,
        crown: Callable[[Array, Array], Array] | None = None,
    ) -> None:
        if len(laws) != face.patches.count:
            raise InputError(
                "every patch needs a law", value=len(laws), allowed=f"{face.patches.count}"
            )
        self._face, self._sampling = face, face.sampling(mode)
        body, sampling = face.body, self._sampling
        gap = together(face.comm, lambda: sampling.below(crown))
        if body.preload is not None:
            preload = body.stiffness.createVecRight()
            preload.array[:] = body.preload
            gap = gap + sampling.displacements(preload)
        self.forces = ContactForces(face, sampling, laws, gap)
        self.equilibrium = Equilibrium(body, self.forces)
        self.newton = NewtonSolver(
            self.equilibrium, face if mode == "pointwise" else None, body.solver
        )
        self.basis = DisplacementBasis(self.equilibrium, self._sampling)
        self._plane: Array = np.zeros(3)
        self._closure: Array = np.zeros(len(self._sampling.weight))

    def solve(self, control: Control) -> LawContactState:
        """Find the equilibrium of one load step.

        A force and a moment of zero are met to `geometry.plane_equilibrium.TOLERANCE`. Without
        any force the plane touches the highest patch, with the prescribed tilt or the last one.

        Args:
            control: What is prescribed of the plane.

        Raises:
            NotConverged: When Newton's method fails, or nothing can hold the plane; the earlier
                solutions stay what they were, so that a smaller step can be tried.
        """
        equilibrium = self.equilibrium
        self.forces.prescribe(control, self._plane)
        solution = equilibrium.body.stiffness.createVecRight()
        self.basis.write_guess(solution)
        report = self.newton.solve(solution, control)
        self.basis.add(solution)
        state = self._state(solution, report)
        compat.collect_garbage(solution.comm)
        return state

    def start_from(self, pressure: Array) -> None:
        """Add the displacements by mean pressures of the patches to the initial guesses.

        Args:
            pressure: Pressures, shape (N,) [MPa].

        Note:
            Collective; one linear solve.
        """
        if not pressure.any():
            return
        body = self.equilibrium.body
        displacement = body.stiffness.createVecRight()
        solve_linear(body.solver, self._face.load(pressure), displacement)
        self.basis.add(displacement)

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
        sampling = self._sampling
        values = together(self._face.comm, lambda: sampling.by_patch(functions, self._closure))
        return sampling.patch_sums(values) / self._face.areas

    @property
    def pressures(self) -> Array:
        """Pressures at this rank's samples at the latest equilibrium, shape (n,) [MPa]."""
        return self.forces.pressure(self._closure)

    def patch_largest(self, functions: Sequence[Callable[[Array], Array]]) -> Array:
        """Return the largest values of functions of closure on the patches, as `patch_means` does.

        Args:
            functions: One function of closures (n,) [mm] per patch; not below zero.

        Returns:
            The largest values at the samples of each patch, shape (N,).

        Note:
            Collective.
        """
        sampling, found = self._sampling, np.zeros(self._sampling.count)
        np.maximum.at(found, sampling.patch, sampling.by_patch(functions, self._closure))
        parts = self._face.comm.allgather(found)
        return np.asarray(np.max(parts, axis=0))

    def _state(self, solution: PETSc.Vec, report: NewtonReport) -> LawContactState:
        body, contact, sampling = self.equilibrium.body, self.forces, self._sampling
        self._closure = closure = contact.closure(solution)
        self._plane = plane = contact.plane.copy()
        pressure = contact.pressure(closure)
        forces, load = sampling.patch_sums(pressure), contact.loads(pressure)
        areas = self._face.areas
        return LawContactState(
            approach=float(plane[0]),
            tilt=(float(plane[1]), float(plane[2])),
            displacement=solution.array_r + (0.0 if body.preload is None else body.preload),
            closure=sampling.patch_sums(closure) / areas,
            pressure=forces / areas,
            force=float(forces.sum()),
            moment=load[1:],
            reaction=body.reaction(solution),
            newton_iterations=report.iterations,
            linear_iterations=report.linear_iterations,
            residuals=report.residuals,
            reason=report.reason,
        )
