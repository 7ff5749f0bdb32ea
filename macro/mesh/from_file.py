"""Meshes of a body from the user's files: read, checked, refined.

They are checked: cells that are valid and hang together, and a plausible size.

Refinement cuts every cell into eight, every facet into four. New nodes are the middles of edges
and, of hexahedra, of faces and cells; edges stay straight. A tetrahedron leaves an octahedron
between its corners, which is always cut along the same diagonal: the shapes of cells fall into
three classes however often they are refined (Bey, Computing 55 (1995), 355-378, doi
10.1007/BF02238487).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from patchlaw.geometry.meshes.gmsh_file import MeshArrays, read_gmsh_file
from patchlaw.macro import compat
from patchlaw.macro.mesh.facets import facets_between_ranks, inner_facets, parts
from patchlaw.macro.mesh.joined import numbers_one_after_the_other
from patchlaw.macro.mesh.tagged import TaggedMesh, cell_tags, facet_tags, marked_sides
from patchlaw.macro.mesh.xdmf import read_xdmf
from patchlaw.support import Array, Counts, Flags, Indices, InputError, Locals, check_file, on_root

_CHUNK = 1 << 14
"""Cells that are checked at a time, which bounds the memory to 10 MB."""

_SMALL, _LARGE = 1.0, 2.0e4
"""Diagonals of bodies beyond which the unit of their mesh is in doubt [mm]."""

Table = Counts


def check_cells(tagged: TaggedMesh) -> None:
    """Refuse nodes that are no points, and cells inside out, folded or without volume.

    The nodes of a cell may be numbered right-handed or left-handed. Where both are found, two cells
    at a facet must lie on either side of it.

    Args:
        tagged: The mesh.

    Raises:
        InputError: On all ranks.

    Note:
        Collective.
    """
    mesh, comm = tagged.mesh, tagged.comm
    if not all(comm.allgather(bool(np.isfinite(mesh.geometry.x).all()))):
        raise InputError("the mesh has nodes whose coordinates are not finite")
    vertices = compat.cell_vertices(mesh)[: mesh.topology.index_map(3).size_local]
    quality, hands = np.empty(len(vertices)), np.empty(len(vertices))
    for start in range(0, len(vertices), _CHUNK):
        part = slice(start, start + _CHUNK)
        quality[part], hands[part] = _volumes(mesh.geometry.x[vertices[part]])
    bad = quality <= 1e-8
    handedness = {hand for hands_there in comm.allgather(set(hands[~bad])) for hand in hands_there}
    if len(handedness) > 1:
        bad |= _folded(mesh, vertices)
    _refuse(comm, bad, mesh, vertices)


def _refuse(comm: Any, bad: Flags, mesh: Any, vertices: Locals) -> None:
    """Raise an error that counts the bad cells and shows the place of one of them."""
    first = mesh.geometry.x[vertices[np.argmax(bad)]].mean(axis=0).tolist() if bad.any() else None
    told = comm.allgather((int(bad.sum()), len(bad), first))
    count, cells = (sum(part[k] for part in told) for k in (0, 1))
    if count:
        place = ", ".join(f"{value:.4g}" for value in min(part[2] for part in told if part[0]))
        raise InputError(
            f"{count} of {cells} cells of the mesh are inside out or have no volume; one is at "
            f"({place}) mm"
        )


def _volumes(x: Array) -> tuple[Array, Array]:
    """Return the least volume at a node of each cell over that of its edges, and its hand.

    Args:
        x: Nodes of the cells, shape (n, 4, 8, 10 or 27, 3).
    """
    slopes = np.rint(compat.lagrange_gradients(*compat.SHAPES[x.shape[1]]))  # whole numbers
    linear = x.shape[1] == 4  # the same volume at all nodes, whose edges differ
    maps = np.einsum("qmk,nmi->nqki", slopes[:1] if linear else slopes, x)
    volumes = np.linalg.det(maps)
    edges = x[:, :, None] - x[:, None] if linear else maps
    lengths = np.sqrt(np.einsum("nqki,nqki->nqk", edges, edges))
    if linear:
        size = (lengths + np.eye(4)).prod(axis=2).min(axis=1, keepdims=True)
    else:
        size = lengths.prod(axis=2)
    hand = np.sign(volumes.sum(axis=1))
    return (hand[:, None] * volumes / np.where(size > 0.0, size, 1.0)).min(axis=1), hand


def _folded(mesh: Any, vertices: Locals) -> Flags:
    """Return which of this rank's cells lie on the same side of a facet as their neighbour."""
    _, shapes = compat.reference_facets(mesh.topology.cell_name())
    points = np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)

    def side_of(cell: Counts, side: Counts) -> Array:
        """Return on which side of the plane through three nodes of a facet the cells lie."""
        rows = np.take_along_axis(vertices[cell], shapes[side], axis=1)
        rows = np.take_along_axis(rows, np.argsort(points[rows], axis=1), axis=1)
        corner = mesh.geometry.x[rows[:, :3]]
        inside = mesh.geometry.x[vertices[cell]].mean(axis=1) - corner[:, 0]
        u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        return np.sign(np.einsum("ni,ni->n", np.cross(u, v), inside))

    folded = np.zeros(len(vertices), dtype=bool)
    cells, sides = inner_facets(mesh)
    folded[cells[side_of(cells[:, 0], sides[:, 0]) == side_of(cells[:, 1], sides[:, 1])]] = True
    facet, cell, side = facets_between_ranks(mesh)
    own = side_of(cell, side)
    ends = mesh.comm.allgather((facet, own))
    number, signs = (np.concatenate([end[k] for end in ends]) for k in (0, 1))
    _, row = np.unique(number, return_inverse=True)
    both = np.bincount(row.ravel(), signs)[row.ravel()]  # two cells on either side cancel
    start = sum(len(end[0]) for end in ends[: mesh.comm.rank])
    folded[cell[both[start : start + len(cell)] != 0.0]] = True
    return folded


def check_connected(tagged: TaggedMesh) -> None:
    """Refuse a mesh whose cells do not hang together by their facets.

    Args:
        tagged: The mesh.

    Raises:
        InputError: On all ranks, with the number of parts and their cells.

    Note:
        Collective.
    """
    sizes = parts(tagged.mesh)
    if len(sizes) > 1:
        shown = ", ".join(str(size) for size in sizes[:5]) + ", …" * (len(sizes) > 5)
        raise InputError(
            f"the mesh is in {len(sizes)} parts that share no facets, of {shown} cells; where "
            "volumes touch they must share nodes (in gmsh: fragment them before meshing)",
            allowed="one connected body",
        )


def size_note(tagged: TaggedMesh, *, key: str | None = None) -> str | None:
    """Return a note where the size of the mesh suggests that its unit was mistaken, else None.

    Args:
        tagged: The mesh [mm].
        key: Key of the scene that says the unit, for the error.

    Raises:
        InputError: On all ranks, when only a wrong unit gives such a size.

    Note:
        Collective.
    """
    lower, upper = tagged.bounding_box()
    lengths, size = upper - lower, float(np.linalg.norm(upper - lower))
    least, most = 1e-4, 1e7
    if not least <= size <= most:
        raise InputError(
            f"the body's mesh would be {size:.3g} mm large",
            key=key,
            allowed=f"a unit that makes it {least:g} … {most:g} mm large",
        )
    if _SMALL <= size <= _LARGE:
        return None
    sides = " × ".join(f"{length:.4g}" for length in lengths)
    guess = '"m"' if size < _SMALL else '"mm" or "um"'
    return f"the mesh of the body is {sides} mm large; is its unit right? (mesh_unit = {guess}?)"


def read_mesh(path: str | Path, comm: Any, *, unit: float = 1.0) -> TaggedMesh:
    """Read a body's mesh from a file, distributed over all ranks.

    Two kinds of files are read. Those of gmsh, ``.msh`` of format 2 or 4, text or binary, keep the
    names of their physical groups, and cells of second order that are curved; they are read on
    rank 0. Those of dolfinx, ``.xdmf`` with a
    mesh, tags of facets and tags of cells in one file, have numbers for names; all ranks read them.

    Args:
        path: The file.
        comm: MPI communicator that the mesh will live on.
        unit: Millimetres per unit of length of the file.

    Raises:
        InputError: On all ranks, when the file cannot be read, when it holds no mesh of tetrahedra
            or hexahedra alone, when cells are inverted or without volume, when the mesh
            is in several parts, or when a facet or a cell has two tags.

    Note:
        Collective.
    """
    if not (math.isfinite(unit) and unit > 0.0):
        raise InputError("the unit of a mesh is no length", value=unit, allowed="a positive number")
    path = Path(path)
    readers = {".msh": _from_gmsh, ".xdmf": read_xdmf}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            "meshes in this format are not read",
            value=path.suffix,
            file=str(path),
            allowed=".msh of gmsh, .xdmf of dolfinx",
        )
    on_root(comm, lambda: check_file(path, str(path)))
    try:
        tagged = reader(path, comm)
        tagged.mesh.geometry.x[:] *= unit
        check_cells(tagged)
        check_connected(tagged)
    except InputError as error:
        raise error.located(file=str(path)) from error
    return tagged


def _from_gmsh(path: Path, comm: Any) -> TaggedMesh:
    """Distribute what a file of gmsh has, which rank 0 reads."""
    whole: list[MeshArrays] = []

    def read() -> MeshArrays:
        """Return all but cells and nodes, of which there are many."""
        whole.append(read_gmsh_file(path))
        return replace(whole[0], cells=whole[0].cells[:0], points=whole[0].points[:0])

    known = on_root(comm, read)
    own = whole[0] if whole else known
    mesh, names = compat.mesh_from_cells(own.cells, own.points, None, comm), known.facet_names
    return TaggedMesh(
        mesh=mesh,
        facet_tags=facet_tags(mesh, known.facets, known.facet_tags, names),
        cell_tags=cell_tags(mesh, known.cell_tags),
        facet_names=names,
        cell_names=known.cell_names,
    )


_TETRAHEDRON = [
    ["0", "01", "02", "03"], ["01", "1", "12", "13"], ["02", "12", "2", "23"],
    ["03", "13", "23", "3"], ["01", "02", "03", "13"], ["01", "02", "12", "13"],
    ["02", "03", "13", "23"], ["02", "12", "13", "23"],
]  # fmt: skip
_TRIANGLE = [["0", "01", "02"], ["01", "1", "12"], ["02", "12", "2"], ["01", "12", "02"]]
_QUADRILATERAL = [
    ["0", "01", "02", "0123"], ["01", "1", "0123", "13"],
    ["02", "0123", "2", "23"], ["0123", "13", "23", "3"],
]  # fmt: skip


def _hexahedron() -> list[list[str]]:
    """Return the nodes of the eight parts, named by the corners of the cell between which they lie.

    Corner i + 2 j + 4 k lies at (i, j, k) of the unit cube.
    """

    def name(place: Any) -> str:
        chosen = [[0] if at == 0 else [1] if at == 2 else [0, 1] for at in place]
        return "".join(
            str(i + 2 * j + 4 * k) for k in chosen[2] for j in chosen[1] for i in chosen[0]
        )

    corners = [(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    return [[name(np.add(part, corner)) for corner in corners] for part in corners]


def refined(tagged: TaggedMesh, times: int = 1, *, key: str | None = None) -> TaggedMesh:
    """Return a mesh refined uniformly, with its tags, distributed anew over the ranks.

    Args:
        tagged: The mesh.
        times: How often; 0 returns the mesh itself.
        key: Key of the scene that says so, for errors.

    Raises:
        InputError: When cells are curved, whose parts would be straight.

    Note:
        Collective. Mesh and tags do not depend on the number of ranks but for their order.
    """
    if times and compat.geometry_degree(tagged.mesh) == 2:
        raise InputError(
            "a mesh of curved cells is not refined",
            value=times,
            key=key,
            allowed="0; a finer mesh from gmsh",
        )
    for _ in range(times):
        tagged = _refined_once(tagged)
    return tagged


def _refined_once(tagged: TaggedMesh) -> TaggedMesh:
    mesh, comm = tagged.mesh, tagged.comm
    parts = _TETRAHEDRON if mesh.topology.cell_name() == "tetrahedron" else _hexahedron()
    lattice = _Nodes.of(mesh)
    cells = lattice.of_cells(parts)
    new = compat.mesh_from_cells(cells, lattice.points, None, comm)
    facets, tags = _cut_facets(tagged, lattice)
    of_cells = None
    if tagged.cell_tags is not None:
        own = np.asarray(tagged.cell_tags.values)[: len(lattice.own)]
        of_cells = cell_tags(new, np.concatenate(comm.allgather(np.repeat(own, len(parts)))))
    return TaggedMesh(
        mesh=new,
        facet_tags=facet_tags(
            new,
            np.concatenate(comm.allgather(facets)),
            np.concatenate(comm.allgather(tags)),
            dict(tagged.facet_names),
        ),
        cell_tags=of_cells,
        facet_names=tagged.facet_names,
        cell_names=tagged.cell_names,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Nodes:
    """Table of the nodes of the refined mesh, consecutive on every rank.

    Attributes:
        own: By cell of this rank its nodes, corners before the middles of edges, of faces and of
            the cell, shape (cells, nodes of a cell).
        column: Column of `own` by the corners between which a node lies, such as ``"02"``.
        points: This rank's nodes, shape (n, 3) [mm].
    """

    own: Table
    column: dict[str, int]
    points: Array

    @classmethod
    def of(cls, mesh: Any) -> _Nodes:
        """Number the nodes; collective."""
        topology, comm = mesh.topology, mesh.comm
        dimensions = (0, 1) if topology.cell_name() == "tetrahedron" else (0, 1, 2, 3)
        tables, maps = [], []
        for dimension in dimensions:
            topology.create_entities(dimension)
            topology.create_connectivity(3, dimension)
            corners = compat.reference_entities(topology.cell_name(), dimension)
            if dimension == 0:  # of the geometry, whose nodes are the vertices
                tables.append((corners, compat.cell_vertices(mesh)))
                maps.append(mesh.geometry.index_map())
            elif dimension == 3:
                tables.append((corners, np.arange(len(tables[0][1]))[:, None]))
                maps.append(topology.index_map(3))
            else:
                entities = topology.connectivity(3, dimension).array.reshape(-1, len(corners))
                tables.append((corners, entities))
                maps.append(topology.index_map(dimension))
        vertices, count = compat.cell_vertices(mesh), topology.index_map(3).size_local
        own, points, column = [], [], dict[str, int]()
        numbers = numbers_one_after_the_other(maps, comm)
        for (corners, entities), index_map, number in zip(tables, maps, numbers, strict=True):
            own.append(number[entities[:count]])
            middle = np.empty((len(number), 3))
            for place, between in enumerate(corners):
                middle[entities[:, place]] = mesh.geometry.x[vertices[:, between]].mean(axis=1)
                column["".join(map(str, sorted(between)))] = len(column)
            points.append(middle[: index_map.size_local])
        return cls(own=np.hstack(own), column=column, points=np.concatenate(points))

    def of_cells(self, parts: list[list[str]]) -> Table:
        """Return the cells that this rank's cells are cut into, shape (n, 4 or 8)."""
        columns = [[self.column[name] for name in part] for part in parts]
        return self.own[:, columns].reshape(-1, len(parts[0]))


def _cut_facets(tagged: TaggedMesh, nodes: _Nodes) -> tuple[Table, Locals]:
    """Return the facets that marked ones of this rank's cells are cut into, and their tags."""
    found, tags = [], []
    for corners, here, tag_of in marked_sides(tagged):
        parts = _TRIANGLE if len(corners) == 3 else _QUADRILATERAL
        columns = [[nodes.column[_on(corners, name)] for name in part] for part in parts]
        found.append(nodes.own[here][:, columns].reshape(-1, len(corners)))
        tags.append(np.repeat(tag_of, len(parts)))
    return np.concatenate(found), np.concatenate(tags)


def _on(corners: Indices, name: str) -> str:
    """Return the name in a cell of a node of one of its facets."""
    return "".join(sorted(str(corners[int(digit)]) for digit in name))
