"""All differences between dolfinx 0.5, 0.9 and 0.11, behind one set of functions.

Differences are found by feature, never by version number. Other modules use these functions, what
all releases share, and petsc4py.
"""

from __future__ import annotations

import ctypes
import inspect
import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Annotated, Any

import basix
import ffcx
import numpy as np
import ufl
from dolfinx import cpp, fem, io, jit
from dolfinx import mesh as dmesh
from dolfinx.fem import petsc as fem_petsc
from numpy.typing import NDArray
from petsc4py import PETSc

from patchlaw.macro.disk_caches import TIMEOUT, form_folder, trusted
from patchlaw.support import Array, Counts, Has, Indices, InputError, Limits, Locals, checked
from patchlaw.support.packages import away

Mesh = Annotated[Any, Has("a mesh of dolfinx", ("topology", "geometry"))]
Space = Annotated[Any, Has("a function space of dolfinx", ("mesh", "dofmap", "element"))]
Displacement = Annotated[Any, Has("a Function of dolfinx", ("function_space", "x"))]
Condition = Annotated[Any, Has("a Dirichlet condition of dolfinx", ("dof_indices",))]
Degree = Annotated[int, Limits(ge=1, le=10)]
"""Degree of polynomials."""

_JIT = {
    "cffi_debug": False,
    "cffi_extra_compile_args": ["-O2", "-g0"],
    "cffi_libraries": None,
    "cffi_verbose": False,
    "timeout": TIMEOUT,  # for a slow machine on which another process compiles the same form
}
"""How forms are compiled: what dolfinx does by itself, but for the time."""

HAS_VTX = hasattr(io, "VTXWriter")
"""Whether this dolfinx was built with ADIOS2."""

CELLS = {
    name: getattr(basix.CellType, name)
    for name in ("triangle", "quadrilateral", "tetrahedron", "hexahedron")
}
"""Cells of bodies, by dolfinx' names."""
SHAPES = {
    4: ("tetrahedron", 1),
    8: ("hexahedron", 1),
    10: ("tetrahedron", 2),
    27: ("hexahedron", 2),
}
"""Cells and the degree of their shape, by the number of their nodes."""
_PLANE_SHAPES = {
    3: ("triangle", 1),
    4: ("quadrilateral", 1),
    6: ("triangle", 2),
    9: ("quadrilateral", 2),
}
_NODES = {
    "triangle": (3, 6),
    "quadrilateral": (4, 9),
    "tetrahedron": (4, 10),
    "hexahedron": (8, 27),
}
"""Nodes of Lagrange cells of degree 1 and 2."""


@contextmanager
def quiet_compiler() -> Iterator[None]:
    """Suppress the compiler's command lines, which older releases log."""
    root = logging.getLogger()
    level, disabled = root.level, root.manager.disable
    logging.disable(logging.INFO)
    try:
        yield
    finally:
        root.setLevel(level)  # setuptools changes it
        logging.disable(disabled)


def _read_settings() -> None:
    """Let dolfinx and FFCx read their files of settings, which they do once.

    Raises:
        InputError: When they cannot.
    """
    options = [getattr(of, "get_options", None) or of.get_parameters for of in (jit, ffcx)]
    try:
        for get in options:
            get()
    except (OSError, ValueError) as error:
        raise InputError(
            f"dolfinx cannot read its settings ({error}); mend the file, or set XDG_CONFIG_HOME to "
            "a folder without it",
            key="form compiler",
        ) from error


@cache
def _form_options() -> dict[str, dict[str, Any]]:
    """Return all options of the compiler of forms, which no file then changes, by their keyword."""
    older = not hasattr(jit, "get_options")  # dolfinx 0.5
    given = import_module("ffcx.parameters" if older else "ffcx.options")
    known = given.FFCX_DEFAULT_PARAMETERS if older else given.FFCX_DEFAULT_OPTIONS
    word = "params" if older else "options"
    values = {name: one[isinstance(one[0], type)] for name, one in known.items()}  # after a type
    return {f"jit_{word}": {**_JIT, "cache_dir": form_folder()}, f"form_compiler_{word}": values}


@contextmanager
def _compiling() -> Iterator[dict[str, dict[str, Any]]]:
    """Compile without log messages, and explain errors of the compiler; yield its options."""
    with quiet_compiler(), away(), trusted(form_folder()):
        _read_settings()
        yield {name: dict(values) for name, values in _form_options().items()}


@quiet_compiler()
def mesh_from_cells(
    cells: Counts, points: Array, neighbours: tuple[Counts, Counts] | None, comm: Any
) -> Any:
    """Make a mesh of hexahedra or tetrahedra, straight or of second order, or a plane one.

    Args:
        cells: Numbers of the nodes of this rank's share of the cells in the order of dolfinx, shape
            (cells, 8 or 4), or (cells, 27 or 10) with edges that may be curved; there may be none.
            On a plane (cells, 4 or 3), or (cells, 9 or 6).
        points: This rank's share of the nodes, numbered through the ranks, shape (n, 3); on a plane
            (n, 2).
        neighbours: None to let dolfinx distribute the cells, with ghosts in 0.5 and none later. For
            cells that stay on their rank, without ghosts: indices of this rank's cells next to
            those of other ranks, and these ranks; at least one pair for every common facet and none
            twice.
        comm: MPI communicator.

    Note:
        Collective. The coordinate element is that of dolfinx' own readers: compiled forms serve
        both.
    """
    dimension = points.shape[1]
    kind, degree = (SHAPES if dimension == 3 else _PLANE_SHAPES)[cells.shape[1]]
    older = "ghost_mode" in inspect.signature(dmesh.create_mesh).parameters  # dolfinx 0.5
    domain = _shape_domain(kind, degree, dimension, older)
    options: dict[str, Any] = {"domain" if older else "e": domain}
    if neighbours is not None:
        rows, ranks = np.arange(len(cells)), np.full(len(cells), comm.rank)
        if older:  # it finds common vertices through ghosts, which it drops afterwards
            rows, ranks = map(np.concatenate, zip((rows, ranks), neighbours, strict=True))
            options["ghost_mode"] = dmesh.GhostMode.none
        stay = _adjacency(rows, ranks)
        options["partitioner"] = lambda *_: stay
    return dmesh.create_mesh(comm, cells=cells, x=points, **options)


def _shape_domain(kind: str, degree: int, dimension: int, older: bool) -> Any:
    """Return the coordinate element of such cells, as UFL's mesh."""
    if older:
        cell = ufl.Cell(kind, geometric_dimension=dimension)
        element = ufl.FiniteElement("Lagrange", cell, degree, variant="equispaced")
        return ufl.Mesh(ufl.VectorElement(element))
    variant = basix.LagrangeVariant.equispaced
    element = basix.ufl.element(
        "Lagrange", kind, degree, variant, shape=(dimension,), dtype=np.float64
    )
    return ufl.Mesh(element)


def _adjacency(rows: Counts, values: Counts) -> Any:
    """Return the adjacency list of values by row, in their order; every row has at least one."""
    order = np.argsort(rows, kind="stable")
    offsets = np.concatenate([[0], np.cumsum(np.bincount(rows))])
    return cpp.graph.AdjacencyList_int32(values[order].astype(np.int32), offsets.astype(np.int32))


@checked
def vector_space(mesh: Mesh, degree: Degree) -> Any:
    """Return the continuous Lagrange space of displacements, a component per dimension.

    Args:
        mesh: dolfinx mesh.
        degree: Polynomial degree.
    """
    return scalar_space(mesh, degree, shape=(mesh.geometry.dim,))


def scalar_space(
    mesh: Any, degree: int, family: str = "Lagrange", *, shape: tuple[int, ...] = ()
) -> Any:
    """Return a space of scalars, or of as many in every node as a vector or tensor has components.

    Args:
        mesh: dolfinx mesh.
        degree: Polynomial degree.
        family: ``"Lagrange"``, continuous, or ``"DG"``, discontinuous between cells.
        shape: Shape of the values: that of scalars, (d,) or (d, d) in d dimensions.
    """
    if hasattr(fem, "functionspace"):  # which compiles nothing
        return fem.functionspace(mesh, (family, degree, *[shape] * bool(shape)))
    kind = (ufl.FiniteElement, ufl.VectorElement, ufl.TensorElement)[len(shape)]
    with _compiling() as options:
        return fem.FunctionSpace(mesh, kind(family, mesh.ufl_cell(), degree), **options)


def cell_constant(mesh: Any, values: Any, name: str | None = None) -> Any:
    """Return a function that is constant on every cell.

    Args:
        mesh: dolfinx mesh.
        values: The values of this rank's cells, ghosts included, shape (cells, …).
        name: Name of the function in files.
    """
    space = scalar_space(mesh, 0, "DG", shape=np.shape(values)[1:])
    function = fem.Function(space, name=name)
    rows = cell_nodes(space)[:, 0]
    function.x.array.reshape(len(rows), -1)[rows] = np.reshape(values, (len(rows), -1))
    return function


def is_hexahedral(mesh: Any) -> bool:
    """Tell whether the cells of a mesh are hexahedra; else they are tetrahedra."""
    return bool(mesh.topology.cell_name() == "hexahedron")


def geometry_degree(mesh: Any) -> int:
    """Return the degree of the shape of a mesh's cells: 2 where edges can be curved."""
    return 2 if cell_vertices(mesh).shape[1] in (6, 9, 10, 27) else 1


def cell_nodes(space: Any) -> Locals:
    """Return the rank-local nodes of every rank-local cell, shape (cells, nodes per cell)."""
    table = space.dofmap.list
    if isinstance(table, np.ndarray):
        return table
    return table.array.reshape(-1, space.dofmap.dof_layout.num_dofs)


def lagrange_degree(space: Any) -> int:
    """Return the polynomial degree of a Lagrange space."""
    element = space.ufl_element()
    return int(element.degree if isinstance(element.degree, int) else element.degree())


def holds_displacements(space: Any) -> bool:
    """Tell whether a space is continuous Lagrange of degree 1 or 2 with a component per dimension.

    Args:
        space: Function space on any mesh, no part of a mixed one.
    """
    mesh, nodes = space.mesh, space.dofmap
    sizes = {nodes.index_map_bs, space.num_sub_spaces, mesh.geometry.dim}
    if sizes != {mesh.topology.dim}:
        return False
    # vertices of other elements have no nodes of their own
    own = len(nodes.dof_layout.entity_dofs(0, 0)) == 1
    return own and nodes.dof_layout.num_dofs in _NODES.get(mesh.topology.cell_name(), ())


def collapsed(space: Any) -> tuple[Any, Locals]:
    """Return a part of a mixed space as a space of its own, and its unknowns in the whole.

    Args:
        space: The part, ``W.sub(i)``.
    """
    alone, taken = space.collapse()
    return alone, np.ravel(np.asarray(taken, np.int32))  # later than 0.9: for each kind of cells


def cell_vertices(mesh: Any) -> Locals:
    """Return the rows of ``mesh.geometry.x`` of every rank-local cell, shape (cells, vertices)."""
    geometry = mesh.geometry
    table = geometry.dofmaps[0] if hasattr(geometry, "dofmaps") else geometry.dofmap
    if isinstance(table, np.ndarray):
        return table
    return table.array.reshape(-1, geometry.cmap.create_dof_layout().num_dofs)


def lagrange_values(cell_name: str, degree: int, points: Array) -> NDArray:
    """Tabulate the scalar Lagrange basis on the reference cell, shape (points, nodes).

    Nodes that are not on the facet of a point have exact zeros there.

    Args:
        cell_name: Name of the cell, such as ``hexahedron``.
        degree: Polynomial degree.
        points: Reference coordinates, shape (points, dimension).
    """
    values = _tabulated(cell_name, degree, points, 0)[0]
    return np.where(np.abs(values) < 1e-12, 0.0, values)


def lagrange_gradients(cell_name: str, degree: int, points: Array | None = None) -> Array:
    """Return the gradients of the scalar Lagrange basis, shape (points, basis, 3).

    Args:
        cell_name: Name of the cell, such as ``hexahedron``.
        degree: Polynomial degree.
        points: Reference coordinates, shape (points, 3); the nodes of the basis by default.
    """
    points = lagrange_points(cell_name, degree) if points is None else points
    return np.moveaxis(_tabulated(cell_name, degree, points, 1)[1:], 0, 2)


def lagrange_points(cell_name: str, degree: int) -> Array:
    """Return the nodes of the Lagrange basis of degree 1 or 2 in the reference cell, (nodes, 3).

    Args:
        cell_name: Name of the cell, such as ``hexahedron``.
        degree: Polynomial degree.
    """
    return np.asarray(_lagrange(cell_name, degree).points)


def lagrange_table(cell_name: str, degree: int, points: Array) -> Array:
    """Return the Lagrange basis and its derivatives along the coordinates.

    Args:
        cell_name: Name of the cell, such as ``hexahedron``.
        degree: Polynomial degree, 1 or 2.
        points: Coordinates in the reference cell of dimension d, shape (n, d).

    Returns:
        Values, then derivatives along each coordinate, shape (1 + d, n, nodes).
    """
    return _tabulated(cell_name, degree, points, 1)


def _tabulated(cell_name: str, degree: int, points: Array, order: int) -> Array:
    """Return the basis and its derivatives up to an order, shape (derivatives, points, nodes)."""
    element = _lagrange(cell_name, degree)
    if not len(points):  # basix 0.5 aborts the process on no points
        return np.empty((1 + order * points.shape[1], 0, element.dim))
    return np.asarray(element.tabulate(order, points))[..., 0]


@cache
def _lagrange(cell_name: str, degree: int) -> Any:
    return basix.create_element(
        basix.ElementFamily.P, CELLS[cell_name], degree, basix.LagrangeVariant.equispaced
    )


def reference_facets(cell_name: str) -> tuple[Array, Indices]:
    """Return the reference cell's vertices (nv, d) and the vertices of its facets (nf, ·)."""
    cell = CELLS[cell_name]
    return np.asarray(basix.geometry(cell)), np.asarray(basix.topology(cell)[-2], dtype=np.intp)


def triangle_rule(degree: int) -> tuple[Array, Array]:
    """Return points (n, 2) and weights (n,), of sum ½, exact to ``degree`` on the triangle."""
    points, weights = basix.make_quadrature(basix.CellType.triangle, degree)
    return points, weights


def compile_form(form: Any) -> Any:
    """Compile a UFL form."""
    with _compiling() as options:
        return fem.form(form, **options)


def assemble_matrix(form: Any, conditions: Sequence[Any], kind: str = "aij") -> PETSc.Mat:
    """Assemble a compiled bilinear form, with ones on the diagonal of the constrained rows.

    Args:
        form: Compiled form.
        conditions: Dirichlet conditions.
        kind: PETSc's type of the matrix. ``baij`` holds 3 × 3 blocks: for 27 neighbours it is
            assembled in half and multiplied in 0.6 of the time of ``aij``, and 0.3 kB smaller per
            unknown; few preconditioners take it.

    Note:
        Collective.
    """
    matrix = fem_petsc.create_matrix(form, kind)
    assemble_matrix_into(matrix, form, conditions)
    return matrix


def assemble_vector(form: Any) -> PETSc.Vec:
    """Assemble a compiled linear form, contributions of all ranks added."""
    vector = fem_petsc.assemble_vector(form)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return vector


def petsc_vector(function: Any) -> PETSc.Vec:
    """Return PETSc's view of a function, ghosts included."""
    return function.x.petsc_vec if hasattr(function.x, "petsc_vec") else function.vector


def sum_of_ranks(space: Any, values: NDArray[Any]) -> Array:
    """Return the sums of all ranks' values at this rank's degrees of freedom of a space.

    Args:
        space: The space.
        values: This rank's values, those of ghosts included.
    """
    function = fem.Function(space)
    function.x.array[:] = values
    vector = petsc_vector(function)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return np.array(vector.array_r[: vector.local_size])


def assemble_matrix_into(matrix: PETSc.Mat, form: Any, conditions: Sequence[Any]) -> None:
    """Assemble a compiled bilinear form into the matrix that `assemble_matrix` made for it.

    Args:
        matrix: The matrix.
        form: Compiled form.
        conditions: Dirichlet conditions.

    Note:
        Collective.
    """
    matrix.zeroEntries()
    fem_petsc.assemble_matrix(matrix, form, list(conditions), 1.0)
    matrix.assemble()


def assemble_vector_into(vector: PETSc.Vec, form: Any) -> None:
    """Assemble a compiled linear form; ranks have their own contributions, ghosts included.

    Args:
        vector: A vector that `assemble_vector` made for the form.
        form: Compiled form.
    """
    with vector.localForm() as local:
        local.set(0.0)
    fem_petsc.assemble_vector(vector, form)


def lift(vector: PETSc.Vec, form: Any, conditions: Sequence[Any], values: PETSc.Vec) -> None:
    """Add what a step to the prescribed values adds to a residual, before ranks are summed.

    Args:
        vector: The residual, with this rank's own contributions.
        form: Compiled form of its derivative.
        conditions: Dirichlet conditions.
        values: The values now, ghosts up to date.
    """
    fem_petsc.apply_lifting(vector, [form], [list(conditions)], [values], -1.0)


def write_misfit(vector: PETSc.Vec, conditions: Sequence[Any], values: PETSc.Vec) -> None:
    """Write the present less the prescribed values into the constrained rows of a residual.

    Args:
        vector: The residual.
        conditions: Dirichlet conditions.
        values: The values now.
    """
    fem_petsc.set_bc(vector, list(conditions), values, -1.0)


def write_tags(file: Any, tags: Any, mesh: Any) -> None:
    """Write tags of a mesh's facets or cells to an XDMF file that holds the mesh; collective."""
    in_python = inspect.isfunction(io.XDMFFile.write_meshtags)  # later than 0.5
    file.write_meshtags(tags, *([mesh.geometry] if in_python else []))


@cache
def _petsc() -> ctypes.CDLL:
    """Return the PETSc library that petsc4py itself is linked with."""
    return ctypes.CDLL(PETSc.__file__)


def call(name: str, *arguments: Any) -> None:
    """Call a function of PETSc's C interface that petsc4py does not offer.

    Args:
        name: The function.
        arguments: As `ctypes` takes them.

    Raises:
        PETSc.Error: When it fails.
    """
    code = getattr(_petsc(), name)(*arguments)
    if code:
        raise PETSc.Error(code)


@contextmanager
def errors_of_callbacks() -> Iterator[None]:
    """Let the errors of Python functions that PETSc calls be raised as they are.

    From PETSc 3.25 on petsc4py raises its own error, whose cause is that of the function.
    """
    try:
        yield
    except PETSc.Error as error:
        if error.__cause__ is None:
            raise
        raise error.__cause__ from None


def collect_garbage(comm: PETSc.Comm) -> None:
    """Free PETSc objects that Python has dropped on all ranks, and every rank's own objects.

    From 3.18 on PETSc keeps distributed objects until this call, because ranks drop them at
    different times; 3.18 keeps those of a single rank too.

    Args:
        comm: Communicator of one of them.

    Note:
        Collective.
    """
    if hasattr(PETSc, "garbage_cleanup"):
        for of in (comm, PETSc.COMM_SELF):
            PETSc.garbage_cleanup(of)


@contextmanager
def vtx_writer(path: str) -> Iterator[Callable[[float, Any], None]]:
    """Yield a function that writes a Lagrange function of any degree at a time to a VTX file.

    The file is made with the first function; without ADIOS2 there is none.

    Args:
        path: Folder to write, ending in ``.bp``.

    Note:
        Collective.
    """
    made: list[Any] = []

    def write(time: float, function: Any) -> None:
        if not HAS_VTX:
            return
        if not made:
            made.extend(
                (function, io.VTXWriter(function.function_space.mesh.comm, path, [function]))
            )
        shown, file = made
        shown.x.array[:] = function.x.array
        file.write(float(time))

    try:
        yield write
    finally:
        if made:
            made[1].close()
