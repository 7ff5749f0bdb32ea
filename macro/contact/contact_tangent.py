"""Tangent of a user's problem with contact: its matrix, plus what interfaces add to products."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import Any, Protocol

from petsc4py import PETSc

_MATRIX = "patchlaw matrix"


class AddsProduct(Protocol):
    """An interface whose derivative is applied without being assembled."""

    def add_product(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the product of the derivative with a vector x to y."""
        ...


class ContactTangent:
    """What PETSc holds of a matrix plus the derivatives of interfaces, which the user keeps.

    The references to them are weak, and PETSc itself counts the matrix: an object that Python lets
    go of while PETSc frees the shell would never be freed.

    Args:
        interfaces: The interfaces.
    """

    def __init__(self, interfaces: Sequence[AddsProduct]) -> None:
        self.follow(interfaces)

    def follow(self, interfaces: Sequence[AddsProduct]) -> None:
        """Take the derivatives of other interfaces from now on."""
        self._interfaces = [weakref.proxy(interface) for interface in interfaces]

    def shell(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Return the sum with a matrix, as a PETSc matrix without entries."""
        shell = PETSc.Mat().createPython(matrix.getSizes(), self, comm=matrix.comm)
        shell.compose(_MATRIX, matrix)
        shell.setUp()
        return shell

    def mult(self, shell: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the product with x; PETSc calls this."""
        shell.query(_MATRIX).mult(x, y)
        for interface in self._interfaces:
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
