"""A linear elastic body in dolfinx: displacement space, supports, assembled stiffness and solver.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray
from petsc4py import PETSc

from macro import compat
from macro.elasticity import rigid_body_modes
from macro.linear_solvers.options import PREFIX, solve_linear

Array = NDArray[np.float64]


class ElasticBody(ABC):
    """A linear elastic body that is held, ready to be loaded on a face.

    Stiffness and preconditioner are made once, on first use, and serve every load afterwards.

    Attributes:
        mesh: Its dolfinx mesh as ``mesh.mesh``, and ``mesh.facet_tags``.

    Note:
        Everything is collective over the communicator of the mesh.
    """

    mesh: Any

    @property
    @abstractmethod
    def degree(self) -> int:
        """Polynomial degree of the displacements."""

    @property
    @abstractmethod
    def form(self) -> Any:
        """Bilinear form of the stiffness, as UFL."""

    @property
    @abstractmethod
    def conditions(self) -> list[Any]:
        """Dirichlet conditions of the supports."""

    @property
    @abstractmethod
    def solver(self) -> PETSc.KSP:
        """Linear solver of the body alone; its preconditioner also serves the contact solves."""

    @property
    @abstractmethod
    def cell_lame(self) -> tuple[Any, Any]:
        """Lamé's constants of this rank's cells: numbers, or arrays of shape (cells,) [MPa]."""

    @abstractmethod
    def reaction(self, displacement: PETSc.Vec) -> float:
        """Return the force that the supports bear against contact pressures, from nodal residuals.

        Args:
            displacement: Owned degrees of freedom [mm].

        Returns:
            The force [N].
        """

    @property
    def preload(self) -> Array | None:
        """Displacements without contact, this rank's owned ones [mm]; None where there are none."""
        return None

    @property
    def comm(self) -> Any:
        """Communicator of the mesh."""
        return self.mesh.mesh.comm

    @cached_property
    def space(self) -> Any:
        """Vector Lagrange space of the displacements."""
        return compat.vector_space(self.mesh.mesh, self.degree)

    @property
    def hexahedral(self) -> bool:
        """Whether the cells are hexahedra."""
        return bool(self.mesh.mesh.topology.cell_name() == "hexahedron")

    @property
    def dofs(self) -> int:
        """Number of degrees of freedom, all ranks together."""
        return 3 * int(self.space.dofmap.index_map.size_global)

    @property
    def owned_dofs(self) -> int:
        """Number of degrees of freedom that this rank owns."""
        return 3 * int(self.space.dofmap.index_map.size_local)

    @property
    def quadrature_degree(self) -> int:
        """Degree of the quadrature of the stiffness.

        It is exact on boxes and straight tetrahedra, and full integration on distorted hexahedra.
        """
        return 2 * self.degree if self.hexahedral else 2 * (self.degree - 1)

    def assembled(self, kind: str = "aij") -> PETSc.Mat:
        """Return the stiffness matrix [N/mm] with unit rows for constrained degrees of freedom.

        Args:
            kind: PETSc's type of the matrix.
        """
        matrix = compat.assemble_matrix(compat.compile_form(self.form), self.conditions, kind)
        if kind == "aij":
            matrix.setOption(PETSc.Mat.Option.SPD, True)  # for the user's direct solvers
        if kind == "aij" or PETSc.Options(PREFIX).hasName("pc_type"):  # 48 bytes an unknown
            points = self.space.tabulate_dof_coordinates()[: self.owned_dofs // 3]
            matrix.setNearNullSpace(rigid_body_modes(points, self.comm))
        return matrix

    @cached_property
    def stiffness(self) -> PETSc.Mat:
        """Stiffness matrix [N/mm] with unit rows for constrained degrees of freedom.

        Quadratic elements have it in blocks of 3 × 3, which geometric multigrid takes: 0.74 instead
        of 1.05 kB an unknown on tetrahedra. Algebraic multigrid takes none.
        """
        return self.assembled("baij" if self.degree == 2 else "aij")

    @property
    @abstractmethod
    def linear(self) -> ElasticBody:
        """The same body with linear displacements; for quadratic ones, made on first use."""

    def solve(self, load: PETSc.Vec) -> Any:
        """Return the displacement under a nodal load.

        Args:
            load: Nodal forces [N], zero at constrained degrees of freedom.

        Returns:
            dolfinx Function, ghosts up to date [mm].

        Raises:
            NotConverged: When the linear solver fails.
        """
        solution = self.stiffness.createVecRight()
        solve_linear(self.solver, load, solution)
        return self.function(solution.array_r)

    def function(self, values: Array, name: str = "displacement") -> Any:
        """Return rank-local displacements as a Function.

        Args:
            values: Owned degrees of freedom [mm], ghosts may follow.
            name: Name of the function in files.
        """
        function = fem.Function(self.space, name=name)
        function.x.array[: self.owned_dofs] = values[: self.owned_dofs]
        function.x.scatter_forward()
        return function

    @property
    def free(self) -> PETSc.Vec:
        """1 for free degrees of freedom, 0 for those that the supports constrain."""
        free = self.stiffness.createVecRight()
        free.set(1.0)
        for condition in self.conditions:
            dofs, _ = condition.dof_indices()
            free.array[dofs[dofs < self.owned_dofs]] = 0.0
        return free
