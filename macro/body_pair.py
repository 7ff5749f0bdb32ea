"""Two elastic bodies whose displacements are the unknowns of one contact problem.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from macro.elastic_body import ElasticBody
from macro.linear_solvers.options import (
    KRYLOV_DEFAULTS,
    PREFIX,
    WeakContext,
    default_options,
    set_own_preconditioner,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BodyPair:
    """A body and the counter-body that is pressed on it.

    On every rank the unknowns are those of the body, then those of the counter-body. The stiffness
    is block diagonal, and so is the preconditioner.

    Args:
        body: The body.
        counter: The counter-body, on the same communicator. The approach is that of its supports.

    Note:
        Everything is collective.
    """

    body: ElasticBody
    counter: ElasticBody

    @property
    def comm(self) -> Any:
        """Communicator of both meshes."""
        return self.body.comm

    @property
    def dofs(self) -> int:
        """Number of degrees of freedom of both, all ranks together."""
        return self.body.dofs + self.counter.dofs

    @property
    def owned_dofs(self) -> int:
        """Number of degrees of freedom of both that this rank owns."""
        return self.body.owned_dofs + self.counter.owned_dofs

    def split(self, values: Array) -> tuple[Array, Array]:
        """Return the parts of both bodies in this rank's owned values.

        Args:
            values: Values of the body, then of the counter-body, shape (owned_dofs,).
        """
        return values[: self.body.owned_dofs], values[self.body.owned_dofs :]

    @cached_property
    def stiffness(self) -> PETSc.Mat:
        """Block diagonal stiffness [N/mm], a PETSc matrix without entries."""
        sizes = (self.owned_dofs, None)
        matrix = PETSc.Mat().createPython((sizes, sizes), WeakContext(self._product), self.comm)
        matrix.setUp()
        return matrix

    @cached_property
    def solver(self) -> PETSc.KSP:
        """Linear solver of both; its preconditioner also serves the contact solves."""
        solver = PETSc.KSP().create(self.comm)
        solver.setOptionsPrefix(PREFIX)
        solver.setOperators(self.stiffness)
        set_own_preconditioner(solver, self._preconditioner)
        with default_options(PREFIX, KRYLOV_DEFAULTS):
            solver.setFromOptions()
        solver.setUp()
        return solver

    @cached_property
    def preload(self) -> Array | None:
        """Displacements without contact, this rank's owned ones [mm]; None where there are none."""
        parts = [each.preload for each in (self.body, self.counter)]
        if all(part is None for part in parts):
            return None
        sizes = self.body.owned_dofs, self.counter.owned_dofs
        return np.concatenate(
            [
                np.zeros(size) if part is None else part
                for part, size in zip(parts, sizes, strict=True)
            ]
        )

    def reaction(self, displacement: PETSc.Vec) -> float:
        """Return the force that the body's supports bear against contact pressures [N].

        Args:
            displacement: Owned degrees of freedom of both, without the preload [mm].
        """
        part = self.body.stiffness.createVecRight()
        part.array[:] = self.split(displacement.array_r)[0]
        return self.body.reaction(part)

    @cached_property
    def _product(self) -> _Halves:
        return _Halves(self, self.body.stiffness.mult, self.counter.stiffness.mult)

    @cached_property
    def _preconditioner(self) -> _Halves:
        return _Halves(self, self.body.solver.pc.apply, self.counter.solver.pc.apply)


class _Halves:
    """Applies an operator of each body to its part of a vector; PETSc calls `mult` or `apply`.

    Args:
        pair: The bodies.
        first: Writes y for x of the body.
        second: Writes y for x of the counter-body.
    """

    def __init__(self, pair: BodyPair, first: Any, second: Any) -> None:
        self._count, self._operators = pair.body.owned_dofs, (first, second)
        self._vectors = [each.stiffness.createVecs() for each in (pair.body, pair.counter)]

    def apply(self, _owner: Any, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write y for x."""
        parts = slice(None, self._count), slice(self._count, None)
        for operate, part, (given, result) in zip(
            self._operators, parts, self._vectors, strict=True
        ):
            given.array[:] = x.array_r[part]
            operate(given, result)
            y.array[part] = result.array_r

    mult = multTranspose = apply
