"""The elastic block: its supports, its stiffness, and the solver that its lattice allows.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.materials import Material
from macro import compat
from macro.elastic_body import ElasticBody
from macro.elasticity import stiffness_form
from macro.linear_solvers.multigrid import Lattice, lattice_of
from macro.linear_solvers.selection import block_solver
from macro.mesh.block import BlockMesh
from support.errors import InputError

Sides = Literal["free", "roller"]

_FLAT = 1e-9
"""Distance from a face, relative to the size of the block, that is rounding."""


@dataclass(frozen=True, eq=False)
class Block(ElasticBody):
    """An elastic block, clamped at the bottom, ready to be loaded on its top.

    Args:
        mesh: Mesh with marked faces.
        material: Elastic constants.
        sides: ``"free"`` of traction, or ``"roller"``: no normal displacement on the four side
            planes, no shear traction.

    Raises:
        InputError: When ``sides`` is neither.

    Note:
        Construction and every method are collective over the mesh's communicator.
    """

    mesh: BlockMesh
    material: Material
    sides: Sides = "free"

    def __post_init__(self) -> None:
        if self.sides not in get_args(Sides):
            raise InputError(
                "unknown support of the sides", value=self.sides, allowed="free, roller"
            )

    @property
    def degree(self) -> int:
        """Polynomial degree of the displacements."""
        return self.mesh.shape.degree

    @property
    def cell_lame(self) -> tuple[float, float]:
        """Lamé's constants [MPa]."""
        return self.material.lame

    @cached_property
    def conditions(self) -> list[Any]:
        """Dirichlet conditions: the clamped bottom and, on request, the rollers."""
        clamped = fem.dirichletbc(np.zeros(3, PETSc.ScalarType), self._bottom, self.space)
        rollers = [self._roller(axis) for axis in (0, 1)] if self.sides == "roller" else []
        return [clamped, *rollers]

    @cached_property
    def stiffness(self) -> PETSc.Mat:
        """Stiffness matrix [N/mm] with unit rows for constrained degrees of freedom."""
        return self.assembled("baij" if self.lattice or self.degree == 2 else "aij")

    @cached_property
    def solver(self) -> PETSc.KSP:
        """Linear solver of the block alone; its preconditioner also serves the contact solves."""
        return block_solver(
            self.stiffness,
            self.space,
            self.mesh.shape,
            self.lattice,
            self.material,
            self.free,
            lambda: self.linear,
        )

    @cached_property
    def linear(self) -> Block:
        """The same block with linear displacements."""
        shape = self.mesh.shape
        linear = replace(shape, element=f"{shape.element[0]}1")
        return Block(replace(self.mesh, shape=linear), self.material, self.sides)

    def reaction(self, displacement: PETSc.Vec) -> float:
        """Return the reaction force of the clamped bottom, from nodal residuals [N].

        Args:
            displacement: Owned degrees of freedom [mm].
        """
        return float(self._bottom_row.dot(displacement))

    @cached_property
    def lattice(self) -> Lattice | None:
        """The rectangular lattice of the nodes; None where they form none."""
        return lattice_of(self.space, self.mesh)

    @cached_property
    def form(self) -> Any:
        """Bilinear form of the stiffness, as UFL."""
        return stiffness_form(self.space, self.material, self.quadrature_degree)

    @cached_property
    def _bottom_row(self) -> PETSc.Vec:
        """Sum of the unconstrained stiffness' rows of the bottom's vertical displacements."""
        lift = fem.Function(self.space)
        lift.x.array[3 * self._bottom + 2] = 1.0
        return compat.assemble_vector(compat.compile_form(ufl.action(self.form, lift)))

    @property
    def _bottom(self) -> NDArray[np.int32]:
        """This rank's nodes and ghosts on the bottom, ascending; the roughness does not move it."""
        above = self.space.tabulate_dof_coordinates()[:, 2] + self.mesh.shape.height
        return np.flatnonzero(above < _FLAT * self.mesh.shape.height).astype(np.int32)

    def _roller(self, axis: int) -> Any:
        """Fix the normal displacement on the two side planes across an axis."""
        shape, place = self.mesh.shape, self.space.tabulate_dof_coordinates()[:, axis]
        low, high = -shape.margin, shape.interface[axis] + shape.margin
        slack = _FLAT * (high - low)
        across = np.flatnonzero((place < low + slack) | (place > high - slack))
        dofs = (3 * across + axis).astype(np.int32)
        return fem.dirichletbc(PETSc.ScalarType(0.0), dofs, self.space.sub(axis))
