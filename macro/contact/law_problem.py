"""A body with contact laws on a face, under a rigid plane: one load step at a time.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.rigid_plane import Control
from macro import compat
from macro.contact.contact_forces import ContactForces, ContactLaw
from macro.contact.contact_state import ContactState
from macro.contact.equilibrium import Equilibrium
from macro.contact.initial_guess import DisplacementBasis
from macro.contact.loaded_face import ContactFace, Mode
from macro.contact.newton import Newton
from macro.contact.stiff_contact import ContactPreconditioner
from macro.linear_solvers.options import solve_linear
from support.collective import together
from support.errors import InputError

Array = NDArray[np.float64]


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
        face: ContactFace,
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
        self._preconditioner = ContactPreconditioner(
            self.equilibrium, face if mode == "pointwise" else None, body.solver
        )
        self.newton = Newton(self.equilibrium, self._preconditioner)
        condensed = " or, on a very soft body, coupling.newton = 'condensed'"
        steps = "take more load steps (load.steps)"
        self._remedies = {"": steps + condensed if mode == "patchwise" else steps}
        self.basis = DisplacementBasis(self.equilibrium, self._sampling)
        self._plane: Array = np.zeros(3)
        self._closure: Array = np.zeros(len(self._sampling.weight))

    def solve(self, control: Control) -> ContactState:
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
        report = self.newton.solve(solution, f"the block at {control}", self._remedies)
        self.basis.add(solution)
        self._closure, body = self.forces.closure(solution), equilibrium.body
        self._plane = self.forces.plane.copy()
        state = self.forces.state(
            self._closure,
            displacement=solution.array_r + (0.0 if body.preload is None else body.preload),
            reaction=body.reaction(solution),
            iterations=report.iterations,
            linear_iterations=report.linear_iterations,
            residuals=report.residuals,
            reason=report.reason,
        )
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

    def patch_largest(self, functions: Sequence[Callable[[Array], Array]]) -> Array:
        """Return the largest values of functions of closure on the patches, as `patch_means` does.

        Args:
            functions: One function of closures (n,) [mm] per patch; not below zero.

        Returns:
            The largest values at the samples of each patch, shape (N,).

        Note:
            Collective.
        """
        sampling, largest = self._sampling, np.zeros(self._sampling.count)
        np.maximum.at(largest, sampling.patch, sampling.by_patch(functions, self._closure))
        return np.asarray(np.max(self._face.comm.allgather(largest), axis=0))
