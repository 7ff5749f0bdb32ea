"""Meshes of a body from the user's files, with tags by arrays that describe the whole of it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from numpy.typing import NDArray

from geometry.meshes.gmsh_file import MeshArrays, read_gmsh_file
from macro import compat
from macro.mesh.checks import check_cells, check_connected
from macro.mesh.tagged import TaggedMesh
from macro.mesh.xdmf import read_xdmf
from support.checks import check_file
from support.collective import on_root
from support.errors import InputError


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


Table = NDArray[np.int64]


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
