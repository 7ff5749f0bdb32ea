"""Writes fields of bodies for ParaView, and the stiffness of their contact for other programs.

Displacements, stresses and contact pressures are those of bodies that were pressed as
meshes, whose displacements are kept. Elsewhere a body with a flat top is meshed after the load, and
loaded by the contact pressures: by those of the cells or asperities, summed over the facets of the
mesh, or with laws by the means of the patches. Contact stiffness is written as springs of CalculiX
and Abaqus, or in Matrix Market's format.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from dolfinx import fem, io
from scipy.sparse import csr_array

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.materials import von_mises
from patchlaw.macro import compat
from patchlaw.macro.contact.face_equilibrium import FaceEquilibrium
from patchlaw.macro.contact.face_pair import FacePair
from patchlaw.macro.contact.loaded_face import LoadedFace, Outline
from patchlaw.macro.contact.unilateral_problem import UnilateralContactProblem
from patchlaw.macro.elastic_body import ElasticBody
from patchlaw.macro.mesh.facets import exterior_facets, facet_nodes
from patchlaw.support import Array, Has, Indices, InputError, Locals, checked, on_root
from patchlaw.support.files import write_text

if TYPE_CHECKING:  # others do without
    from patchlaw.macro.eigenmodes import NaturalModes

_FILES_NOT_CLOSED: list[Any] = []
"""XDMF files that could not be closed, referenced so that no destructor runs before exit."""


Pressures = Array | None
"""Mean pressures of the N patches, shape (N,), or on a face in regions those at this rank's
quadrature points, shape (points,) [MPa]; None leaves them out."""


class FieldStep(NamedTuple):
    """What the fields of a load step are made from.

    Attributes:
        number: Number of the load step.
        displacement: This rank's owned displacements, dof by dof [mm].
        pressures: The contact pressures.
        body_state: Position among the states of the body's loads.
        further: Other functions on the mesh that are written with them.
    """

    number: int
    displacement: Array
    pressures: Pressures
    body_state: float = 0.0
    further: Sequence[Any] = ()


def write_fields(path: Path | str, face: LoadedFace, steps: Iterable[FieldStep]) -> None:
    """Write displacements [mm], stresses and contact pressures [MPa] of load steps as XDMF.

    The numbers of the load steps are the times. A stress, and its equivalent by von Mises, is that
    at the middle of a cell, computed from the displacements there; it is constant on the cell.
    Quadratic displacements are written at the vertices. The pressure of a cell is the mean pressure
    over its contact facet, weighted by the areas of the patches there, and zero elsewhere. Where
    dolfinx has ADIOS2, displacements of any degree are also written as VTX, in a folder of the same
    name that ends in ``.bp``.

    Args:
        path: File to write, ending in ``.xdmf``; an HDF5 file goes beside it.
        face: Patches on the contact face of a body.
        steps: The load steps.

    Note:
        Collective.
    """
    body = face.body

    def functions() -> Iterator[tuple[int, list[Any]]]:
        for step in steps:
            moved, pressure = body.function(step.displacement), step.pressures
            write_vtx(step.number, moved)
            shown = [] if pressure is None else [_facet_means(face, pressure, "pressure")]
            yield step.number, [*_of_body(body, moved, step.body_state), *shown, *step.further]

    with compat.vtx_writer(str(Path(path).with_suffix(".bp"))) as write_vtx:
        _write_xdmf(str(path), body.mesh.mesh, functions())


def write_solved(
    path: Path, whole: LoadedFace | FacePair, parts: PatchGrid, states: Mapping[int, Array]
) -> None:
    """Write the fields of bodies under stresses of parts of their contact face.

    Args:
        path: File to write, ending in ``.xdmf``.
        whole: The contact face of the body, or of both; their files are named as `write_displaced`
            does.
        parts: The N parts.
        states: By number of the load step the pressures, shape (N,) each; or with the shear
            stresses on the first body along both axes of the face, shape (3, N) [MPa]; where it
            wears, with the worn depths in a last row, shape (2, N) or (4, N) [mm].

    Note:
        Collective.
    """

    def solved(face: LoadedFace, counter: bool) -> Iterator[FieldStep]:
        for number, state in sorted(states.items()):
            rows, further = np.atleast_2d(state), []
            if len(rows) % 2 == 0:
                rows, worn = rows[:-1], rows[-1]
                further = [] if counter else [_facet_means(face, worn, "worn_depth")]
            load = face.load(rows if len(rows) > 1 else rows[0])
            moved = face.body.solve(load).x.array[: face.body.owned_dofs].copy()
            yield FieldStep(number, moved, rows[0], further=further)

    for counter, (name, one) in enumerate(_files(path, whole)):
        face = replace(one, patches=parts)
        write_fields(name, face, solved(face, bool(counter)))


def write_displaced(
    path: Path,
    face: LoadedFace | FacePair,
    states: Mapping[int, tuple[Array, float]],
    pressures: Callable[[int, bool], Pressures],
    further: Callable[[int], Sequence[Any]] = lambda number: (),
) -> None:
    """Write the fields of bodies whose displacements are known.

    Args:
        path: File to write, ending in ``.xdmf``; that of the counter-body begins with ``counter_``.
        face: The contact face of the body, or of both.
        states: By number of the load step this rank's displacements [mm], and the position among
            the states of the bodies' loads.
        pressures: What is shown as pressure, by load step and whether it is on the counter-body.
        further: Other functions on the mesh of the first body, by load step.

    Note:
        Collective.
    """

    def halves(counter: bool) -> Iterator[FieldStep]:
        for number, (moved, loads) in sorted(states.items()):
            own = face.body.split(moved)[counter] if isinstance(face, FacePair) else moved
            more = () if counter else further(number)
            yield FieldStep(number, own, pressures(number, counter), loads, more)

    for counter, (name, one) in enumerate(_files(path, face)):
        write_fields(name, one, halves(bool(counter)))


def _files(path: Path, face: LoadedFace | FacePair) -> Iterator[tuple[Path, LoadedFace]]:
    """Yield the contact faces of the body and the counter-body with the files of their fields."""
    names = path, path.with_name(f"counter_{path.name}")
    yield from zip(names, face.sides, strict=False)


def write_shapes(path: Path, whole: LoadedFace | FacePair, found: NaturalModes) -> None:
    """Write natural modes as XDMF, and VTX where dolfinx has it, mode k at the time k.

    Displacements are those of a mode whose largest one is 1 mm. Of modes that have merged, whose
    points do not move in phase, those a quarter of a period later follow at the time k + 1/4.

    Args:
        path: File to write, ending in ``.xdmf``; see `write_displaced`.
        whole: The contact face of the body, or of both.
        found: The modes.

    Note:
        Collective.
    """
    own = abs(found.shapes).max(axis=0, initial=0.0)
    largest = np.max(whole.comm.allgather(own), axis=0)
    shapes = found.shapes / largest
    times = {k + 1.0: shape.real for k, shape in enumerate(shapes.T)}
    grown = np.flatnonzero(found.eigenvalues.real)
    times |= {k + 1.25: -shapes[:, k].imag for k in map(int, grown)}
    starts = np.cumsum([0, *(one.body.owned_dofs for one in whole.sides)])
    for (name, face), start in zip(_files(path, whole), starts, strict=False):
        body, mesh = face.body, face.body.mesh.mesh
        space = compat.vector_space(mesh, compat.geometry_degree(mesh))

        def functions(body: Any = body, space: Any = space, start: int = start) -> Iterator[Any]:
            for time, shape in sorted(times.items()):
                moved = body.function(shape[start : start + body.owned_dofs], "mode")
                write_vtx(time, moved)
                yield time, [_interpolated(space, moved, "mode")]

        with compat.vtx_writer(str(name.with_suffix(".bp"))) as write_vtx:
            _write_xdmf(str(name), mesh, functions())


def surface_shapes(body: ElasticBody, shapes: Array) -> tuple[Array, Array]:
    """Return the facets around a body and what they move by, the same on every rank.

    Args:
        body: The body.
        shapes: This rank's rows of displacements, shape (owned_dofs, k).

    Returns:
        Corners of the facets, shape (n, corners, 3) [mm], and their displacements, (k, n, corners,
        3).

    Note:
        Collective.
    """
    mesh, space = body.mesh.mesh, body.space
    corners = compat.reference_facets(mesh.topology.cell_name())[1]
    corners = corners[:, [0, 1, 3, 2]] if body.hexahedral else corners  # around a quadrilateral
    outer = facet_nodes(mesh, exterior_facets(mesh))
    nodes = compat.cell_nodes(space)[outer.cell[:, None], corners[outer.side]]
    moved = [body.function(shape).x.array.reshape(-1, 3)[nodes] for shape in shapes.T]
    parts = body.comm.allgather((space.tabulate_dof_coordinates()[nodes], np.array(moved)))
    places, displaced = zip(*parts, strict=True)
    return np.concatenate(places), np.concatenate(displaced, axis=1)


def write_rough_fields(
    path: Path | str,
    problem: UnilateralContactProblem,
    steps: Iterable[tuple[int, FaceEquilibrium]],
) -> None:
    """Write displacements [mm], stresses and contact pressures [MPa] of a rough block as XDMF.

    The numbers of the load steps are the times; displacements and stresses are those of
    `write_fields`. The pressure of a vertex is its contact force over its tributary area, including
    its shares of the nodes between vertices; the pressure is linear between vertices.

    Args:
        path: File to write, ending in ``.xdmf``; an HDF5 file goes beside it.
        problem: The contact problem of the rough block.
        steps: Number of each load step, and its state.

    Note:
        Collective.
    """
    block, mesh = problem.body, problem.body.mesh.mesh

    def functions() -> Iterator[tuple[int, list[Any]]]:
        space = compat.scalar_space(mesh, compat.geometry_degree(mesh))
        for number, state in steps:
            pressures = _interpolated(space, _vertex_pressures(problem, state), "pressure")
            yield number, [*_of_body(block, block.function(state.displacement)), pressures]

    _write_xdmf(str(path), mesh, functions())


def cell_stresses(body: ElasticBody, displacement: Any, body_state: float = 0.0) -> Array:
    """Return the stresses at the middles of this rank's cells, shape (cells, 3, 3) [MPa].

    Args:
        body: The body.
        displacement: Its displacements, ghosts up to date.
        body_state: Position among the states of its loads, whose temperatures strain it freely.
    """
    mesh = body.mesh.mesh
    name, geometry = mesh.topology.cell_name(), compat.cell_vertices(mesh)
    middle = compat.reference_facets(name)[0].mean(axis=0)[None]

    def gradient(values: Array, cells: Locals, degree: int) -> Array:
        total = np.zeros((len(cells), 3, 3))
        for node, slope in enumerate(compat.lagrange_gradients(name, degree, middle)[0]):
            total += values[cells[:, node], :, None] * slope
        return total

    moved = displacement.x.array.reshape(-1, 3)
    strain = gradient(moved, compat.cell_nodes(body.space), body.degree) @ np.linalg.inv(
        gradient(mesh.geometry.x, geometry, compat.geometry_degree(mesh))
    )
    free = body.free_strain(body_state)[:, None, None] * np.eye(3)
    strain = 0.5 * (strain + np.swapaxes(strain, 1, 2)) - free
    first, shear = (np.asarray(constant)[..., None, None] for constant in body.cell_lame)
    dilation = np.trace(strain, axis1=1, axis2=2)[:, None, None]
    return np.asarray(first * dilation * np.eye(3) + 2.0 * shear * strain)


def _of_body(body: ElasticBody, displacement: Any, body_state: float = 0.0) -> list[Any]:
    """Return displacement, stress and von Mises' stress, as XDMF files can hold them."""
    mesh = body.mesh.mesh
    space = compat.vector_space(mesh, compat.geometry_degree(mesh))  # all that files can hold
    shown = _interpolated(space, displacement, "displacement")
    values = cell_stresses(body, displacement, body_state)
    equivalent = compat.cell_constant(mesh, von_mises(values), "von_Mises")
    return [shown, compat.cell_constant(mesh, values, "stress"), equivalent]


def _facet_means(face: LoadedFace, values: Array, name: str) -> Any:
    """Return the means of values over the facets of the face, on their cells."""
    facets, points = face.facets, face.quadrature
    means = fem.Function(compat.scalar_space(face.space.mesh, 0, "DG"), name=name)
    cells = compat.cell_nodes(means.function_space)[:, 0]
    at_points = values if isinstance(face.patches, Outline) else values[points.patch]
    weighted = points.weight * at_points
    total = np.bincount(cells[points.cell], weighted, minlength=len(means.x.array))
    loaded = cells[facets.cell]
    means.x.array[loaded] = total[loaded] / facets.area
    means.x.scatter_forward()
    return means


def _vertex_pressures(problem: UnilateralContactProblem, state: FaceEquilibrium) -> Any:
    """Return contact pressures, linear between vertices, zero away from the top [MPa].

    Single nodes of elements of degree 2 have no useful pressures: a vertex of a triangle has no
    tributary area, and one of a square far less than the middle node.
    """
    assert state.nodal is not None
    block, top = problem.body, problem.top
    pressures = fem.Function(compat.scalar_space(block.mesh.mesh, 1))
    vertices, cells = compat.cell_nodes(pressures.function_space), compat.cell_nodes(block.space)
    cell_name = block.mesh.mesh.topology.cell_name()
    shares = compat.lagrange_values(
        cell_name, 1, compat.lagrange_points(cell_name, block.degree)
    )  # weights of the vertices in the nodes of a cell
    place = np.empty(cells.max(initial=-1) + 1, dtype=np.intp)
    place[cells.ravel()] = np.arange(cells.size)  # one of the cells of each node
    cell, node = np.divmod(place[top.dofs // 3], cells.shape[1])
    space, size = pressures.function_space, len(pressures.x.array)
    force, area = (
        compat.sum_of_ranks(
            space, np.bincount(vertices[cell].ravel(), (shares[node] * each[:, None]).ravel(), size)
        )
        for each in (state.nodal.force, top.area)
    )
    own = pressures.x.array[: len(area)]
    np.divide(force, area, out=own, where=area > 0.0)
    pressures.x.scatter_forward()
    return pressures


def _interpolated(space: Any, function: Any, name: str) -> Any:
    """Return a function in another space."""
    other = fem.Function(space, name=name)
    other.interpolate(function)
    return other


def _write_xdmf(path: str, mesh: Any, steps: Iterable[tuple[int, Sequence[Any]]]) -> None:
    """Write a mesh and functions of its degree, or constant on cells, as XDMF with HDF5."""
    file = io.XDMFFile(mesh.comm, path, "w")
    try:
        file.write_mesh(mesh)
        for number, functions in steps:
            for function in functions:
                file.write_function(function, float(number))
        file.close()
    except RuntimeError:
        # On a full disk it cannot be closed, and its destructor would end the process
        _FILES_NOT_CLOSED.append(file)
        raise
    on_root(mesh.comm, lambda: _gather_fields(path))


def _gather_fields(path: str) -> None:
    """Put all fields of a load step onto one grid of the file.

    dolfinx makes a grid for every field. ParaView takes them for different meshes, and would not
    show stresses on the deformed block.
    """
    ElementTree.register_namespace("xi", "http://www.w3.org/2001/XInclude")
    try:
        tree = ElementTree.parse(path)
    except ElementTree.ParseError:
        raise OSError("it is cut short") from None
    domain = tree.getroot()[0]
    _, first, *others = domain.findall("Grid")
    first.set("Name", "fields")
    for other in others:
        for step, more in zip(first, other, strict=True):
            step.extend(more.findall("Attribute"))
        domain.remove(other)
    ElementTree.indent(tree)
    tree.write(path, encoding="utf-8", xml_declaration=True)


Assembled = Annotated[Any, Has("an assembled matrix of PETSc", ("getValuesCSR",))]

_SKEW = 1e-12
"""Difference of a stiffness from its transpose, over its largest entry, that is rounding."""
_FIRST_ELEMENT = 10_000_001
"""Number of the first spring, beyond those of the elements of a deck."""


@checked
def write_contact_stiffness(path: str | Path, stiffness: Assembled, space: compat.Space) -> None:
    """Write a contact stiffness for other programs, by the ending of the file.

    ``.inp``: springs of CalculiX and Abaqus that have together this matrix, SPRING1 from a node to
    ground and SPRING2 between two displacements, for a deck whose nodes have the numbers of the
    mesh's file. ``.mtx``: the matrix in Matrix Market's format. Both state the numbers and places
    of the nodes in comments; the unknown of displacement i of the node in row k there is 3 k + i.

    Args:
        path: File to write, ending in ``.inp`` or ``.mtx``.
        stiffness: What `Interface.stiffness_matrix` returned [N/mm].
        space: The space of the displacements.

    Raises:
        InputError: For another ending, or a plane or mixed space; for springs of a matrix that is
            not symmetric.

    Note:
        Collective; rank 0 writes.
    """
    path = Path(path)
    if path.suffix not in (".inp", ".mtx"):
        problem = "is no format of a stiffness"
        raise InputError(problem, key="path", value=path.name, allowed=".inp or .mtx")
    if space.dofmap.index_map_bs != 3:
        raise InputError(
            "springs are written for displacements alone, on meshes of three dimensions",
            key="space",
            value=str(space.ufl_element()),
            allowed="such a space",
        )
    starts, columns, entries = stiffness.getValuesCSR()
    first = stiffness.getOwnershipRange()[0]
    rows = np.repeat(np.arange(len(starts) - 1), np.diff(starts)) + first
    own = len(starts) // 3
    places = space.tabulate_dof_coordinates()[:own]
    parts = space.mesh.comm.gather((rows, columns, entries, node_numbers(space)[:own], places))

    def write() -> None:
        row, column, entry, number, place = (
            np.concatenate(one) for one in zip(*parts, strict=True)
        )
        matrix = csr_array((entry, (row, column)), shape=(3 * len(number),) * 2)
        used = np.unique(np.concatenate([row[entry != 0.0], column[entry != 0.0]]) // 3)
        dofs = (3 * used[:, None] + np.arange(3)).ravel()
        lines = (_springs if path.suffix == ".inp" else _matrix_market)(
            csr_array(matrix[dofs][:, dofs]), number[used], place[used]
        )
        write_text(path, "\n".join(lines) + "\n")

    on_root(space.mesh.comm, write)


def node_numbers(space: Any) -> Indices:
    """Return the numbers of this rank's nodes, ghosts included, in the file of the mesh, from 1.

    Nodes of quadratic displacements that a mesh of straight cells has not follow behind all others.

    Args:
        space: Space of the displacements.

    Note:
        Collective.
    """
    mesh, nodes = space.mesh, space.dofmap.index_map
    given = np.asarray(mesh.geometry.input_global_indices)
    total = max(mesh.comm.allgather(int(given.max(initial=-1)))) + 1
    numbers = nodes.local_to_global(np.arange(nodes.size_local + nodes.num_ghosts, dtype=np.int32))
    numbers = np.asarray(numbers) + total + 1
    vertices, cells = compat.cell_vertices(mesh), compat.cell_nodes(space)
    shared = min(vertices.shape[1], cells.shape[1])
    numbers[cells[:, :shared]] = given[vertices[:, :shared]] + 1
    return numbers


def _nodes(numbers: Indices, places: Array, mark: str) -> Iterator[str]:
    yield f"{mark} row, node, x, y, z [mm]"
    for row, (number, place) in enumerate(zip(numbers, places, strict=True)):
        yield f"{mark} {row}, {number}, " + ", ".join(f"{each:.9g}" for each in place)


def _matrix_market(matrix: csr_array, numbers: Indices, places: Array) -> Iterator[str]:
    entries = matrix.tocoo()
    yield "%%MatrixMarket matrix coordinate real general"
    yield "% stiffness of the contact [N/mm]"
    yield from _nodes(numbers, places, "%")
    yield f"{matrix.shape[0]} {matrix.shape[1]} {entries.nnz}"
    triples = zip(entries.row, entries.col, entries.data, strict=True)
    yield from (f"{i + 1} {j + 1} {value:.17g}" for i, j, value in triples)


def _springs(matrix: csr_array, numbers: Indices, places: Array) -> Iterator[str]:
    """Yield springs: −K_ij between two displacements, and the sums of the rows to ground."""
    # out of contact there are no entries
    largest = np.abs(matrix.data).max(initial=0.0)
    if np.abs((matrix - matrix.T).data).max(initial=0.0) > _SKEW * largest:
        raise InputError(
            "is not symmetric, as that of a face that slides, and no springs have it",
            value=".inp",
            allowed=".mtx, or the stiffness of a face that sticks",
        )
    yield "** stiffness of the contact [N/mm], as springs; put it into the model, before steps"
    yield from _nodes(numbers, places, "**")
    ground = np.asarray(matrix.sum(axis=1)).ravel()
    entries, begin = matrix.tocoo(), _FIRST_ELEMENT
    pairs = [
        (i, j, -value)
        for i, j, value in zip(entries.row, entries.col, entries.data, strict=True)
        if i < j and abs(value) > _SKEW * largest
    ]
    alone = [(i, value) for i, value in enumerate(ground) if abs(value) > _SKEW * largest]
    for k, (i, value) in enumerate(alone, begin):
        yield f"*ELEMENT, TYPE=SPRING1, ELSET=CONTACT_{k}\n{k}, {numbers[i // 3]}"
        yield f"*SPRING, ELSET=CONTACT_{k}\n{i % 3 + 1}\n{value:.13e}"
    for k, (i, j, value) in enumerate(pairs, begin + len(alone)):
        yield f"*ELEMENT, TYPE=SPRING2, ELSET=CONTACT_{k}"
        yield f"{k}, {numbers[i // 3]}, {numbers[j // 3]}"
        yield f"*SPRING, ELSET=CONTACT_{k}\n{i % 3 + 1}, {j % 3 + 1}\n{value:.13e}"
