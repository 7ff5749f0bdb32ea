"""Meshes of a body from the user's files, with tags by arrays that describe the whole of it.

They are checked: cells that are valid and hang together, and a plausible size.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from numpy.typing import NDArray

from patchlaw.geometry.meshes.gmsh_file import MeshArrays, read_gmsh_file
from patchlaw.macro import compat
from patchlaw.macro.mesh.facets import facets_between_ranks, inner_facets, parts
from patchlaw.macro.mesh.tagged import TaggedMesh
from patchlaw.macro.mesh.xdmf import read_xdmf
from patchlaw.support.arrays import Array
from patchlaw.support.checks import check_file
from patchlaw.support.errors import InputError
from patchlaw.support.parallel import on_root

_CHUNK = 1 << 14
"""Cells that are checked at a time, which bounds the memory to 10 MB."""

_SMALL, _LARGE = 1.0, 2.0e4
"""Diagonals of bodies beyond which the unit of their mesh is in doubt [mm]."""

Table = NDArray[np.int64]


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


def _refuse(comm: Any, bad: NDArray[np.bool_], mesh: Any, vertices: NDArray[np.int32]) -> None:
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
    maps = np.einsum("qmk,nmi->nqki", slopes, x)
    volumes, size = np.linalg.det(maps), np.linalg.norm(maps, axis=3).prod(axis=2)
    if x.shape[1] == 4:  # the same volume at all nodes, whose edges differ
        lengths = np.linalg.norm(x[:, :, None] - x[:, None], axis=3) + np.eye(4)
        size = lengths.prod(axis=2).min(axis=1, keepdims=True)
    hand = np.sign(volumes.sum(axis=1))
    return (hand[:, None] * volumes / np.where(size > 0.0, size, 1.0)).min(axis=1), hand


def _folded(mesh: Any, vertices: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Return which of this rank's cells lie on the same side of a facet as their neighbour."""
    _, shapes = compat.reference_facets(mesh.topology.cell_name())
    points = np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)

    def side_of(cell: NDArray[np.int64], side: NDArray[np.int64]) -> Array:
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


def cell_tags(mesh: Any, tags: NDArray[np.int32]) -> Any:
    """Return the tags of this rank's cells, ghosts included.

    Args:
        mesh: dolfinx mesh.
        tags: Tags of the cells that the mesh was made of, in their order, all ranks' together.
    """
    cells = np.asarray(mesh.topology.original_cell_index, dtype=np.int64)
    return dmesh.meshtags(mesh, 3, np.arange(len(cells), dtype=np.int32), tags[cells])


def facet_tags(
    mesh: Any, facets: Table, tags: NDArray[np.int32], names: dict[str, int] | None = None
) -> Any:
    """Return the tags of the facets of the cells that this rank owns; there may be none.

    Args:
        mesh: dolfinx mesh.
        facets: Marked facets of all ranks together: rows of the corners among the points that
            the mesh was made of, in any order, shape (n, 3 or 4); negative for points that no cell
            has.
        tags: Their tags, shape (n,).
        names: Names of the tags, for errors.

    Raises:
        InputError: When a facet has two tags, or when a tag marks facets of cells and others too.

    Note:
        Collective.
    """
    name_of = {tag: name for name, tag in (names or {}).items()}
    wanted, tags = _distinct(facets, tags, name_of)
    cell, side, row = _facets_found(mesh, wanted)
    of_cells = np.zeros(len(wanted), dtype=np.int64)
    of_cells[row] = 1
    _check_groups(mesh.comm.allreduce(of_cells) > 0, tags, name_of)
    topology = mesh.topology
    topology.create_connectivity(3, 2)
    topology.create_connectivity(2, 3)
    _, shapes = compat.reference_facets(topology.cell_name())
    indices = topology.connectivity(3, 2).array.reshape(-1, len(shapes))[cell, side]
    indices, first = np.unique(indices, return_index=True)  # two cells have an inner facet
    return dmesh.meshtags(mesh, 2, indices.astype(np.int32), tags[row[first]].astype(np.int32))


def _distinct(
    facets: Table, tags: NDArray[np.int32], name_of: dict[int, str]
) -> tuple[Table, NDArray[np.int32]]:
    """Return every facet once, its nodes ascending."""
    rows, first, which = np.unique(
        np.sort(facets, axis=1), axis=0, return_index=True, return_inverse=True
    )
    other = np.flatnonzero(tags != tags[first][which.ravel()])
    if len(other):
        one, two = tags[first][which.ravel()][other[0]], tags[other[0]]
        named = " and ".join(repr(name_of.get(tag, str(tag))) for tag in sorted((one, two)))
        raise InputError(
            f"{len(other)} facets of the mesh are in two groups, as in {named}",
            allowed="at most one group for a facet",
        )
    return rows, tags[first]


def _facets_found(
    mesh: Any, wanted: Table
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return the owned cells with such facets, the facet's index in its cell, and its row."""
    _, shapes = compat.reference_facets(mesh.topology.cell_name())
    points = np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)
    vertices = compat.cell_vertices(mesh)[: mesh.topology.index_map(3).size_local]
    marked = np.isin(points, wanted)
    near = np.flatnonzero(marked[vertices].sum(axis=1) >= shapes.shape[1])
    own = np.sort(points[vertices[near]][:, shapes], axis=2).reshape(-1, shapes.shape[1])
    both = np.concatenate([wanted.reshape(-1, shapes.shape[1]), own])
    _, first, which = np.unique(both, axis=0, return_index=True, return_inverse=True)
    row = first[which.ravel()[len(wanted) :]]  # of its first occurrence; wanted rows come first
    hit = np.flatnonzero(row < len(wanted))
    return near[hit // len(shapes)], hit % len(shapes), row[hit]


def _check_groups(
    of_cells: NDArray[np.bool_], tags: NDArray[np.int32], name_of: dict[int, str]
) -> None:
    """Refuse tags of which some facets belong to cells and some do not."""
    for tag in np.unique(tags):
        of_tag = of_cells[tags == tag]
        if of_tag.any() and not of_tag.all():
            name = name_of.get(int(tag), str(tag))
            raise InputError(
                f"{(~of_tag).sum()} of {len(of_tag)} facets of the surface {name!r} belong to no "
                "cell; the mesh of the volume beside them may be missing"
            )
