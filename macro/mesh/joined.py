"""Bodies that were meshed apart, as the volumes of one mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from patchlaw.macro import compat
from patchlaw.macro.mesh.facets import on_all_ranks
from patchlaw.macro.mesh.tagged import TaggedMesh, cell_tags, facet_tags, marked_sides, named_groups
from patchlaw.support import Counts, InputError


def joined_meshes(bodies: Mapping[str, Any]) -> TaggedMesh:
    """Return bodies that were meshed apart as the volumes of one mesh.

    Displacements on it are those of all bodies, an `Interface` with `opposite` presses the faces of
    two of them on each other. No nodes are merged, also where they coincide.

    Args:
        bodies: Two meshes or more by the names of their bodies: `TaggedMesh`, or what the newest
            dolfinx reads from gmsh; of the same kind of cells, on the same communicator, in the
            same coordinates [mm].

    Returns:
        The mesh, distributed anew over the ranks. The face ``"face"`` of the body ``"pad"`` is
        ``"pad face"``, that of the number 7 without a name ``"pad 7"``. Volumes are named likewise,
        a body's only one as the body. Their numbers are new: `TaggedMesh.facet_tag` and
        `TaggedMesh.cell_tag` tell them.

    Raises:
        InputError: On all ranks, when these are no meshes, or their cells or ranks differ, or a
            facet has two tags.

    Note:
        Collective. Mesh and tags do not depend on the number of ranks but for their order.
    """
    named = isinstance(bodies, Mapping) and all(isinstance(name, str) for name in bodies)
    if not named or len(bodies) < 2:
        raise InputError("no bodies to join", value=bodies, allowed="two meshes or more by name")
    parts = {name: _with_its_tags(name, given) for name, given in bodies.items()}
    first = next(iter(parts.values()))
    comm, kind = first.comm, _kind(first.mesh)
    for name, part in parts.items():
        if MPI.Comm.Compare(part.comm, comm) not in (MPI.IDENT, MPI.CONGRUENT):
            raise InputError("a mesh is that of other ranks", key=name, allowed="one communicator")
        if _kind(part.mesh) != kind:
            raise InputError(
                "the meshes have different cells",
                key=name,
                value=_kind(part.mesh),
                allowed=f"{kind} for all, as a mesh of dolfinx has one kind of cells; or a scene, "
                "whose [counter_body] is a mesh of its own",
            )
    facet_names, facets = _numbered(parts, _facet_groups)
    cell_names, cells = _numbered(parts, _cell_groups)
    maps = [part.mesh.geometry.index_map() for part in parts.values()]
    numbers = numbers_one_after_the_other(maps, comm)
    nodes, corners, tags, points = [], [], [], []
    for (name, part), number, index_map in zip(parts.items(), numbers, maps, strict=True):
        mesh = part.mesh
        own = number[compat.cell_vertices(mesh)][: _own_cells(mesh)]
        nodes.append(own)
        points.append(mesh.geometry.x[: index_map.size_local, : mesh.geometry.dim])
        for side, here, of in marked_sides(part):
            corners.append(own[here][:, side])
            tags.append(np.array([facets[name, one] for one in of.tolist()], np.int32))
    whole = compat.mesh_from_cells(np.concatenate(nodes), np.concatenate(points), None, comm)
    of_cells = [cells[name, one] for name, part in parts.items() for one in _of_own_cells(part)]
    return TaggedMesh(
        mesh=whole,
        facet_tags=facet_tags(
            whole,
            np.concatenate(comm.allgather(np.concatenate(corners))),
            np.concatenate(comm.allgather(np.concatenate(tags))),
            facet_names,
        ),
        cell_tags=cell_tags(whole, np.concatenate(comm.allgather(np.array(of_cells, np.int32)))),
        facet_names=facet_names,
        cell_names=cell_names,
    )


def numbers_one_after_the_other(maps: Sequence[Any], comm: Any) -> list[Counts]:
    """Return the numbers of several kinds of things, every rank's of all kinds after each other.

    Args:
        maps: dolfinx' index map of each kind.
        comm: MPI communicator.

    Returns:
        Of each kind the numbers of what this rank has, ghosts included, shape (n,).

    Note:
        Collective.
    """
    sizes = np.array(comm.allgather([one.size_local for one in maps]))
    # the first number of every kind on every rank
    first = np.concatenate([[0], np.cumsum(sizes.ravel())])[:-1].reshape(sizes.shape)
    numbers = []
    for kind, index_map in enumerate(maps):
        size = index_map.size_local + index_map.num_ghosts
        whole = index_map.local_to_global(np.arange(size, dtype=np.int32))
        begins = np.concatenate([[0], np.cumsum(sizes[:, kind])])
        owner = np.searchsorted(begins, whole, side="right") - 1
        numbers.append(first[owner, kind] + whole - begins[owner])
    return numbers


def _with_its_tags(name: str, given: Any) -> TaggedMesh:
    """Return a body's mesh with the tags of facets on the ranks that have their cells."""
    facets: Any = getattr(given, "facet_tags", None)
    if not hasattr(given, "mesh") or not hasattr(facets, "find"):
        raise InputError("is no mesh with tags of its faces", key=name, allowed="a TaggedMesh")
    mesh, dim = given.mesh, given.mesh.topology.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    known = sorted(set().union(*mesh.comm.allgather(set(np.asarray(facets.values).tolist()))))
    found = {tag: on_all_ranks(mesh, facets.find(tag)) for tag in known}
    indices = np.concatenate([np.empty(0, np.int32), *found.values()])
    if mesh.comm.allreduce(bool(len(np.unique(indices)) < len(indices)), max):
        problem, allowed = "facets of the mesh are in two groups", "at most one group for a facet"
        raise InputError(problem, key=name, allowed=allowed)
    values = np.repeat(np.array(known, np.int32), [len(one) for one in found.values()])
    order = np.argsort(indices)
    names = {
        kind: dict(getattr(given, f"{kind}_names", None) or named_groups(given, dimension))
        for kind, dimension in (("facet", dim - 1), ("cell", dim))
    }
    return TaggedMesh(
        mesh=mesh,
        facet_tags=dmesh.meshtags(mesh, dim - 1, indices[order], values[order]),
        cell_tags=getattr(given, "cell_tags", None),
        facet_names=names["facet"],
        cell_names=names["cell"],
    )


def _kind(mesh: Any) -> str:
    """Return the kind of a mesh's cells in words."""
    curved = "curved " * (compat.geometry_degree(mesh) == 2)
    return f"{curved}{mesh.topology.cell_name()} in {mesh.geometry.dim} dimensions"


def _own_cells(mesh: Any) -> int:
    return int(mesh.topology.index_map(mesh.topology.dim).size_local)


def _of_own_cells(part: TaggedMesh) -> list[int]:
    """Return the tags of the cells that this rank owns; −1 of those without."""
    tags = np.full(_own_cells(part.mesh), -1)
    if part.cell_tags is not None:
        indices = np.asarray(part.cell_tags.indices)
        own = indices < len(tags)
        tags[indices[own]] = np.asarray(part.cell_tags.values)[own]
    return [int(tag) for tag in tags]


def _facet_groups(name: str, part: TaggedMesh) -> dict[int, str]:
    """Return a body's tags of faces with their names in the joined mesh, on this rank."""
    return {int(tag): f"{name} {part.facet_name(int(tag))}" for tag in part.facet_tags.values}


def _cell_groups(name: str, part: TaggedMesh) -> dict[int, str]:
    """Return a body's tags of cells likewise."""
    names = {number: known for known, number in part.cell_names.items()} | {-1: "rest"}
    return {tag: f"{name} {names.get(tag, tag)}" for tag in _of_own_cells(part)}


def _numbered(
    parts: Mapping[str, TaggedMesh], groups: Any
) -> tuple[dict[str, int], dict[tuple[str, int], int]]:
    """Return new numbers of the groups of all bodies by name, and by body and old number."""
    by_name, by_number = dict[str, int](), dict[tuple[str, int], int]()
    for name, part in parts.items():
        here: dict[int, str] = {}
        for found in part.comm.allgather(groups(name, part)):
            here |= found
        alone = groups is _cell_groups and len(here) == 1
        for tag in sorted(here):
            by_number[name, tag] = len(by_number) + 1
            called = name if alone else here[tag]
            if called in by_name:
                raise InputError("two groups would have one name", key=name, value=called)
            by_name[called] = by_number[name, tag]
    return by_name, by_number
