"""A linear elastic body in dolfinx: displacement space, supports, assembled stiffness and solver.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_array, vstack

from patchlaw.geometry import Material
from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.multigrid import Lattice
from patchlaw.macro.linear_solvers.node_matrices import Stiffened, assemble_symmetric
from patchlaw.macro.linear_solvers.selection import (
    Spectrum,
    body_solver,
    grids_of,
    takes_rigid_body_modes,
    vertex_transfer,
)
from patchlaw.macro.linear_solvers.solvers import CoarserGrid, LinearSolver, solve_linear
from patchlaw.macro.mesh.supports import Loads, Traction
from patchlaw.macro.mesh.tagged import bounding_box
from patchlaw.support import Array, Flags, InputError, Locals


def strain(displacement: Any) -> Any:
    """Return the small strain ε = sym ∇u as a UFL expression."""
    return ufl.sym(ufl.grad(displacement))


def stress(displacement: Any, lame: tuple[Any, Any]) -> Any:
    """Return Cauchy's stress σ = λ tr(ε) I + 2 μ ε as a UFL expression [MPa].

    Args:
        displacement: UFL expression of the displacement.
        lame: Lamé's constants (λ, μ), numbers or UFL constants.
    """
    first, shear = lame
    eps = strain(displacement)
    return first * ufl.tr(eps) * ufl.Identity(3) + 2.0 * shear * eps


def stiffness_form(space: Any, lame: tuple[Any, Any], quadrature_degree: int) -> Any:
    """Return the bilinear form a(u, v) = ∫ σ(u) : ε(v) dV as UFL.

    Lamé's constants enter as UFL constants, so that one compiled form serves every material, or as
    functions that are constant on every cell.

    Args:
        space: Vector space of the displacements.
        lame: Lamé's constants (λ, μ), or arrays of those of this rank's cells [MPa].
        quadrature_degree: Polynomial degree that is integrated exactly.
    """
    mesh = space.mesh
    constants = (
        compat.cell_constant(mesh, values)
        if np.ndim(values)
        else fem.Constant(mesh, PETSc.ScalarType(values))
        for values in lame
    )
    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
    dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": quadrature_degree})
    first, shear = constants
    return ufl.inner(stress(trial, (first, shear)), strain(test)) * dx


def _vector(mesh: Any, values: Any) -> Any:
    """Return a constant vector, as UFL."""
    return fem.Constant(mesh, np.array(values, PETSc.ScalarType))


def rigid_body_modes(points: Array, comm: Any) -> PETSc.NullSpace:
    """Return the rigid body modes of nodes, the near-nullspace for algebraic multigrid.

    Args:
        points: Coordinates of the nodes of this rank, shape (n, 3), or (n, 2) of a plane [mm].
        comm: MPI communicator.

    Note:
        Collective.
    """
    coordinates = PETSc.Vec().createMPI((points.size, None), bsize=points.shape[1], comm=comm)
    coordinates.array[:] = points.ravel()
    return PETSc.NullSpace().createRigidBody(coordinates)


_ROUNDING = 1e-12
"""Force on a node over the largest one below which a product with the stiffness is rounding."""


class Held(NamedTuple):
    """A displacement component that supports prescribe at some nodes.

    Attributes:
        axis: The component: 0, 1 or 2.
        nodes: This rank's nodes, ghosts included, shape (n,).
        value: The displacement [mm].
    """

    axis: int
    nodes: Locals
    value: float = 0.0

    @property
    def dofs(self) -> Locals:
        """The degrees of freedom, shape (n,)."""
        return (3 * self.nodes + self.axis).astype(np.int32)


class ElasticBody:
    """A linear elastic body that is held, ready to be loaded on a face.

    Stiffness and preconditioner are made once, on first use, and serve every load afterwards.

    Attributes:
        mesh: Its dolfinx mesh as ``mesh.mesh``, and ``mesh.facet_tags``.
        normal: Direction out of the contact face, along which `reaction` is taken, shape (3,).
        loads: What loads it beside contact and supports: one state, or several that load steps
            pass from one to the next.
        materials: Elastic constants of the whole body, or by marker of the volumes.
        degree: Polynomial degree of the displacements.
        held: What the supports prescribe.
        of_degree: Returns the same body with displacements of a degree.

    Note:
        Everything is collective over the communicator of the mesh.
    """

    mesh: Any
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    loads: Sequence[Loads] = (Loads(),)
    materials: Any
    degree: Any
    held: Any
    of_degree: Any

    @cached_property
    def linear(self) -> Any:
        """The same body with linear displacements."""
        return self.of_degree(1)

    def as_quadratic(self) -> Any:
        """Return the same body with quadratic displacements; of linear ones."""
        body = self.of_degree(2)
        body.__dict__["linear"] = self  # the coarser grid of its multigrid
        return body

    @property
    def lattice(self) -> Lattice | None:
        """The rectangular lattice of the nodes; None where they form none."""
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
        return compat.is_hexahedral(self.mesh.mesh)

    @property
    def dofs(self) -> int:
        """Number of degrees of freedom, all ranks together."""
        return 3 * int(self.space.dofmap.index_map.size_global)

    @property
    def owned_dofs(self) -> int:
        """Number of degrees of freedom that this rank owns."""
        return 3 * int(self.space.dofmap.index_map.size_local)

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

    def materials_of(self, cells: Locals) -> set[Material]:
        """Return the materials of some cells, those of all ranks together.

        Args:
            cells: This rank's part of the cells, shape (n,).
        """
        if isinstance(self.materials, Material):
            own = {self.materials} if len(cells) else set[Material]()
        else:
            tags, by_tag = self.mesh.cell_tags, self.materials.items()
            own = {material for tag, material in by_tag if np.isin(cells, tags.find(tag)).any()}
        return set().union(*self.comm.allgather(own))

    @property
    def quadrature_degree(self) -> int:
        """Degree of the quadrature of the stiffness.

        It is exact on boxes and straight tetrahedra, and full integration on distorted hexahedra.
        """
        return 2 * self.degree if self.hexahedral else 2 * (self.degree - 1)

    @cached_property
    def form(self) -> Any:
        """Bilinear form of the stiffness, as UFL."""
        return stiffness_form(self.space, self.cell_lame, self.quadrature_degree)

    @cached_property
    def conditions(self) -> list[Any]:
        """Dirichlet conditions of the supports; their values are those of the prescription."""
        return [
            fem.dirichletbc(PETSc.ScalarType(part.value), part.dofs, self.space.sub(part.axis))
            for part in self.held
        ]

    @cached_property
    def stiffness(self) -> PETSc.Mat:
        """Stiffness matrix [N/mm] with unit rows for constrained degrees of freedom.

        It is in blocks of 3 × 3, without a lattice those on and above the diagonal alone. Algebraic
        multigrid and the user's direct solvers take none: they get a copy.
        """
        form = compat.compile_form(self.form)
        if self.lattice:
            matrix = compat.assemble_matrix(form, self.conditions, "baij")
        else:
            matrix = assemble_symmetric(form, self.conditions, self.space)
        if takes_rigid_body_modes():  # 48 bytes an unknown
            points = self.space.tabulate_dof_coordinates()[: self.owned_dofs // 3]
            matrix.setNearNullSpace(rigid_body_modes(points, self.comm))
        return matrix

    @property
    def stiffnesses(self) -> list[PETSc.Mat]:
        """The stiffness, as the one diagonal block of itself."""
        return [self.stiffness]

    @cached_property
    def solver(self) -> LinearSolver:
        """Linear solver of the body alone; its preconditioner also serves the contact solves."""
        _ = self._held_rows  # needs 70 bytes an unknown for a moment, which are free as yet
        return body_solver([self], self.stiffness)

    @cached_property
    def coarser_grids(self) -> Sequence[CoarserGrid]:
        """Grids of an algebraic multigrid of linear elements, without springs."""
        return grids_of(self.stiffness, self.mesh.mesh)

    @cached_property
    def spectrum(self) -> Spectrum:
        """What the preconditioner of the body alone leaves of its eigenvalues."""
        return Spectrum.of(self.solver)

    def release_solver(self) -> None:
        """Drop the solver of the body alone; it is made again when it is asked for."""
        _ = self.spectrum
        self.__dict__.pop("solver", None)

    @cached_property
    def from_vertices(self) -> PETSc.Mat:
        """Interpolation of quadratic displacements from those of the vertices."""
        return vertex_transfer(self.space, self.linear.space, self.free)

    def solver_of(self, stiffened: Stiffened) -> LinearSolver:
        """Return a linear solver for the stiffness whose preconditioner knows springs.

        Args:
            stiffened: The stiffness with springs; keep it as long as the solver.
        """
        return body_solver([self], self.stiffness, stiffened)

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
        free.array[:] = ~self.supported[: self.owned_dofs]
        return free

    @cached_property
    def supported(self) -> Flags:
        """Which of this rank's degrees of freedom supports constrain, those of ghosts included."""
        supported = np.zeros(3 * len(self.space.tabulate_dof_coordinates()), dtype=bool)
        for part in self.held:
            supported[part.dofs] = True
        return supported

    def preload(self, state: float = 0.0) -> Array | None:
        """Return the displacements without contact, this rank's owned ones [mm].

        They follow from tractions, temperatures, and supports that move.

        Args:
            state: Position among the states in `loads`: 0.25 is a quarter of the way from the
                first to the second.

        Returns:
            Shape (owned_dofs,); None where nothing loads the body.
        """
        return self._between(self._preload_by, state) if self.is_preloaded else None

    def free_strain(self, state: float = 0.0) -> Array:
        """Return the strain of this rank's cells by temperature alone, shape (cells,).

        Args:
            state: Position among the states in `loads`, see `preload`.
        """
        return self._between(self._cell_strain, state)

    def _between(self, found_by: Callable[[Loads], Array], state: float) -> Array:
        """Return what loads do at a position among their states."""
        first = min(int(state), len(self.loads) - 1)
        found, share = found_by(self.loads[first]), state - first
        if share:
            found = (1.0 - share) * found + share * found_by(self.loads[first + 1])
        return found

    @property
    def is_preloaded(self) -> bool:
        """Whether anything but contact moves the body."""
        return any(part.value for part in self.held) or any(one != Loads() for one in self.loads)

    @cached_property
    def _preloads(self) -> dict[Loads, Array]:
        """Displacements by loads, as far as they were found."""
        return {}

    def _preload_by(self, loads: Loads) -> Array:
        """Return the displacements by loads and by supports that move [mm]."""
        if loads not in self._preloads:
            prescribed = fem.Function(self.space)
            for part in self.held:
                prescribed.x.array[part.dofs] = part.value
            load = self.stiffness.createVecRight()
            if any(part.value for part in self.held):
                load.axpy(-1.0, self._product(prescribed))
            for form in self._load_forms(loads):
                load.axpy(1.0, compat.assemble_vector(compat.compile_form(form)))
            load.pointwiseMult(load, self.free)
            solution = self.stiffness.createVecRight()
            if load.norm():
                solve_linear(self.solver, load, solution)
            whole = solution.array_r + prescribed.x.array[: self.owned_dofs]
            self._preloads[loads] = np.asarray(whole)
        return self._preloads[loads]

    def reaction(self, displacement: PETSc.Vec) -> float:
        """Return the force that the supports bear against contact pressures, from nodal residuals.

        Without what pressures on nodes that supports hold press on them at once.

        Args:
            displacement: Owned degrees of freedom, without the preload [mm].

        Returns:
            The force along the normal of the contact face [N].
        """
        return float(np.asarray(self.normal) @ self.borne(displacement.array_r, np.zeros(3))[0])

    def borne(self, displacement: Array, point: Array) -> Array:
        """Return the force and the moment about a point that supports bear, along x, y and z.

        Args:
            displacement: This rank's owned degrees of freedom, without the preload [mm].
            point: The point, shape (3,) [mm].

        Returns:
            On the body, the force [N] and the moment [N mm], shape (2, 3); see `reaction`.

        Note:
            Collective.
        """
        force, moment = self.comm.allreduce(self._held_rows @ displacement).reshape(2, 3)
        return np.stack([force, moment + np.cross(self._middle - point, force)])

    @cached_property
    def _held_rows(self) -> csr_array:
        """Sums of the unconstrained stiffness' rows of held displacements, (6, owned dofs).

        Forces along x, y, z and moments about the middle of the body. A rigid motion of all nodes
        strains nothing: what that of the held ones does is what that of all others undoes. Columns
        of displacements that are held or apart from the supports are empty.
        """
        arms, free = self.space.tabulate_dof_coordinates() - self._middle, self.free
        rigid = compat.geometry_degree(self.mesh.mesh) <= self.degree
        motion, product, rows = fem.Function(self.space), free.duplicate(), []
        along = [np.broadcast_to(axis, arms.shape) for axis in np.eye(3)]
        for each in (*along, *(np.cross(axis, arms) for axis in np.eye(3))):
            motion.x.array[:] = each.ravel()
            moved = free.duplicate()
            moved.array[:] = motion.x.array[: self.owned_dofs]
            moved.pointwiseMult(moved, free)
            self.stiffness.mult(moved, product)
            product.scale(-1.0)
            if not rigid:  # straight displacements of curved cells strain them
                product.axpy(1.0, self._product(motion))
            row = (product.array_r * free.array_r)[None]
            largest = self.comm.allreduce(np.abs(row).max(initial=0.0), MPI.MAX)
            row[np.abs(row) <= _ROUNDING * largest] = 0.0
            rows.append(csr_array(row))
            compat.collect_garbage(self.comm)
        return csr_array(vstack(rows))

    @cached_property
    def _box(self) -> tuple[Array, Array]:
        return bounding_box(self.mesh.mesh.geometry.x, self.comm)

    @property
    def _middle(self) -> Array:
        """Middle of the body, shape (3,) [mm]."""
        return np.asarray(0.5 * (self._box[0] + self._box[1]))

    @property
    def size(self) -> float:
        """Diagonal of the box around the body [mm]."""
        return float(np.linalg.norm(self._box[1] - self._box[0]))

    def _product(self, function: Any) -> PETSc.Vec:
        """Return the product of the unconstrained stiffness and a function [N]."""
        return compat.assemble_vector(compat.compile_form(ufl.action(self.form, function)))

    def _load_forms(self, loads: Loads) -> Iterator[Any]:
        """Yield the virtual work of tractions, of pressures, and of stresses by temperature."""
        test = ufl.TestFunction(self.space)
        for each in loads.on_surfaces:
            yield ufl.inner(self._stress_on(each), test) * self._ds(each.tag)
        if any(strain for _, strain in loads.strain):
            first, shear = (np.asarray(one) for one in self.cell_lame)
            stress = (3.0 * first + 2.0 * shear) * self._cell_strain(loads)
            dx = ufl.Measure("dx", domain=self.mesh.mesh)
            yield compat.cell_constant(self.mesh.mesh, stress) * ufl.div(test) * dx

    def pull_moments(self, loads: Loads, origin: Array, axes: Array) -> Array:
        """Return the first moments of the pulls about a point, along their direction, (2,) [N mm].

        Args:
            loads: The loads.
            origin: The point, shape (3,) [mm].
            axes: Unit vectors along the two levers, shape (2, 3).

        Note:
            Collective.
        """
        mesh, moments = self.mesh.mesh, np.zeros(2)
        normal = _vector(mesh, self.normal)
        arm = ufl.SpatialCoordinate(mesh) - _vector(mesh, origin)
        for each in loads.pulls:
            for k, axis in enumerate(axes):
                along = ufl.inner(arm, _vector(mesh, axis))
                work = ufl.inner(self._stress_on(each), normal) * along * self._ds(each.tag)
                moments[k] += fem.assemble_scalar(compat.compile_form(work))
        return np.asarray(self.comm.allreduce(moments))

    def _stress_on(self, traction: Traction) -> Any:
        """Return the force per area on a loaded surface, as UFL [MPa]."""
        mesh = self.mesh.mesh
        against = fem.Constant(mesh, PETSc.ScalarType(traction.pressure))
        stress = _vector(mesh, traction.stress)
        return stress - against * ufl.FacetNormal(mesh)

    @cached_property
    def _ds(self) -> Any:
        """Measure of the marked surfaces."""
        return ufl.Measure("ds", domain=self.mesh.mesh, subdomain_data=self.mesh.facet_tags)

    def _cell_strain(self, loads: Loads) -> Array:
        """Return the free strain of this rank's cells, ghosts included, shape (cells,)."""
        cells, tags = self.mesh.mesh.topology.index_map(3), self.mesh.cell_tags
        strain = np.zeros(cells.size_local + cells.num_ghosts)
        for tag, value in loads.strain:
            strain[slice(None) if tag is None else tags.find(tag)] = value
        return strain
