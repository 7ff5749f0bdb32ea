"""The equations of a user's variational problem: residual and derivative of a form, conditions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import ufl
from numpy.typing import NDArray
from petsc4py import PETSc

from macro import compat
from macro.elasticity import rigid_body_modes
from support.errors import InputError

Array = NDArray[np.float64]


class UserEquations:
    """F(u; v) under Dirichlet conditions, assembled.

    Args:
        residual: F(u; v) as UFL.
        displacement: u, a Function.
        bcs: Dirichlet conditions.
        tangent: Derivative of F as UFL; None: `ufl.derivative`.

    Attributes:
        displacement: u.
        bcs: Dirichlet conditions.
        matrix: The derivative, with unit rows for constrained unknowns, rigid body modes attached.

    Raises:
        InputError: When F does not depend on u.

    Note:
        Collective.
    """

    def __init__(self, residual: Any, displacement: Any, bcs: Sequence[Any], tangent: Any) -> None:
        if displacement not in residual.coefficients():
            raise InputError("the residual does not depend on the displacement")
        self.displacement, self.bcs = displacement, list(bcs)
        tangent = ufl.derivative(residual, displacement) if tangent is None else tangent
        tangent = ufl.algorithms.expand_derivatives(tangent)  # linear ones lose the displacement
        self._ingredients = [*tangent.coefficients(), *tangent.constants()]
        self._form, self._slope = compat.compile_form(residual), compat.compile_form(tangent)
        self._residual = compat.assemble_vector(self._form)
        self.matrix = compat.assemble_matrix(self._slope, self.bcs)
        self._known = self._values()
        space = displacement.function_space
        nodes = space.tabulate_dof_coordinates()[: space.dofmap.index_map.size_local]
        self.matrix.setNearNullSpace(rigid_body_modes(nodes, self.comm))

    @property
    def comm(self) -> Any:
        """Communicator of the mesh."""
        return self.displacement.function_space.mesh.comm

    @property
    def vector(self) -> PETSc.Vec:
        """The displacements as a vector of PETSc, ghosts included."""
        return compat.petsc_vector(self.displacement)

    def take(self, x: PETSc.Vec) -> None:
        """Put a vector of PETSc into the displacement."""
        self.displacement.x.array[: x.local_size] = x.array_r[: x.local_size]
        self.displacement.x.scatter_forward()

    def write_residual(self, load: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Write F less a load, with the step to prescribed values that u misses.

        Args:
            load: Nodal forces that are not in F [N].
            residual: Receives the residual; in constrained rows what u misses [mm].
        """
        now = self.vector
        compat.assemble_vector_into(self._residual, self._form)
        compat.lift(self._residual, self._slope, self.bcs, now)
        self._sum()
        self._residual.axpy(-1.0, load)
        compat.write_misfit(self._residual, self.bcs, now)
        residual.array[:] = self._residual.array_r

    def update_matrix(self, *, always: bool = False) -> None:
        """Assemble the matrix anew where a function or constant in it has changed.

        Args:
            always: Whether to do so in any case.
        """
        values = self._values()
        same = all(map(np.array_equal, values, self._known))
        if always or not self.comm.allreduce(same, min):
            compat.assemble_matrix_into(self.matrix, self._slope, self.bcs)
            self._known = values

    def reaction(self, load: PETSc.Vec) -> Array:
        """Return the sum of F less a load over the constrained unknowns, shape (3,) [N].

        Args:
            load: Nodal forces that are not in F [N].
        """
        compat.assemble_vector_into(self._residual, self._form)
        self._sum()
        forces = self._residual.array_r - load.array_r
        held = np.zeros(len(forces), dtype=bool)
        for condition in self.bcs:
            dofs, _ = condition.dof_indices()
            held[dofs[dofs < len(held)]] = True
        return np.asarray(
            self.comm.allreduce(np.where(held, forces, 0.0).reshape(-1, 3).sum(axis=0))
        )

    def _sum(self) -> None:
        """Add the contributions of all ranks to the residual."""
        self._residual.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)

    def _values(self) -> list[Array]:
        """Return all that the matrix depends on."""
        return [
            np.array(each.x.array if hasattr(each, "x") else each.value)
            for each in self._ingredients
        ]
