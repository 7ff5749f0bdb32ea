"""A user's own variational problem with rough interfaces, solved by Newton's method.

Theory: section 11 of ``demos/theory.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from macro import compat
from macro.contact.contact_tangent import ContactTangent
from macro.contact.interface import Interface
from macro.contact.newton import NONLINEAR_DEFAULTS, NewtonReport, newton_tolerance
from macro.contact.user_equations import UserEquations
from macro.linear_solvers.options import (
    ALGEBRAIC_DEFAULTS,
    KRYLOV_DEFAULTS,
    PREFIX,
    default_options,
    iterating,
    options_read,
    reason_name,
    weakly,
)
from macro.linear_solvers.selection import algebraic_options
from support.errors import InputError, NotConverged

Array = NDArray[np.float64]

_INNER = 1e-3
"""Share of the inner forces J u that residuals are compared with where contact forces are less: of
the largest so far, because a body without any load has none at its solution."""

_SMALL = 3000
"""Largest number of unknowns that is factorised by default. The coarse grids of smaller problems
have too few nodes for the rigid body modes of PETSc 3.18."""

_FACTORISED = {"pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}

_REMEDIES = {
    "DIVERGED_LINEAR_SOLVE": "another linear solver by petsc_options: {'pc_type': 'lu'}, or "
    "{'ksp_type': 'gmres'} where the tangent is not symmetric; and supports that hold the body",
    "DIVERGED_LINE_SEARCH": "start from a nearer solution: smaller steps of load or approach",
    "DIVERGED_MAX_IT": "start from a nearer solution: smaller steps of load or approach",
}
_USUAL = "see that residual, laws and fields are finite, and take smaller steps of load or approach"


class ContactProblem:
    """Find u with F(u; v) = the work of the contact pressures, under Dirichlet conditions.

    The tangent is exact: that of F, assembled, plus that of the interfaces, which is applied
    without being assembled. F's own is assembled anew when a function or constant in it has
    changed, so that linear materials keep matrix and preconditioner. Steps towards prescribed
    values that the initial guess misses are part of Newton's first step.

    Args:
        residual: F(u; v) as UFL: internal less external virtual work, in N and mm.
        displacement: u, a Function; it holds the initial guess, and the solution afterwards.
        bcs: Dirichlet conditions.
        interfaces: The interfaces; their conditions are set to `bcs`.
        tangent: Derivative of the residual as UFL; None: `ufl.derivative`.
        petsc_options: Options of the solvers without a prefix, such as ``{"pc_type": "lu"}``. By
            default conjugate gradients with algebraic multigrid, hypre's for linear elements and
            PETSc's for quadratic ones, or with a factorisation of small problems. What stands
            behind ``-patchlaw_`` on the command line wins. A factorisation alone (``"ksp_type":
            "preonly"``) preconditions GMRES, as contact is no part of what is factorised.
        in_matrix: Whether the tangents of pointwise interfaces are assembled too, so that the
            preconditioner knows them: needed where only contact holds the body. The preconditioner
            is made anew in every Newton step then.

    Attributes:
        displacement: u.
        interfaces: The interfaces.
        report: Iterations and residuals of the latest solve; None before.

    Raises:
        InputError: On all ranks, when an interface is that of another space, or F is not in u; from
            the first solve, when PETSc has no use for one of the options.

    Note:
        Construction and all methods are collective. A change of the mesh is not seen.
    """

    def __init__(
        self,
        residual: Any,
        displacement: Any,
        bcs: Sequence[Any] = (),
        interfaces: Interface | Sequence[Interface] = (),
        tangent: Any = None,
        *,
        petsc_options: Mapping[str, object] | None = None,
        in_matrix: bool = False,
    ) -> None:
        self.displacement = displacement
        self.interfaces = [interfaces] if isinstance(interfaces, Interface) else list(interfaces)
        self.report: NewtonReport | None = None
        space = displacement.function_space
        if not all(isinstance(interface, Interface) for interface in self.interfaces):
            raise InputError("these are no interfaces", value=self.interfaces)
        if any(interface.space is not space for interface in self.interfaces):
            raise InputError("an interface is that of another space than the displacement's")
        self._equations = UserEquations(residual, displacement, bcs, tangent)
        for interface in self.interfaces:
            interface.constrain(self._equations.bcs)
        matrix = self._equations.matrix
        self._assembling, self._in_matrix = in_matrix, list[Interface]()
        self._tangent = ContactTangent(self.interfaces)
        self._norms, self._largest = list[float](), 0.0
        self._contact = matrix.createVecRight()
        self._inner = self._contact.duplicate()
        usual = _FACTORISED if matrix.getSize()[0] <= _SMALL else _multigrid(space)
        # multigrid smooths with the shell otherwise, whose tangent moves on
        apart = {"pc_use_amat": False}
        given = dict(petsc_options or {})
        self._options = {**KRYLOV_DEFAULTS, **NONLINEAR_DEFAULTS, **usual, **apart, **given}
        self._unread = set(given)
        self._forcing = not given.keys() & {"ksp_rtol", "snes_ksp_ew"}
        self._snes = self._solver()

    def solve(self) -> int:
        """Solve from the displacement as it is.

        Returns:
            The number of Newton steps. Displacement and interfaces hold the solution.

        Raises:
            NotConverged: With the name of the reason and a remedy; the displacement is what it was
                before. Also when a closure is beyond the table of a law (``LAW_RANGE``); then the
                displacement is the solution on the tangents of the laws.
        """
        compat.collect_garbage(self._equations.comm)
        start = self.displacement.x.array.copy()
        planes = [interface.forces.plane for interface in self.interfaces]
        self._norms, self._largest = [], 0.0
        self._share_tangents()
        solution = self._equations.vector.copy()
        try:
            with default_options(PREFIX, self._options):
                self._snes.solve(None, solution)
                self._unread -= options_read(PREFIX, self._unread)
            self._require_useful_options()
            self._require_convergence()
        except Exception:
            self.displacement.x.array[:] = start
            for interface, plane in zip(self.interfaces, planes, strict=True):
                interface.forces.plane = plane
            raise
        self._equations.take(solution)
        self._finish()
        return int(self._snes.its)

    def reaction(self) -> Array:
        """Return the force that the supports bear, at the latest solution, shape (3,) [N].

        It is the sum of F less contact over the constrained unknowns, component by component.
        """
        self._write_forces()
        return self._equations.reaction(self._contact)

    def _share_tangents(self) -> None:
        """Decide which tangents are assembled: those that can be, under their indenters now."""
        self._in_matrix = [each for each in self.interfaces if self._assembling and each.assembles]
        self._tangent.follow([each for each in self.interfaces if each not in self._in_matrix])

    def _solver(self) -> PETSc.SNES:
        snes = PETSc.SNES().create(self._equations.comm)
        snes.setOptionsPrefix(PREFIX)
        matrix = self._equations.matrix
        snes.setFunction(weakly(self._write_residual), self._contact.duplicate())
        snes.setJacobian(weakly(self._update_tangent), self._tangent.shell(matrix), matrix)
        snes.setConvergenceTest(weakly(self._converged))
        with default_options(PREFIX, self._options):
            snes.setFromOptions()
            self._unread -= options_read(PREFIX, self._unread)
        iterating(snes.ksp, "gmres")
        user = PETSc.Options(PREFIX)
        self._forcing &= not (user.hasName("ksp_rtol") or user.hasName("snes_ksp_ew"))
        return snes

    def _write_residual(self, _snes: Any, x: PETSc.Vec, residual: PETSc.Vec) -> None:
        self._equations.take(x)
        self._write_forces()
        self._equations.write_residual(self._contact, residual)

    def _write_forces(self) -> None:
        """Write the contact forces of all interfaces, those on constrained unknowns included."""
        self._contact.set(0.0)
        for interface in self.interfaces:
            interface.add_forces(self.displacement, self._contact)

    def _update_tangent(self, snes: PETSc.SNES, _x: Any, _shell: Any, _matrix: Any) -> None:
        self._equations.update_matrix(always=self._assembling)
        for interface in self.interfaces:
            if interface in self._in_matrix:
                interface.add_tangent(self.displacement, self._equations.matrix)
            else:
                interface.move_tangent(self.displacement)
        if self._forcing:
            snes.ksp.setTolerances(rtol=newton_tolerance(self._norms[-1], snes.getTolerances()[0]))

    def _converged(self, snes: PETSc.SNES, _its: int, norms: tuple[float, float, float]) -> int:
        self._equations.matrix.mult(self._equations.vector, self._inner)
        self._largest = max(self._largest, _INNER * self._inner.norm())
        scale = max(self._contact.norm(), self._largest)
        self._norms.append(norms[2] / scale if scale > 0.0 else norms[2])
        done = norms[2] <= snes.getTolerances()[0] * scale
        return int(PETSc.SNES.ConvergedReason.CONVERGED_FNORM_RELATIVE) if done else 0

    def _require_useful_options(self) -> None:
        """Refuse options that PETSc did not read; some are read where the first system is solved.

        Raises:
            InputError: With their names.
        """
        if self._unread and self._snes.its:
            raise InputError(
                "PETSc's solvers have no such option, or no use for it here",
                key="petsc_options",
                value=sorted(self._unread),
                allowed="names without prefix and dash, such as 'pc_type'",
            )

    def _require_convergence(self) -> None:
        snes = self._snes
        if snes.reason >= 0:
            return
        reason = reason_name(PETSc.SNES.ConvergedReason, snes.reason)
        remedy = _REMEDIES.get(reason, _USUAL)
        if reason == "DIVERGED_LINEAR_SOLVE":
            reason += f" ({reason_name(PETSc.KSP.ConvergedReason, snes.ksp.reason)})"
        loads = ", ".join(str(interface.forces.control) for interface in self.interfaces)
        raise NotConverged(
            f"the body at {loads}", reason=reason, iterations=int(snes.its), remedy=remedy
        )

    def _finish(self) -> None:
        """Note iterations, evaluate the interfaces, and check the ranges of their laws."""
        self.report = NewtonReport(
            iterations=int(self._snes.its),
            linear_iterations=int(self._snes.getLinearSolveIterations()),
            residuals=np.array(self._norms),
            reason=reason_name(PETSc.SNES.ConvergedReason, self._snes.reason),
        )
        for interface in self.interfaces:
            interface.evaluate(self.displacement)
        for interface in self.interfaces:
            try:
                interface.check_range()
            except InputError as error:
                raise NotConverged(
                    f"the laws at {interface.forces.control}",
                    reason=f"LAW_RANGE: {error}",
                    iterations=self.report.iterations,
                    remedy="make the laws up to a larger approach",
                ) from error


def _multigrid(space: Any) -> Mapping[str, object]:
    """Return PETSc's options of algebraic multigrid for a space of displacements."""
    if compat.lagrange_degree(space) == 2:
        return ALGEBRAIC_DEFAULTS
    return algebraic_options(space.mesh)
