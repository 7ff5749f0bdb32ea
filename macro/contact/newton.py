"""Equations with contact, and Newton's method for them by PETSc's SNES.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.macro import compat
from patchlaw.macro.contact.contact_forces import AddsProduct, ContactForces, ContactTangent
from patchlaw.macro.contact.pressed_plane import Prediction
from patchlaw.macro.linear_solvers.node_matrices import Stiffened, springs_at
from patchlaw.macro.linear_solvers.options import (
    KRYLOV_DEFAULTS,
    PREFIX,
    default_options,
    iterating,
    options_read,
    reason_name,
    set_own_preconditioner,
    weakly,
)
from patchlaw.macro.linear_solvers.solvers import Balanced
from patchlaw.support import Array, InputError, NotConverged


class ContactPreconditioner:
    """The preconditioner of a body's tangents, with the stiffness of laws at points.

    Laws hold the nodes of the face, which the preconditioner of the body alone knows nothing of:
    iterations grow with the root of the laws' stiffness over the elements'. Laws at points couple
    no other nodes than the elements do, so that their stiffness fits into the matrix, and multigrid
    is set up with it. On quadratic elements that takes no second matrix: only the coarser grid has
    the sum's entries.

    A plane that is free to move takes stiffness away that this knows of, −B E Eᵀ Bᵀ. The modes that
    become soft are its responses to the columns of B E, and are solved for exactly: on a pad of
    linear tetrahedra under a force, without tilt, soft, stiff and mixed laws took 11, 15 and 16
    iterations a solve with them, 14, 19 and 24 without. Under friction, where these are loads by
    pressures as well, four load steps of a quadratic pad took 206 iterations with and 242 without.

    Args:
        equilibrium: The equations. Laws of whole patches do not enter the matrix, nor any on a
            lattice, whose multigrid is geometric.

    Note:
        Everything is collective.
    """

    def __init__(self, equilibrium: Equilibrium) -> None:
        self._equilibrium, pointwise = equilibrium, equilibrium.forces.mode == "pointwise"
        self._knows_laws = pointwise and equilibrium.body.lattice is None
        self._with_laws: PETSc.KSP | None = None
        self._stiffened: Stiffened | None = None
        self._turning: Balanced | None = None
        self._slope = np.zeros_like(equilibrium.forces.slope)

    @cached_property
    def _elements(self) -> float:
        """Stiffness of the elements at the face [MPa/mm]."""
        return self._equilibrium.forces.sampling.stiffness_of_elements(self._equilibrium.matrix)

    def update(self) -> None:
        """Follow the tangent."""
        if not self._knows_laws:
            return
        forces = self._equilibrium.forces
        if forces.moved_from(self._slope, self._elements):
            self._take_laws()
        self._turning = self._with_motions()

    def _take_laws(self) -> None:
        """Make the preconditioner of the body with the laws as they are."""
        body, forces = self._equilibrium.body, self._equilibrium.forces
        slope = self._slope = forces.slope.copy()
        self._turning = None
        if self._with_laws is not None:
            self._with_laws.destroy()
            self._with_laws = self._stiffened = None
        if forces.comm.allreduce(slope.any(), op=MPI.LOR):
            body.release_solver()
            compat.collect_garbage(body.stiffness.comm)
            springs = springs_at(forces.points, slope)
            self._stiffened = Stiffened(body.stiffness, body.stiffnesses, springs)
            self._with_laws = body.solver_of(self._stiffened)
        compat.collect_garbage(body.stiffness.comm)

    def _with_motions(self) -> Balanced | None:
        """Return the preconditioner beside an exact solution for motions of the plane, if any."""
        tangent = self._equilibrium.tangent
        loads = self._equilibrium.forces.loads_of_motions
        if not loads.shape[1]:
            return None
        load, moved = tangent.createVecs()
        modes = np.empty_like(loads)
        for k, column in enumerate(loads.T):
            load.array[:] = column
            self._fixed.apply(load, moved)
            modes[:, k] = moved.array_r
        return Balanced(tangent, self._fixed, modes)

    @property
    def _fixed(self) -> PETSc.PC:
        """The preconditioner under a plane in a given place."""
        return (self._with_laws or self._equilibrium.body.solver).pc

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write y for x; PETSc calls this."""
        if self._turning is None:
            self._fixed.apply(x, y)
        else:
            self._turning.apply(pc, x, y)


NONLINEAR_DEFAULTS: Mapping[str, object] = {
    "snes_type": "newtonls",
    "snes_linesearch_type": "bt",
    "snes_rtol": 1e-9,
    "snes_max_it": 50,
}
"""Newton with backtracking; ``snes_rtol`` is relative to the problem's scale, not to the initial
residual. On the paper's scene it leaves 2e-11 of the force and of the largest patch pressure."""

_MOST_WORN = 50
"""Solutions of a load step whose slip wears, at most."""

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
    residuals: Array
    reason: str


class ContactEquations:
    """Nonlinear equations of contact: inner less contact forces, of a linear body these K u − B p.

    The plane is eliminated by its own nonlinear equilibrium, so that displacements are the only
    unknowns of Newton's method. The residual K u − B p(c(u)) is the gradient of a convex energy if
    no law softens. Its derivative K + B (diag(p'/w) − E Eᵀ) Bᵀ is applied without being assembled;
    it lies between K and the derivative under a fixed plane.

    Args:
        matrix: K, or the derivative of other inner forces.
        contacts: The forces of contact.
        derivatives: What adds the products of their derivatives; by default the contacts.

    Attributes:
        matrix: K.
        contacts: The forces of contact.
        tangent: The derivative at the displacement last given to ``update_tangent``, a PETSc
            matrix without entries.

    Note:
        Every method is collective.
    """

    def __init__(
        self,
        matrix: PETSc.Mat,
        contacts: Sequence[ContactForces],
        derivatives: Sequence[AddsProduct] | None = None,
    ) -> None:
        self.matrix, self.contacts = matrix, contacts
        self.tangent = ContactTangent(derivatives or contacts).shell(matrix)
        self._contact = matrix.createVecRight()
        self._part = self._contact.duplicate() if len(contacts) > 1 else self._contact
        self._elements: dict[int, float] = {}

    def residual(self, x: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Write the residual at displacements.

        Args:
            x: Displacements [mm].
            residual: Receives the residual [N].
        """
        self._write_contact(x)
        self._write_residual(x, residual)

    def linearise(
        self, x: PETSc.Vec, predictions: Sequence[Prediction], residual: PETSc.Vec
    ) -> None:
        """Write the residual with pressures of laws that are lines, and move the tangent to these.

        Args:
            x: Displacements [mm].
            predictions: The laws of each contact as lines.
            residual: Receives the residual [N].
        """
        self._contact.set(0.0)
        for forces, given in zip(self.contacts, predictions, strict=True):
            forces.write_lines(x, given, self._part)
            if self._part is not self._contact:
                self._contact.axpy(1.0, self._part)
        self._write_residual(x, residual)
        self.follow()

    def update_tangent(self, x: PETSc.Vec) -> None:
        """Move the tangent to displacements."""
        for forces in self.contacts:
            forces.update(x)
        self.follow()

    def follow(self) -> None:
        """Let the matrix follow the displacements and the tangents of the contacts."""

    def kept_springs(self, contact: int) -> Array | None:
        """Return the slopes of a contact's springs that the matrix holds; None: none."""
        return None

    def elements(self, contact: int) -> float:
        """Return the stiffness of the elements at the samples of a contact [MPa/mm]."""
        if contact not in self._elements:
            sampling = self.contacts[contact].sampling
            self._elements[contact] = sampling.stiffness_of_elements(self.matrix)
        return self._elements[contact]

    @property
    def parts(self) -> list[PETSc.Mat]:
        """The matrices of the bodies, on the diagonal of that of all."""
        return [self.matrix]

    def _write_residual(self, x: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Write inner forces less those of contact that are known."""
        self.matrix.mult(x, residual)
        residual.axpy(-1.0, self._contact)

    @property
    def scale(self) -> float:
        """Norm of the contact forces at the latest `residual`, which it is compared with [N]."""
        return float(self._contact.norm())

    def _write_contact(self, x: PETSc.Vec) -> None:
        """Write the forces of all contacts, those on constrained unknowns included."""
        if len(self.contacts) != 1:
            self._contact.set(0.0)
        for forces in self.contacts:
            forces.write(x, self._part)
            if self._part is not self._contact:
                self._contact.axpy(1.0, self._part)


class Equilibrium(ContactEquations):
    """The equations of a body, or of two, in contact on a face.

    Args:
        body: The `ElasticBody`, or a `BodyPair`.
        forces: Forces of the laws on its contact face.
    """

    def __init__(self, body: Any, forces: ContactForces) -> None:
        super().__init__(body.stiffness, [forces])
        self.body, self.forces = body, forces

    @property
    def parts(self) -> list[PETSc.Mat]:
        """The stiffnesses of the bodies."""
        return list(self.body.stiffnesses)


class Newton:
    """Solves equations repeatedly.

    A linear system is solved to the tolerance max(min(ρ, 0.1), 0.3 rtol/ρ), where ρ is the relative
    residual. A tolerance proportional to ρ keeps convergence quadratic (Dembo, Eisenstat & Steihaug
    1982, doi 10.1137/0719025), and the lower bound avoids needless iterations in the last step. A
    user's ``-patchlaw_ksp_rtol`` or ``-patchlaw_snes_ksp_ew`` replaces this rule.

    Args:
        equations: The equations.
        preconditioner: Has ``apply``, and ``update``, which follows the tangent; None: PETSc's own,
            made of the equations' matrix by the options.
        options: PETSc's options, which override the defaults here.
        given: Those of them that the user gave: ones that PETSc does not read are refused.
        method: Krylov method in place of a factorisation alone.

    Attributes:
        snes: PETSc's solver.
        forcing: Whether tolerances of linear solves follow the residual.

    Note:
        Collective.
    """

    def __init__(
        self,
        equations: ContactEquations,
        preconditioner: Any = None,
        options: Mapping[str, object] | None = None,
        given: Mapping[str, object] | None = None,
        method: str = "cg",
    ) -> None:
        self._equations, self._preconditioner = equations, preconditioner
        self._residuals: list[float] = []
        given = given or {}
        self._options = {**KRYLOV_DEFAULTS, **NONLINEAR_DEFAULTS, **(options or {}), **given}
        self._unread = set(given)
        user, matrix = PETSc.Options(PREFIX), equations.matrix
        ruled = {name for name in ("ksp_rtol", "snes_ksp_ew") if user.hasName(name)}
        self.forcing = not ruled and not given.keys() & {"ksp_rtol", "snes_ksp_ew"}
        self.snes = PETSc.SNES().create(matrix.comm)
        self.snes.setOptionsPrefix(PREFIX)
        self.snes.setFunction(weakly(self._residual), matrix.createVecLeft())
        self.snes.setJacobian(weakly(self._tangent), equations.tangent, matrix)
        self.snes.setConvergenceTest(weakly(self._converged))
        if preconditioner is not None:
            set_own_preconditioner(self.snes.ksp, preconditioner)
        with default_options(PREFIX, self._options):
            self.snes.setFromOptions()
            self._unread -= options_read(PREFIX, self._unread)
        iterating(self.snes.ksp, method)

    def solve(
        self, solution: PETSc.Vec, what: str, remedies: Mapping[str, str], first: Any = None
    ) -> NewtonReport:
        """Solve from an initial guess, until samples wear by as much as they slip in the load step.

        The depth k p |s| that a slip s wears off is a compliance k |s| under the pressure, as of
        sliding, which is stable whatever it is. Slips hardly depend on it, and are those of the
        solution before. Nothing is solved anew where slip wears nothing.

        Args:
            solution: The initial guess; receives the solution.
            first: Has `take`, as `FirstSteps`: takes the first steps, which count as Newton's.
            what: What is solved for, for the error.
            remedies: By the name of PETSc's reason what to do; ``""`` for all others.

        Raises:
            NotConverged: With the name of PETSc's reason; or slips and depths do not settle.
            InputError: With the names of options that PETSc did not read; some are read where the
                first system is solved.
        """
        contacts, reports = self._equations.contacts, []
        wearing = [one for one in contacts if one.slip_wear is not None and one.sliders is not None]
        for one in wearing:
            one.wearing = None
        try:
            for _ in range(_MOST_WORN):
                reports.append(self._solve(solution, what, remedies, first))
                if not any([one.wears_on(solution) for one in wearing]):
                    iterations = sum(one.iterations for one in reports)
                    linear = sum(one.linear_iterations for one in reports)
                    return replace(reports[-1], iterations=iterations, linear_iterations=linear)
            raise NotConverged(
                "wear by slip",
                reason="slips and worn depths do not settle",
                iterations=_MOST_WORN,
                remedy="take more load steps, or a smaller coefficient of wear",
            )
        except Exception:
            for one in wearing:
                one.wearing = None
            raise

    def _solve(
        self, solution: PETSc.Vec, what: str, remedies: Mapping[str, str], first: Any
    ) -> NewtonReport:
        """Solve under the compliances by wear as they are."""
        self._residuals, snes = [], self.snes
        own = self._preconditioner is not None  # PETSc's are made with the first system
        *tolerances, most = snes.getTolerances()
        before: Array = np.empty(0)
        spent = 0
        with nullcontext() if own else default_options(PREFIX, self._options):
            with compat.errors_of_callbacks():
                if first is not None:
                    snes.ksp.setOperators(self._equations.tangent, self._equations.matrix)
                    before, spent = first.take(snes.ksp, solution, most)
                snes.setTolerances(*tolerances, max_it=most - len(before))
                try:
                    snes.solve(None, solution)
                finally:
                    snes.setTolerances(*tolerances, max_it=most)
            self._unread -= options_read(PREFIX, self._unread)
        iterations = len(before) + int(snes.its)
        if self._unread and iterations:
            raise InputError(
                "PETSc's solvers have no such option, or no use for it here",
                key="petsc_options",
                value=sorted(self._unread),
                allowed="names without prefix and dash, such as 'pc_type'",
            )
        reason = reason_name(PETSc.SNES.ConvergedReason, snes.reason)
        if snes.reason < 0:
            remedy = remedies.get(reason, remedies[""])
            if reason == "DIVERGED_LINEAR_SOLVE":
                reason += f" ({reason_name(PETSc.KSP.ConvergedReason, snes.ksp.reason)})"
            raise NotConverged(what, reason=reason, iterations=iterations, remedy=remedy)
        return NewtonReport(
            iterations=iterations,
            linear_iterations=spent + int(snes.getLinearSolveIterations()),
            residuals=np.concatenate([before, self._residuals]),
            reason=reason,
        )

    def _residual(self, _snes: PETSc.SNES, x: PETSc.Vec, residual: PETSc.Vec) -> None:
        self._equations.residual(x, residual)

    def _tangent(self, snes: PETSc.SNES, x: PETSc.Vec, _tangent: Any, _matrix: Any) -> None:
        self._equations.update_tangent(x)
        if self._preconditioner is not None:
            self._preconditioner.update()
        if self.forcing:
            now, wanted = self._residuals[-1], snes.getTolerances()[0]
            snes.ksp.setTolerances(rtol=max(min(_LOOSEST, now), _SPARE * wanted / now))

    def _converged(self, snes: PETSc.SNES, its: int, norms: tuple[float, float, float]) -> int:
        scale = self._equations.scale
        self._residuals.append(norms[2] / scale if scale > 0.0 else norms[2])
        done = norms[2] <= snes.getTolerances()[0] * scale
        return int(PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE) if done else 0
