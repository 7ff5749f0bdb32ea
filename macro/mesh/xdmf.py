"""Meshes with tags in dolfinx's XDMF files, which all ranks read and write, each its part."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from dolfinx import io
from dolfinx import mesh as dmesh

from patchlaw.geometry.meshes.gmsh_file import NO_GROUP, keys_of_cells, refuse_repeated
from patchlaw.macro import compat
from patchlaw.macro.mesh.tagged import TaggedMesh
from patchlaw.support import InputError, on_root
from patchlaw.support.packages import optional_packages

_CELLS = {
    "tetrahedron": "triangle",
    "tetrahedron_10": "triangle_6",
    "hexahedron": "quadrilateral",  # those of 27 nodes are written by dolfinx, but not read
}
"""Names of the cells' topology, without capitals, and of their facets'."""

_NODES = {
    "tetrahedron": 4, "tetrahedron_10": 10, "hexahedron": 8,
    "triangle": 3, "triangle_6": 6, "quadrilateral": 4,
}  # fmt: skip
_CHUNK = 1 << 16
"""Cells that are checked at a time."""

NAMES = "patchlaw tags"
"""Name of the entry with the names of the tags, as JSON: tags of ``facets`` and ``cells``."""

_ALLOWED = "one mesh of tetrahedra or straight hexahedra, as dolfinx writes it"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Layout:
    """Names of the grids of a file, those of its tags, where it has some, and numbers of tags."""

    mesh: str
    facets: str | None
    cells: str | None
    names: dict[str, dict[str, int]]
    counts: dict[str, int]


def read_xdmf(path: Path, comm: Any) -> TaggedMesh:
    """Read a mesh, tags of its facets and tags of its cells from one file of dolfinx.

    Args:
        path: The file.
        comm: MPI communicator.

    Raises:
        InputError: On all ranks, when the file holds no such mesh or several sets of tags.

    Note:
        Collective.
    """
    layout = on_root(comm, lambda: _layout(path))
    try:
        with compat.quiet_compiler(), io.XDMFFile(comm, str(path), "r") as file:
            mesh = file.read_mesh(name=layout.mesh)
            mesh.topology.create_connectivity(2, 3)
            mesh.topology.create_connectivity(3, 2)
            facets = file.read_meshtags(mesh, layout.facets) if layout.facets else None
            cells = file.read_meshtags(mesh, layout.cells) if layout.cells else None
        for name, tags in ((layout.facets, facets), (layout.cells, cells)):
            if name:
                _check_found(mesh, tags, layout.counts[name])
    except RuntimeError as error:
        line = str(error).strip().split("\n")[0]
        allowed = f"{_ALLOWED}; numbers without compression, which not every HDF5 knows"
        raise InputError(f"dolfinx cannot read it: {line}", allowed=allowed) from error
    if facets is None:
        facets = dmesh.meshtags(mesh, 2, np.empty(0, np.int32), np.empty(0, np.int32))
    cells = cells and _filled(mesh, cells)
    names = layout.names
    return TaggedMesh(
        mesh=mesh,
        facet_tags=facets,
        cell_tags=cells,
        facet_names=names.get("facets") or _numbers(facets, comm),
        cell_names=names.get("cells") or ({} if cells is None else _numbers(cells, comm)),
    )


def _numbers(tags: Any, comm: Any) -> dict[str, int]:
    """Return the tags of all ranks by their numbers as text."""
    own = {int(tag) for tag in np.unique(np.asarray(tags.values))}
    return {str(tag): tag for tag in sorted(set().union(*comm.allgather(own)))}


def _layout(path: Path) -> _Layout:
    """Return which grids of the file hold the mesh and its tags."""
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(f"this is no XDMF file: {error}", allowed=_ALLOWED) from error
    grids = {grid.get("Name", ""): grid for grid in root.findall("Domain/Grid")}
    uniform = {
        name: grid for name, grid in grids.items() if grid.get("GridType", "Uniform") == "Uniform"
    }
    kinds = {name: _kind(grid) for name, grid in uniform.items()}
    meshes = [name for name, grid in uniform.items() if grid.find("Geometry") is not None]
    if len(meshes) != 1:
        raise InputError(f"the file has {len(meshes)} meshes", value=meshes, allowed=_ALLOWED)
    (mesh,) = meshes
    if kinds[mesh] not in _CELLS:
        flat = " (two-dimensional)" if kinds[mesh] in _CELLS.values() else ""
        raise InputError(
            f"the mesh has cells that do not fit{flat}", value=kinds[mesh], allowed=_ALLOWED
        )

    def tags_of(what: str, kind: str) -> str | None:
        """Return the name of the one set of tags on cells of a kind."""
        several = [
            name
            for name, grid in uniform.items()
            if kinds[name] == kind and grid.find("Attribute") is not None
        ]
        if len(several) > 1:
            raise InputError(
                f"the file has several sets of tags of {what}", value=several, allowed="one"
            )
        return several[0] if several else None

    facets, cells = tags_of("facets", _CELLS[kinds[mesh]]), tags_of("cells", kinds[mesh])
    tags = [uniform[name] for name in (facets, cells) if name]
    counts = _check_arrays(path, uniform[mesh], tags)
    return _Layout(mesh=mesh, facets=facets, cells=cells, names=_names(root), counts=counts)


def _names(root: ElementTree.Element) -> dict[str, dict[str, int]]:
    """Return the names that `write_mesh` gave the tags; none in other files."""
    for entry in root.iter("Information"):
        if entry.get("Name") == NAMES:
            try:
                named = json.loads(entry.get("Value", ""))
                return {kind: {str(k): int(named[kind][k]) for k in named[kind]} for kind in named}
            except (ValueError, TypeError, AttributeError) as error:
                raise InputError(f"its names of tags cannot be read: {error}") from error
    return {}


def _kind(grid: ElementTree.Element) -> str:
    """Return the name of a grid's cells, without capitals."""
    topology = grid.find("Topology")
    return "" if topology is None else topology.get("TopologyType", "").casefold()


def _check_arrays(
    path: Path, mesh: ElementTree.Element, tags: list[ElementTree.Element]
) -> dict[str, int]:
    """Refuse arrays that do not fit each other, which dolfinx would read, or not survive.

    Args:
        path: The file.
        mesh: Its grid with the mesh.
        tags: Its grids with tags.

    Returns:
        The number of tags by the names of their grids.
    """
    data = path.with_suffix(".h5")  # the one that dolfinx reads, whatever the file names
    for item in (one for grid in (mesh, *tags) for one in grid.iter("DataItem")):
        name, inside, _ = (item.text or "").strip().rpartition(":")
        if item.get("Format") != "HDF" or not inside:
            raise InputError("its numbers are in no HDF5 file", allowed=_ALLOWED)
        if not (path.parent / name).is_file():
            raise InputError(f"its numbers are in {name}, which is not there")
        if not data.is_file() or not data.samefile(path.parent / name):
            raise InputError(
                f"its numbers are in {name}, but dolfinx reads {data.name}",
                allowed="files of one name, as dolfinx writes them",
            )
    with optional_packages():
        import h5py
    try:
        with h5py.File(data, "r") as file:
            places = _array(file, mesh.find("Geometry"), "fiu")
            if places.ndim != 2 or places.shape[1] != 3:
                raise InputError("the nodes have no three coordinates", value=places.shape)
            cells = _cells(file, mesh, len(places))
            if not len(cells):
                raise InputError("the mesh has no cells")
            parts = range(0, len(cells), _CHUNK)
            keys = [keys_of_cells(cells[start : start + _CHUNK]) for start in parts]
            refuse_repeated(np.concatenate(keys))
            return {grid.get("Name", ""): _checked_tags(file, grid, len(places)) for grid in tags}
    except OSError as error:
        raise InputError(f"{data.name} cannot be read: {error}", allowed=_ALLOWED) from error


def _array(file: Any, above: ElementTree.Element | None, kinds: str) -> Any:
    """Return the dataset that an element has, whose numbers are of some kinds."""
    item = None if above is None else above.find("DataItem")
    name = "" if item is None else (item.text or "").strip().rpartition(":")[2]
    found: Any = file.get(name) if name else None
    if item is None or not hasattr(found, "dtype"):
        raise InputError(f"numbers are missing: {name or 'an element has none'}")
    stated = item.get("Dimensions", "").split()
    if stated != [str(size) for size in found.shape] and stated != [str(found.size), "1"]:
        raise InputError(f"{name} has another shape than stated", value=found.shape)
    if found.dtype.kind not in kinds:
        raise InputError(f"{name} has numbers of another kind", value=str(found.dtype))
    return found


def _cells(file: Any, grid: ElementTree.Element, nodes: int) -> Any:
    """Return the dataset with the nodes of a grid's cells, which the mesh has all."""
    kind, topology = _kind(grid), grid.find("Topology")
    cells = _array(file, topology, "iu")
    if cells.ndim != 2 or cells.shape[1] != _NODES[kind]:
        raise InputError(f"cells of the kind {kind} have other nodes", value=cells.shape)
    assert topology is not None
    if topology.get("NumberOfElements", str(len(cells))) != str(len(cells)):
        raise InputError(
            "another number of cells is stated", value=topology.get("NumberOfElements")
        )
    for start in range(0, len(cells), _CHUNK):
        part = cells[start : start + _CHUNK]
        if (absent := part[(part < 0) | (part >= nodes)]).size:
            raise InputError(f"cells have the node {absent[0]} of {nodes} nodes")
    return cells


def _checked_tags(file: Any, grid: ElementTree.Element, nodes: int) -> int:
    """Return the number of tags, which are numbers of 32 bits and as many as what they mark."""
    marked, values = _cells(file, grid, nodes), _array(file, grid.find("Attribute"), "iu")
    if values.size != len(marked):
        raise InputError(f"there are {values.size} tags of {len(marked)} facets or cells")
    if (values[()] != values[()].astype(np.int32)).any():
        raise InputError("tags are no numbers of 32 bits")
    return len(marked)


def _check_found(mesh: Any, tags: Any, count: int) -> None:
    """Refuse tags of what is no part of the mesh, or has two, of which dolfinx leaves some out."""
    own = np.asarray(tags.indices) < mesh.topology.index_map(tags.dim).size_local
    missing = count - mesh.comm.allreduce(int(np.count_nonzero(own)))
    if missing:
        what = "facets" if tags.dim == 2 else "cells"
        raise InputError(
            f"{missing} of {count} tags of {what} stand there twice, or mark none of the mesh"
        )


def write_mesh(tagged: TaggedMesh, path: str | Path) -> None:
    """Write a mesh with its tags and their names, to be read again by `read_mesh`.

    gmsh's files are read whole on rank 0, which takes 0.4 kB there for every cell of the mesh. The
    files written here are read in parts: 0.5 kB for every cell that a rank then has.

    Args:
        tagged: The mesh [mm].
        path: The file, ``.xdmf``; its numbers go into an ``.h5`` beside it.

    Raises:
        InputError: On all ranks, when the name ends in anything else.

    Note:
        Collective.
    """
    path = Path(path)
    if path.suffix != ".xdmf":
        raise InputError(
            "meshes are not written in this format", value=path.suffix, allowed=".xdmf"
        )
    tags = {"facets": tagged.facet_tags, "cells": tagged.cell_tags}
    with compat.quiet_compiler(), io.XDMFFile(tagged.comm, str(path), "w") as file:
        file.write_mesh(tagged.mesh)
        for name, each in tags.items():
            if each is not None:
                each.name = name
                compat.write_tags(file, each, tagged.mesh)
    on_root(tagged.comm, lambda: _add_names(path, tagged))


def _add_names(path: Path, tagged: TaggedMesh) -> None:
    """Add the names of the tags to a file of dolfinx, which takes no notice of them."""
    tree = ElementTree.parse(path)
    names = {"facets": dict(tagged.facet_names), "cells": dict(tagged.cell_names)}
    entry = {"Name": NAMES, "Value": json.dumps(names)}
    ElementTree.SubElement(tree.getroot(), "Information", entry)
    tree.write(path, xml_declaration=True)


def _filled(mesh: Any, tags: Any) -> Any:
    """Return tags of all this rank's cells: `NO_GROUP` where there was none.

    Args:
        mesh: dolfinx mesh.
        tags: Tags of some of its cells.
    """
    cells = mesh.topology.index_map(3)
    values = np.full(cells.size_local + cells.num_ghosts, NO_GROUP, np.int32)
    values[tags.indices] = tags.values
    return dmesh.meshtags(mesh, 3, np.arange(len(values), dtype=np.int32), values)
