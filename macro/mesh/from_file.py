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
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from patchlaw.geometry.meshes.gmsh_file import MeshArrays, read_gmsh_file
from patchlaw.macro import compat
from patchlaw.macro.mesh.facets import facets_between_ranks, inner_facets, parts
from patchlaw.macro.mesh.tagged import TaggedMesh, cell_tags, facet_tags, marked_sides
from patchlaw.macro.mesh.xdmf import read_xdmf
from patchlaw.support import (
    Array,
    Counts,
    Flags,
    Indices,
    InputError,
    Locals,
    check_file,
    located,
    on_root,
)

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
    with located(str(path)):
        tagged = reader(path, comm)
        tagged.mesh.geometry.x[:] *= unit
        check_cells(tagged)
        check_connected(tagged)
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


_TETRAHEDRA = [
    "00 01 02 03", "01 11 12 13", "02 12 22 23", "03 13 23 33",
    "01 02 03 13", "01 02 12 13", "02 03 13 23", "02 12 13 23",
]  # fmt: skip
"""Parts of a tetrahedron: pairs of its corners that the corners of the parts lie half-way between.
"""


@cache
def _parts(cell_name: str) -> tuple[Indices, list[Indices]]:
    """Return how a cell, and every side of it, is cut, by its nodes of second order.

    Args:
        cell_name: Name of the cell, such as ``hexahedron``.

    Returns:
        Corners of the parts, shape (8, 4 or 8), and of each side those of its parts, shape (4, 3 or
        4).
    """
    nodes, (corners, sides) = (
        compat.lagrange_points(cell_name, 2),
        compat.reference_facets(cell_name),
    )
    if cell_name == "tetrahedron":
        pairs = np.array([[tuple(map(int, one)) for one in part.split()] for part in _TETRAHEDRA])
        places = corners[pairs].mean(axis=2)
    else:
        places = 0.5 * (corners[:, None] + corners)
    apart = np.linalg.norm(places[:, :, None] - nodes, axis=3)
    parts = apart.argmin(axis=2)
    on_sides = [
        {int(np.linalg.norm(nodes - 0.5 * (a + b), axis=1).argmin()) for a in ends for b in ends}
        for ends in corners[sides]
    ]
    facets = parts[:, sides].reshape(-1, sides.shape[1])
    cut = [np.array([one for one in facets if nodes_there >= {*one}]) for nodes_there in on_sides]
    return parts, cut


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
    parts, sides = _parts(mesh.topology.cell_name())
    # quadratic functions have a node wherever a part has a corner
    space, count = compat.scalar_space(mesh, 2), mesh.topology.index_map(3).size_local
    numbers, nodes = space.dofmap.index_map, compat.cell_nodes(space)[:count]
    own = numbers.local_to_global(nodes.ravel()).reshape(nodes.shape)
    points = space.tabulate_dof_coordinates()[: numbers.size_local]
    new = compat.mesh_from_cells(own[:, parts].reshape(-1, parts.shape[1]), points, None, comm)
    facets, tags = [], []
    for cut, (_, here, tag_of) in zip(sides, marked_sides(tagged), strict=True):
        facets.append(own[here][:, cut].reshape(-1, cut.shape[1]))
        tags.append(np.repeat(tag_of, len(cut)))
    whole = [np.concatenate(comm.allgather(np.concatenate(one))) for one in (facets, tags)]
    of_cells = None
    if tagged.cell_tags is not None:
        own_tags = np.asarray(tagged.cell_tags.values)[:count]
        of_cells = cell_tags(new, np.concatenate(comm.allgather(np.repeat(own_tags, len(parts)))))
    return replace(
        tagged,
        mesh=new,
        facet_tags=facet_tags(new, whole[0], whole[1], dict(tagged.facet_names)),
        cell_tags=of_cells,
    )
