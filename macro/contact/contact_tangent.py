"""Tangent of a user's problem with contact: its matrix, plus what interfaces add to products."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from petsc4py import PETSc

from macro.linear_solvers.options import WeakContext


class AddsProduct(Protocol):
    """An interface whose derivative is applied without being assembled."""

    def add_product(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the product of the derivative with a vector x to y."""
        ...


class ContactTangent:
    """A matrix plus the derivatives of interfaces.

    Args:
        matrix: The user's matrix.
        interfaces: The interfaces.

    Attributes:
        interfaces: The interfaces; others may be set.
        shell: The sum, a PETSc matrix without entries; this object must be kept as long as it.
    """

    def __init__(self, matrix: PETSc.Mat, interfaces: Sequence[AddsProduct]) -> None:
        self._matrix, self.interfaces = matrix, interfaces
        self.shell = PETSc.Mat().createPython(
            matrix.getSizes(), WeakContext(self), comm=matrix.comm
        )
        self.shell.setUp()

    def mult(self, _shell: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the product with x; PETSc calls this."""
        self._matrix.mult(x, y)
        for interface in self.interfaces:
            interface.add_product(x, y)


def free_unknowns(space: Any, conditions: Sequence[Any], like: PETSc.Vec) -> PETSc.Vec:
    """Return 1 for free degrees of freedom and 0 for constrained ones.

    Args:
        space: The space of the displacements.
        conditions: Dirichlet conditions.
        like: A vector of such degrees of freedom.
    """
    free, owned = like.duplicate(), 3 * int(space.dofmap.index_map.size_local)
    free.set(1.0)
    for condition in conditions:
        dofs, _ = condition.dof_indices()
        free.array[dofs[dofs < owned]] = 0.0
    return free
