"""An elastic body on any mesh, with materials by volume, and supports and tractions by surface.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.materials import Material
from macro import compat
from macro.elastic_body import ElasticBody
from macro.elasticity import stiffness_form
from macro.linear_solvers.options import solve_linear
from macro.linear_solvers.selection import body_solver
from macro.linear_solvers.stiffened import Stiffened
from macro.mesh.tagged import TaggedMesh
from support.collective import together
from support.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Support:
    """A surface whose displacement is prescribed.

    Args:
        tag: Marker of its facets.
        displacement: Displacement along x, y and z [mm]; None for a component that is free.
    """

    tag: int
    displacement: tuple[float | None, float | None, float | None] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Traction:
    """A surface that is loaded.

    Args:
        tag: Marker of its facets.
        stress: Force per area along x, y and z, shape (3,) [MPa].
    """

    tag: int
    stress: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class MeshedBody(ElasticBody):
    """A linear elastic body on a mesh of tetrahedra or hexahedra.

    Args:
        mesh: The mesh with its markers.
        materials: Elastic constants by marker of the volumes, or those of the whole body.
        supports: Surfaces whose displacement is prescribed; they must hold the body.
        tractions: Loaded surfaces, beside the contact.
        normal: Direction out of the contact face, along which `reaction` is taken, shape (3,).
        order: Degree of the displacements, 1 or 2.

    Raises:
        InputError: When a cell has no material.

    Note:
        Construction and every method are collective over the mesh's communicator.
    """

    mesh: TaggedMesh
    materials: Material | Mapping[int, Material]
    supports: Sequence[Support]
    tractions: Sequence[Traction] = ()
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    order: int = 1

    def __post_init__(self) -> None:
        together(self.comm, lambda: self.cell_lame)

    @property
    def degree(self) -> int:
        """Polynomial degree of the displacements."""
        return self.order

    @property
    def poisson_ratio(self) -> float:
        """Largest Poisson's ratio in the body."""
        if isinstance(self.materials, Material):
            return self.materials.poisson_ratio
        return max(material.poisson_ratio for material in self.materials.values())

    @cached_property
    def cell_lame(self) -> tuple[Any, Any]:
        """Lamé's constants of this rank's cells: numbers, or arrays of shape (cells,) [MPa]."""
        if isinstance(self.materials, Material):
            return self.materials.lame
        cells = self.mesh.mesh.topology.index_map(3)
        constants = np.zeros((2, cells.size_local + cells.num_ghosts))
        tags = self.mesh.cell_tags
        for tag, material in self.materials.items() if tags is not None else ():
            constants[:, tags.find(tag)] = np.array(material.lame)[:, None]
        bare = int(np.sum(constants[1] == 0.0))
        if bare:
            raise InputError(
                f"{bare} cells of the body have no material",
                key="materials",
                value=sorted(self.materials),
                allowed="the markers of all volumes",
            )
        return constants[0], constants[1]

    @cached_property
    def form(self) -> Any:
        """Bilinear form of the stiffness, as UFL."""
        if isinstance(self.materials, Material):
            return stiffness_form(self.space, self.materials, self.quadrature_degree)
        constant = compat.scalar_space(self.mesh.mesh, 0, "DG")
        rows = compat.cell_nodes(constant)[:, 0]
        lame = []
        for values in self.cell_lame:
            function = fem.Function(constant)
            function.x.array[rows] = values
            lame.append(function)
        return stiffness_form(self.space, (lame[0], lame[1]), self.quadrature_degree)

    @cached_property
    def conditions(self) -> list[Any]:
        """Dirichlet conditions of the supports; their values are those of the prescription."""
        found = []
        for support, nodes in zip(self.supports, self._support_nodes, strict=True):
            for axis, value in enumerate(support.displacement):
                if value is not None:
                    dofs = (3 * nodes + axis).astype(np.int32)
                    held = PETSc.ScalarType(value)
                    found.append(fem.dirichletbc(held, dofs, self.space.sub(axis)))
        return found

    @cached_property
    def solver(self) -> PETSc.KSP:
        """Linear solver of the body alone; its preconditioner also serves the contact solves."""
        _ = self._held_row  # needs 70 bytes an unknown for a moment, which are free as yet
        return self.solver_of()

    def solver_of(self, stiffened: Stiffened | None = None) -> PETSc.KSP:
        """Return a linear solver for the stiffness, and for what else holds the body.

        Args:
            stiffened: The stiffness with springs, which the preconditioner then knows; keep it as
                long as the solver. None: no springs.
        """
        return body_solver(
            self.stiffness,
            self.space,
            degree=self.degree,
            poisson_ratio=self.poisson_ratio,
            free=self.free,
            linear=lambda: self.linear,
            stiffened=stiffened,
        )

    @cached_property
    def linear(self) -> MeshedBody:
        """The same body with linear displacements."""
        return replace(self, order=1)

    def reaction(self, displacement: PETSc.Vec) -> float:
        """Return the force that the supports bear against contact pressures, from nodal residuals.

        Args:
            displacement: Owned degrees of freedom, without the preload [mm].

        Returns:
            The force along the normal of the contact face [N].
        """
        return float(self._held_row.dot(displacement))

    @cached_property
    def preload(self) -> Array | None:
        """Displacements without contact, this rank's owned ones [mm]; None where there are none.

        They follow from tractions, and from supports that move.
        """
        moved = any(value for support in self.supports for value in support.displacement)
        if not moved and not self.tractions:
            return None
        held = fem.Function(self.space)
        for support, nodes in zip(self.supports, self._support_nodes, strict=True):
            for axis, value in enumerate(support.displacement):
                if value is not None:
                    held.x.array[3 * nodes + axis] = value
        load = self.stiffness.createVecRight()
        if moved:
            load.axpy(-1.0, self._product(held))
        if self.tractions:
            load.axpy(1.0, self._traction_load())
        load.pointwiseMult(load, self.free)
        solution = self.stiffness.createVecRight()
        solve_linear(self.solver, load, solution)
        return np.asarray(solution.array_r + held.x.array[: self.owned_dofs])

    def _traction_load(self) -> PETSc.Vec:
        test = ufl.TestFunction(self.space)
        mesh, tags = self.mesh.mesh, self.mesh.facet_tags
        ds = ufl.Measure("ds", domain=mesh, subdomain_data=tags)
        stresses = [
            fem.Constant(mesh, np.array(each.stress, PETSc.ScalarType)) for each in self.tractions
        ]
        terms = [
            ufl.inner(stress, test) * ds(each.tag)
            for stress, each in zip(stresses, self.tractions, strict=True)
        ]
        return compat.assemble_vector(compat.compile_form(sum(terms[1:], terms[0])))

    def _product(self, function: Any) -> PETSc.Vec:
        """Return the product of the unconstrained stiffness and a function [N]."""
        return compat.assemble_vector(compat.compile_form(ufl.action(self.form, function)))

    @cached_property
    def _held_row(self) -> PETSc.Vec:
        """Sum of the unconstrained stiffness' rows of held displacements along the normal."""
        lift = fem.Function(self.space)
        for support, nodes in zip(self.supports, self._support_nodes, strict=True):
            for axis, value in enumerate(support.displacement):
                if value is not None:
                    lift.x.array[3 * nodes + axis] = self.normal[axis]
        return self._product(lift)

    @cached_property
    def _support_nodes(self) -> list[NDArray[np.int32]]:
        """This rank's nodes of every support, ghosts included."""
        tags = self.mesh.facet_tags
        self.mesh.mesh.topology.create_connectivity(2, 3)
        return [
            np.sort(fem.locate_dofs_topological(self.space, 2, tags.find(support.tag)))
            for support in self.supports
        ]
