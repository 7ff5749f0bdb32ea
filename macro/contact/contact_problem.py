"""A user's own variational problem with rough interfaces, solved by Newton's method.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import ufl
from petsc4py import PETSc

from patchlaw.geometry.sliding import SAFE, slide_in_steps
from patchlaw.macro import compat
from patchlaw.macro.contact.contact_forces import ContactForces
from patchlaw.macro.contact.face_equilibrium import FaceEquilibrium
from patchlaw.macro.contact.initial_guess import FirstSteps, SpringGuess
from patchlaw.macro.contact.interface import Interface
from patchlaw.macro.contact.newton import ContactEquations, Newton, NewtonReport
from patchlaw.macro.elastic_body import rigid_body_modes
from patchlaw.macro.linear_solvers.node_matrices import Displacements, free_unknowns
from patchlaw.macro.linear_solvers.options import ALGEBRAIC_DEFAULTS, UNSYMMETRIC
from patchlaw.macro.linear_solvers.selection import algebraic_options
from patchlaw.support import Array, InputError, NotConverged, checked

_SMALL = 3000
"""Largest number of unknowns that is factorised by default. The coarse grids of smaller problems
have too few nodes for the rigid body modes of PETSc 3.18."""

_FACTORISED = {"pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}

_INNER = 1e-3
"""Share of the inner forces J u that residuals are compared with where contact forces are less: of
the largest so far, because a body without any load has none at its solution."""

_REMEDIES = {
    "DIVERGED_LINEAR_SOLVE": "another linear solver by petsc_options: {'pc_type': 'lu'}, or "
    "{'ksp_type': 'gmres'} where the tangent is not symmetric; and supports that hold the body",
    "DIVERGED_LINE_SEARCH": "start from a nearer solution: smaller steps of load or approach",
    "DIVERGED_MAX_IT": "start from a nearer solution: smaller steps of load or approach",
    "": "see that residual, laws and fields are finite, and take smaller steps of load or approach",
}
"""What to do, by the name of PETSc's reason; the last for all others."""


class KeptSprings:
    """Springs of pointwise laws in a matrix that preconditioners are made of.

    They follow the tangent once that has moved far from them. What the two differ by is applied, so
    that the matrix and this are the whole derivative at any time.

    Args:
        forces: Those of the laws.

    Attributes:
        slope: Slopes of the springs in the matrix, as `ContactForces.slope`.
    """

    def __init__(self, forces: ContactForces) -> None:
        self._forces = forces
        self.slope = np.zeros_like(forces.slope)

    def keep_in(self, matrix: PETSc.Mat, elements: float) -> None:
        """Let the springs in a matrix follow the tangent.

        Args:
            matrix: An assembled matrix of elasticity.
            elements: Stiffness of its elements at the face [MPa/mm].

        Note:
            Collective.
        """
        forces = self._forces
        if forces.mode == "pointwise" and forces.moved_from(self.slope, elements):
            forces.add_springs(forces.slope - self.slope, matrix)
            self.slope = forces.slope.copy()

    def add_product(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the product of the derivative, less that of the springs, with x to y."""
        self._forces.add_product(x, y, self.slope)


class UserEquations(ContactEquations):
    """F(u; v) less the work of contact, assembled.

    Args:
        residual: F(u; v) as UFL.
        displacement: u, a Function.
        bcs: Dirichlet conditions, also set to the interfaces.
        tangent: Derivative of F as UFL; None: `ufl.derivative`.
        interfaces: The interfaces, whose forces are constrained by the conditions.
        in_matrix: Whether the matrix keeps springs of pointwise interfaces.

    Attributes:
        displacement: u.
        matrix: The derivative of F, with unit rows for constrained unknowns, rigid body modes
            attached, and with springs of the interfaces.
        tangent: The whole derivative, a PETSc matrix without entries.

    Raises:
        InputError: When F does not depend on u.

    Note:
        Collective.
    """

    def __init__(
        self,
        residual: Any,
        displacement: Any,
        bcs: Sequence[Any],
        tangent: Any,
        interfaces: Sequence[Interface],
        *,
        in_matrix: bool,
    ) -> None:
        if displacement not in residual.coefficients():
            raise InputError("the residual does not depend on the displacement")
        self.displacement, self._bcs = displacement, list(bcs)
        tangent = ufl.derivative(residual, displacement) if tangent is None else tangent
        tangent = ufl.algorithms.expand_derivatives(tangent)  # linear ones lose the displacement
        self._ingredients = [*tangent.coefficients(), *tangent.constants()]
        self._form, self._slope = compat.compile_form(residual), compat.compile_form(tangent)
        self._residual = compat.assemble_vector(self._form)
        matrix = compat.assemble_matrix(self._slope, self._bcs)
        self._known = self._values()
        space = displacement.function_space
        for interface in interfaces:
            interface.constrain(self._bcs)
            if in_matrix:
                interface.make_room(matrix)
        known = interfaces[0].displacements if interfaces else Displacements(space, space)
        self._own, self._dimension = known.own, known.dimension
        if not _is_mixed(space):  # making room drops it
            size = space.dofmap.index_map_bs
            nodes = space.tabulate_dof_coordinates()[: space.dofmap.index_map.size_local, :size]
            matrix.setNearNullSpace(rigid_body_modes(nodes, self.comm))
        forces = [interface.forces for interface in interfaces]
        self._springs, self._keeping = [KeptSprings(one) for one in forces], in_matrix
        super().__init__(matrix, forces, self._springs)
        self._inner, self._largest = self._contact.duplicate(), 0.0

    @property
    def comm(self) -> Any:
        """Communicator of the mesh."""
        return self.displacement.function_space.mesh.comm

    @property
    def vector(self) -> PETSc.Vec:
        """The displacements as a vector of PETSc, ghosts included."""
        return compat.petsc_vector(self.displacement)

    def begin(self) -> None:
        """Forget the inner forces of earlier solves."""
        self._largest = 0.0

    def take(self, x: PETSc.Vec) -> None:
        """Put a vector of PETSc into the displacement."""
        self.displacement.x.array[: x.local_size] = x.array_r[: x.local_size]
        self.displacement.x.scatter_forward()

    def _write_residual(self, x: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Write F less known contact at x, with the step to prescribed values that x misses.

        Args:
            x: u, which the displacement becomes [mm].
            residual: Receives the residual [N]; in constrained rows what u misses [mm].
        """
        self.take(x)
        compat.assemble_vector_into(self._residual, self._form)
        compat.lift(self._residual, self._slope, self._bcs, self.vector)
        self._sum_ranks()
        self._residual.axpy(-1.0, self._contact)
        compat.write_misfit(self._residual, self._bcs, self.vector)
        residual.array[:] = self._residual.array_r

    @property
    def scale(self) -> float:
        """Norm of the contact forces, or a share of that of the largest inner forces [N]."""
        self.matrix.mult(self.vector, self._inner)
        for forces, springs in zip(self.contacts, self._springs, strict=True):
            forces.add_springs_product(-springs.slope, self.vector, self._inner)
        self._largest = max(self._largest, _INNER * self._inner.norm())
        return max(super().scale, self._largest)

    def follow(self) -> None:
        """Assemble the derivative of F anew where a function or constant in it has changed."""
        values = self._values()
        if not self.comm.allreduce(all(map(np.array_equal, values, self._known)), min):
            compat.assemble_matrix_into(self.matrix, self._slope, self._bcs)
            self._known = values
            self._elements.clear()
            for springs in self._springs:
                springs.slope = np.zeros_like(springs.slope)
        for k, springs in enumerate(self._springs if self._keeping else ()):
            springs.keep_in(self.matrix, self.elements(k))

    def elements(self, contact: int) -> float:
        """Return the stiffness of the elements at a contact, found while no springs are kept."""
        if contact not in self._elements:
            for k in range(len(self.contacts)):
                super().elements(k)
        return self._elements[contact]

    def kept_springs(self, contact: int) -> Array | None:
        """Return the slopes of the springs for a contact that the matrix holds."""
        slope = self._springs[contact].slope
        return slope if self.comm.allreduce(bool(slope.any()), max) else None

    def reaction(self) -> Array:
        """Return the sum of F less contact over the constrained displacements, (2 or 3,) [N]."""
        self._write_contact(self.vector)
        compat.assemble_vector_into(self._residual, self._form)
        self._sum_ranks()
        forces = self._residual.array_r - self._contact.array_r
        held = free_unknowns(self._bcs, self._contact.duplicate()).array_r == 0.0
        own, axis = self._own
        sums = np.bincount(axis, np.where(held, forces, 0.0)[own], self._dimension)
        return np.asarray(self.comm.allreduce(sums))

    def _sum_ranks(self) -> None:
        """Add the contributions of all ranks to the residual."""
        self._residual.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)

    def _values(self) -> list[Array]:
        """Return all that the matrix depends on."""
        return [
            np.array(each.x.array if hasattr(each, "x") else each.value)
            for each in self._ingredients
        ]


class _Solution(NamedTuple):
    """A solution on the way of what slides.

    Attributes:
        displacement: u, ghosts included [mm].
        pasts: `Interface.past` of every interface.
        iterations: Newton steps.
    """

    displacement: Array
    pasts: list[tuple[Any, FaceEquilibrium]]
    iterations: int

    @property
    def read_off(self) -> Array:
        """Force [N] and approach [mm] of every interface, shape (2, interfaces)."""
        return np.array([[state.force, state.approach] for _, state in self.pasts]).T


@dataclass(frozen=True, slots=True, kw_only=True)
class SlideReport:
    """How interfaces slid.

    Args:
        steps: Steps that the distance was cut into; each took three solutions.
        iterations: Newton steps of all.
        force_errors: What the length of the steps errs by in the force of every interface [N].
        approach_errors: The same in the approach of its plane [mm].
    """

    steps: int
    iterations: int
    force_errors: tuple[float, ...]
    approach_errors: tuple[float, ...]


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
        displacement: u, a Function; it holds the initial guess, and the solution afterwards. In a
            mixed space it has all unknowns, and interfaces are on the part ``W.sub(i)``.
        bcs: Dirichlet conditions.
        interfaces: The interfaces; their conditions are set to `bcs`.
        tangent: Derivative of the residual as UFL; None: `ufl.derivative`.
        petsc_options: Options of the solvers without a prefix, such as ``{"pc_type": "lu"}``. By
            default conjugate gradients with algebraic multigrid, hypre's for linear elements and
            PETSc's for quadratic ones, or with a factorisation of small, plane and mixed
            problems. What stands
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
        spaces = [interface.space for interface in self.interfaces]
        if any(
            one is not space and not (one.component() and space.contains(one)) for one in spaces
        ):
            raise InputError("an interface is that of another space than the displacement's")
        self._equations = UserEquations(
            residual, displacement, bcs, tangent, self.interfaces, in_matrix=in_matrix
        )
        small = self._equations.matrix.getSize()[0] <= _SMALL
        mixed, plane = _is_mixed(space), space.mesh.topology.dim == 2
        usual = _FACTORISED if small or mixed or plane else _multigrid(space)
        # multigrid smooths with the shell otherwise, whose tangent moves on
        options = {**usual, "pc_use_amat": False}
        if mixed or any(interface.forces.sliders for interface in self.interfaces):
            options |= UNSYMMETRIC
        self._newton = Newton(self._equations, options=options, given=petsc_options, method="gmres")
        self._guess = SpringGuess(self._equations)
        self._first_steps = FirstSteps(self._equations, self._guess)

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
        what, first = f"the body at {loads}", self._first_steps
        try:
            self.report = report = self._newton.solve(solution, what, _REMEDIES, first)
        except Exception:
            self.displacement.x.array[:] = start
            for interface, plane in zip(self.interfaces, planes, strict=True):
                interface.forces.plane = plane
            raise
        equations.take(solution)
        states = [interface.evaluate(self.displacement) for interface in self.interfaces]
        self._guess.learn(solution, [state.sample_pressure for state in states])
        for interface in self.interfaces:
            self._check_range(interface, report.iterations)
        for interface in self.interfaces:
            interface.accept(self.displacement)
        return report.iterations

    def slide(self, distance: float) -> SlideReport:
        """Let the interfaces that wear slide, in steps that are short enough.

        The distance is slid in steps, and in two halves of each; what both differ by is the error
        of the halves, which stay (docs/wear.md). Loads stay as they are.

        Args:
            distance: How far [mm].

        Raises:
            InputError: When no interface wears, or it is no distance.
            NotConverged: As `solve` does; everything is then what it was before.
        """
        wearing = [interface for interface in self.interfaces if interface.wears]
        if not wearing:
            raise InputError("no interface wears", key="wear", allowed="Interface(…, wear=1e-8)")
        if not distance > 0.0:
            raise InputError("is no distance", key="distance", value=distance, allowed="> 0 mm")

        def press(share: float, before: _Solution, _began: Any) -> _Solution:
            self._take(before)
            for interface in wearing:
                interface.slide(share * distance)
            return self._as_it_is(self.solve())

        def moved(middle: _Solution, twice: _Solution) -> tuple[float, float, float]:
            change = 0.0
            pasts = zip(self.interfaces, middle.pasts, twice.pasts, strict=True)
            for interface, (_, one), (_, other) in pasts:
                changed = np.abs(other.sample_pressure - one.sample_pressure)
                change += float(interface.sampling.patch_sums(changed).sum())
            return change, float(middle.read_off[0].sum()), float(twice.read_off[0].sum())

        self.solve()
        start = self._as_it_is(0)
        try:
            slid = slide_in_steps(press, start, moved, float(start.read_off[0].sum()))
        except Exception:
            self._take(start)
            raise
        self._take(slid.state)
        forces, approaches = SAFE * np.abs(slid.state.read_off - slid.once.read_off)
        return SlideReport(
            steps=slid.steps,
            iterations=slid.iterations,
            force_errors=tuple(forces.tolist()),
            approach_errors=tuple(approaches.tolist()),
        )

    def _as_it_is(self, iterations: int) -> _Solution:
        """Return the latest solution."""
        pasts = [interface.past for interface in self.interfaces]
        return _Solution(self.displacement.x.array.copy(), pasts, iterations)

    def _take(self, known: _Solution) -> None:
        """Go back to a solution."""
        self.displacement.x.array[:] = known.displacement
        for interface, past in zip(self.interfaces, known.pasts, strict=True):
            interface.past = past

    def reaction(self) -> Array:
        """Return the force on the supports at the latest solution, shape (3,), or (2,) [N].

        It is the sum of F less contact over the constrained displacements, by component.
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


def _is_mixed(space: Any) -> bool:
    """Tell whether a space has other unknowns than displacements."""
    return bool(space.dofmap.index_map_bs == 1)


def _multigrid(space: Any) -> Mapping[str, object]:
    """Return PETSc's options of algebraic multigrid for a space of displacements."""
    if compat.lagrange_degree(space) == 2:
        return ALGEBRAIC_DEFAULTS
    return algebraic_options(space.mesh)
