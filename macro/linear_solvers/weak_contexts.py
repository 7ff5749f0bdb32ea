"""Python contexts of PETSc objects that do not keep what they lead to."""

from __future__ import annotations

import weakref
from typing import Any

from petsc4py import PETSc


class WeakContext:
    """What a PETSc matrix or preconditioner calls, which its owner must keep alive.

    A context that PETSc keeps lets go of its matrices only while PETSc frees dropped objects
    (`macro.compat.collect_garbage`), and those that are dropped meanwhile are never freed.

    Args:
        context: Has ``mult`` or ``apply``, as petsc4py asks of contexts.
    """

    def __init__(self, context: Any) -> None:
        self._context = weakref.ref(context)

    def mult(self, matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write a matrix's product y with x."""
        self._owned.mult(matrix, x, y)

    def apply(self, conditioner: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write a preconditioner's y for x."""
        self._owned.apply(conditioner, x, y)

    @property
    def _owned(self) -> Any:
        context = self._context()
        if context is None:
            raise ReferenceError("the owner of a PETSc context is gone")
        return context
