"""Equations that Newton's method solves: equilibrium of a body with laws, or of a user's problem.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl
from petsc4py import PETSc

from patchlaw.macro import compat
from patchlaw.macro.contact.contact_forces import ContactForces, ContactTangent
from patchlaw.macro.contact.interface import Interface
from patchlaw.macro.elastic_body import rigid_body_modes
from patchlaw.macro.linear_solvers.node_matrices import free_unknowns
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError

_INNER = 1e-3
"""Share of the inner forces J u that residuals are compared with where contact forces are less: of
the largest so far, because a body without any load has none at its solution."""


class Equilibrium:
    """The equations K u = B p(c(u)) of a body in contact with a rigid plane.

    The plane is eliminated by its own nonlinear equilibrium, so that displacements are the only
    unknowns of Newton's method. The residual K u − B p is the gradient of a convex energy if no law
    softens. Its derivative K + B (diag(p'/w) − E Eᵀ) Bᵀ is applied without being assembled; it lies
    between K and the derivative under a fixed plane.

    Args:
        body: The `ElasticBody`, or a `BodyPair`.
        forces: Forces of the laws on its contact face.

    Attributes:
        body: The elastic body.
        forces: Forces of the laws on its contact face.
        matrix: K.
        tangent: The derivative at the displacement last given to ``update_tangent``, a PETSc
            matrix without entries.
        scale: Norm of the contact face's load at the displacement last given to ``residual`` [N].

    Note:
        Every method is collective.
    """

    def __init__(self, body: Any, forces: ContactForces) -> None:
        self.body, self.forces, self.matrix = body, forces, body.stiffness
        self.scale = 0.0
        self._load = self.matrix.createVecLeft()
        self.tangent = ContactTangent([forces]).shell(self.matrix)

    def residual(self, displacement: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Write the residual K u − B p(closure(u)) at a displacement u.

        Args:
            displacement: u [mm].
            residual: Receives the residual [N].
        """
        self.forces.write(displacement, self._load)
        self.scale = self._load.norm()
        self.matrix.mult(displacement, residual)
        residual.axpy(-1.0, self._load)

    def update_tangent(self, displacement: PETSc.Vec) -> None:
        """Move the tangent to a displacement."""
        self.forces.update(displacement)


class KeptSprings:
    """Springs of pointwise laws in a matrix that preconditioners are made of.

    They follow the tangent once that has moved far from them. What the two differ by is applied, so
    that the matrix and this are the whole derivative at any time.

    Args:
        interface: The interface of the laws.
    """

    def __init__(self, interface: Interface) -> None:
        self._interface = interface
        self._slope = np.zeros_like(interface.forces.slope)
        self._elements: float | None = None

    def keep_in(self, matrix: PETSc.Mat, *, fresh: bool) -> None:
        """Let the springs in a matrix follow the tangent.

        Args:
            matrix: An assembled matrix of elasticity.
            fresh: Whether it holds no springs, as it was assembled anew.

        Note:
            Collective.
        """
        if fresh:
            self._slope = np.zeros_like(self._slope)
        if self._interface.mode != "pointwise":
            return
        forces = self._interface.forces
        if fresh or self._elements is None:  # no springs in the matrix yet
            self._elements = self._interface.sampling.stiffness_of_elements(matrix)
        if forces.moved_from(self._slope, self._elements):
            self._interface.add_springs(forces.slope - self._slope, matrix)
            self._slope = forces.slope.copy()

    def add_product(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the product of the derivative, less that of the springs, with x to y."""
        self._interface.add_product(x, y, self._slope)

    def subtract(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Take the product of the springs with x from y."""
        self._interface.add_springs_product(-self._slope, x, y)


class UserEquations:
    """F(u; v) less the work of contact, assembled.

    Args:
        residual: F(u; v) as UFL.
        displacement: u, a Function.
        bcs: Dirichlet conditions, also set to the interfaces.
        tangent: Derivative of F as UFL; None: `ufl.derivative`.
        interfaces: The interfaces.
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
        self.matrix = compat.assemble_matrix(self._slope, self._bcs)
        self._known = self._values()
        space = displacement.function_space
        nodes = space.tabulate_dof_coordinates()[: space.dofmap.index_map.size_local]
        self.matrix.setNearNullSpace(rigid_body_modes(nodes, self.comm))
        self._interfaces, self._keeping = interfaces, in_matrix
        for interface in interfaces:
            interface.constrain(self._bcs)
        self._springs = [KeptSprings(interface) for interface in interfaces]
        self.tangent = ContactTangent(self._springs).shell(self.matrix)
        self._contact = self.matrix.createVecRight()
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

    def residual(self, x: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Write F less contact at x, with the step to prescribed values that x misses.

        Args:
            x: u, which the displacement becomes [mm].
            residual: Receives the residual [N]; in constrained rows what u misses [mm].
        """
        self.take(x)
        self._write_contact()
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
        for springs in self._springs:
            springs.subtract(self.vector, self._inner)
        self._largest = max(self._largest, _INNER * self._inner.norm())
        return max(self._contact.norm(), self._largest)

    def update_tangent(self, _x: PETSc.Vec) -> None:
        """Move the tangent to the displacement.

        The derivative of F is assembled anew where a function or constant in it has changed.
        """
        values = self._values()
        same = self.comm.allreduce(all(map(np.array_equal, values, self._known)), min)
        if not same:
            compat.assemble_matrix_into(self.matrix, self._slope, self._bcs)
            self._known = values
        for interface, springs in zip(self._interfaces, self._springs, strict=True):
            interface.move_tangent(self.displacement)
            if self._keeping:
                springs.keep_in(self.matrix, fresh=not same)

    def reaction(self) -> Array:
        """Return the sum of F less contact over the constrained unknowns, shape (3,) [N]."""
        self._write_contact()
        compat.assemble_vector_into(self._residual, self._form)
        self._sum_ranks()
        forces = self._residual.array_r - self._contact.array_r
        held = free_unknowns(self._bcs, self._contact.duplicate()).array_r == 0.0
        return np.asarray(
            self.comm.allreduce(np.where(held, forces, 0.0).reshape(-1, 3).sum(axis=0))
        )

    def _write_contact(self) -> None:
        """Write the contact forces of all interfaces, those on constrained unknowns included."""
        self._contact.set(0.0)
        for interface in self._interfaces:
            interface.add_forces(self.displacement, self._contact)

    def _sum_ranks(self) -> None:
        """Add the contributions of all ranks to the residual."""
        self._residual.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)

    def _values(self) -> list[Array]:
        """Return all that the matrix depends on."""
        return [
            np.array(each.x.array if hasattr(each, "x") else each.value)
            for each in self._ingredients
        ]
