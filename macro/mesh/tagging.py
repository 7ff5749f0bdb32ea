"""Tags of a distributed mesh from arrays that describe the whole of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from numpy.typing import NDArray

from geometry.meshes.gmsh_file import NO_GROUP
from macro import compat
from support.errors import InputError

Table = NDArray[np.int64]


def cell_tags(mesh: Any, tags: NDArray[np.int32]) -> Any:
    """Return the tags of this rank's cells, ghosts included.

    Args:
        mesh: dolfinx mesh.
        tags: Tags of the cells that the mesh was made of, in their order, all ranks' together.
    """
    cells = np.asarray(mesh.topology.original_cell_index, dtype=np.int64)
    return dmesh.meshtags(mesh, 3, np.arange(len(cells), dtype=np.int32), tags[cells])


def filled(mesh: Any, tags: Any) -> Any:
    """Return tags of all this rank's cells: `NO_GROUP` where there was none.

    Args:
        mesh: dolfinx mesh.
        tags: Tags of some of its cells.
    """
    cells = mesh.topology.index_map(3)
    values = np.full(cells.size_local + cells.num_ghosts, NO_GROUP, np.int32)
    values[tags.indices] = tags.values
    return dmesh.meshtags(mesh, 3, np.arange(len(values), dtype=np.int32), values)


def facet_tags(
    mesh: Any, facets: Table, tags: NDArray[np.int32], names: dict[str, int] | None = None
) -> Any:
    """Return the tags of the facets of the cells that this rank owns; there may be none.

    Args:
        mesh: dolfinx mesh of straight cells.
        facets: Marked facets of all ranks together: rows of the points that the mesh was made of,
            in any order, shape (n, 3 or 4); negative for points that no cell has.
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
    found = np.zeros(len(wanted), dtype=np.int64)
    found[row] = 1
    _check_groups(mesh.comm.allreduce(found) > 0, tags, name_of)
    topology = mesh.topology
    topology.create_connectivity(3, 2)
    topology.create_connectivity(2, 3)
    _, shapes = compat.reference_facets(topology.cell_name())
    indices = topology.connectivity(3, 2).array.reshape(-1, len(shapes))[cell, side]
    indices, first = np.unique(indices, return_index=True)  # two cells have an inner facet
    return dmesh.meshtags(mesh, 2, indices.astype(np.int32), tags[row[first]].astype(np.int32))


def of_owned_cells(mesh: Any, tags: Any) -> Any:
    """Return tags of facets without those facets that belong to ghost cells alone.

    Args:
        mesh: dolfinx mesh.
        tags: Tags of its facets.
    """
    mesh.topology.create_connectivity(2, 3)
    cells = mesh.topology.connectivity(2, 3)
    owned = mesh.topology.index_map(3).size_local
    indices = np.asarray(tags.indices)
    ends = cells.offsets[indices], cells.offsets[indices + 1] - 1  # a facet has one cell or two
    kept = np.minimum(*(cells.array[end] for end in ends)) < owned
    return dmesh.meshtags(mesh, 2, indices[kept], np.asarray(tags.values)[kept])


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
    found: NDArray[np.bool_], tags: NDArray[np.int32], name_of: dict[int, str]
) -> None:
    """Refuse tags of which some facets belong to cells and some do not."""
    for tag in np.unique(tags):
        of_tag = found[tags == tag]
        if of_tag.any() and not of_tag.all():
            name = name_of.get(int(tag), str(tag))
            raise InputError(
                f"{(~of_tag).sum()} of {len(of_tag)} facets of the surface {name!r} belong to no "
                "cell; the mesh of the volume beside them may be missing"
            )
