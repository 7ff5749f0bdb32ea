"""A user's own variational problem with rough interfaces, solved by Newton's method.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import ufl

from patchlaw.macro import compat
from patchlaw.macro.contact.interface import Interface
from patchlaw.macro.contact.newton import Newton, NewtonReport, UserEquations
from patchlaw.macro.linear_solvers.options import ALGEBRAIC_DEFAULTS, UNSYMMETRIC
from patchlaw.macro.linear_solvers.selection import algebraic_options
from patchlaw.support.arguments import checked
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError, NotConverged

_SMALL = 3000
"""Largest number of unknowns that is factorised by default. The coarse grids of smaller problems
have too few nodes for the rigid body modes of PETSc 3.18."""

_FACTORISED = {"pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}

_REMEDIES = {
    "DIVERGED_LINEAR_SOLVE": "another linear solver by petsc_options: {'pc_type': 'lu'}, or "
    "{'ksp_type': 'gmres'} where the tangent is not symmetric; and supports that hold the body",
    "DIVERGED_LINE_SEARCH": "start from a nearer solution: smaller steps of load or approach",
    "DIVERGED_MAX_IT": "start from a nearer solution: smaller steps of load or approach",
    "": "see that residual, laws and fields are finite, and take smaller steps of load or approach",
}
"""What to do, by the name of PETSc's reason; the last for all others."""


class ContactProblem:
    """Find u with F(u; v) = the work of the contact pressures, under Dirichlet conditions.

    The tangent is exact: that of F, assembled, plus that of the interfaces, which is applied
    without being assembled. F's own is assembled anew when a function or constant in it has
    changed, so that linear materials keep matrix and preconditioner. Steps towards prescribed
    values that the initial guess misses are part of Newton's first step. Interfaces with friction
    make the tangent unsymmetric, so that GMRES is the default; they take every solution for the end
    of a load step (`Interface.accept`).

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
        in_matrix: Whether preconditioners contain the tangents of pointwise interfaces, whose
            entries are then added to the matrix; they are made anew when these have changed much.
            False keeps one preconditioner for a linear body, which needs supports then.

    Attributes:
        displacement: u.
        interfaces: The interfaces.
        report: Iterations and residuals of the latest solve; None before.

    Raises:
        InputError: On all ranks, when an interface is that of another space, or F is not in u; from
            the first solve, when PETSc has no use for one of the options.

    Note:
        Construction and all methods are collective. The mesh must not change afterwards.
    """

    @checked
    def __init__(
        self,
        residual: ufl.Form,
        displacement: compat.Displacement,
        bcs: Sequence[compat.Condition] = (),
        interfaces: Interface | Sequence[Interface] = (),
        tangent: ufl.Form | None = None,
        *,
        petsc_options: Mapping[str, object] | None = None,
        in_matrix: bool = True,
    ) -> None:
        self.displacement = displacement
        self.interfaces = [interfaces] if isinstance(interfaces, Interface) else list(interfaces)
        self.report: NewtonReport | None = None
        space = displacement.function_space
        if any(interface.space is not space for interface in self.interfaces):
            raise InputError("an interface is that of another space than the displacement's")
        self._equations = UserEquations(
            residual, displacement, bcs, tangent, self.interfaces, in_matrix=in_matrix
        )
        usual = _FACTORISED if self._equations.matrix.getSize()[0] <= _SMALL else _multigrid(space)
        # multigrid smooths with the shell otherwise, whose tangent moves on
        options = {**usual, "pc_use_amat": False}
        if any(interface.forces.sliders for interface in self.interfaces):
            options |= UNSYMMETRIC
        self._newton = Newton(self._equations, options=options, given=petsc_options, method="gmres")

    def solve(self) -> int:
        """Solve from the displacement as it is.

        Returns:
            The number of Newton steps. Displacement and interfaces hold the solution.

        Raises:
            NotConverged: With the name of the reason and a remedy; the displacement is what it was
                before, and what slipped. Also when a closure is beyond the table of a law
                (``LAW_RANGE``); then the displacement is the solution on the tangents of the laws.
        """
        equations = self._equations
        compat.collect_garbage(equations.comm)
        start = self.displacement.x.array.copy()
        planes = [interface.forces.plane for interface in self.interfaces]
        equations.begin()
        solution = equations.vector.copy()
        loads = ", ".join(str(interface.forces.control) for interface in self.interfaces)
        try:
            self.report = self._newton.solve(solution, f"the body at {loads}", _REMEDIES)
        except Exception:
            self.displacement.x.array[:] = start
            for interface, plane in zip(self.interfaces, planes, strict=True):
                interface.forces.plane = plane
            raise
        equations.take(solution)
        for interface in self.interfaces:
            interface.evaluate(self.displacement)
        for interface in self.interfaces:
            self._check_range(interface, self.report.iterations)
        for interface in self.interfaces:
            interface.accept(self.displacement)
        return self.report.iterations

    def reaction(self) -> Array:
        """Return the force on the supports at the latest solution, shape (3,) [N].

        It is the sum of F less contact over the constrained unknowns, component by component.
        """
        return self._equations.reaction()

    def _check_range(self, interface: Interface, iterations: int) -> None:
        """Refuse closures beyond the tables of laws."""
        try:
            interface.check_range()
        except InputError as error:
            raise NotConverged(
                f"the laws at {interface.forces.control}",
                reason=f"LAW_RANGE: {error}",
                iterations=iterations,
                remedy="make the laws up to a larger approach",
            ) from error


def _multigrid(space: Any) -> Mapping[str, object]:
    """Return PETSc's options of algebraic multigrid for a space of displacements."""
    if compat.lagrange_degree(space) == 2:
        return ALGEBRAIC_DEFAULTS
    return algebraic_options(space.mesh)
