"""Uniform refinement of a body's mesh: every cell into eight, every facet into four.

New nodes are the middles of edges and, of hexahedra, of faces and cells; edges stay straight. A
tetrahedron leaves an octahedron between its corners, which is always cut along the same diagonal:
the shapes of cells fall into three classes however often they are refined (Bey, Computing 55
(1995), 355-378, doi 10.1007/BF02238487).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.macro import compat
from patchlaw.macro.mesh.from_file import cell_tags, facet_tags
from patchlaw.macro.mesh.tagged import TaggedMesh
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError

Numbers = NDArray[np.int64]

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
    """Numbers of the nodes of the refined mesh, consecutive on every rank.

    Attributes:
        own: By cell of this rank its nodes, corners before the middles of edges, of faces and of
            the cell, shape (cells, nodes of a cell).
        column: Column of `own` by the corners between which a node lies, such as ``"02"``.
        points: This rank's nodes, shape (n, 3) [mm].
    """

    own: Numbers
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
        sizes = np.array(comm.allgather([one.size_local for one in maps]))
        # the first number of every kind on every rank
        first = np.concatenate([[0], np.cumsum(sizes.ravel())])[:-1].reshape(sizes.shape)
        vertices, count = compat.cell_vertices(mesh), topology.index_map(3).size_local
        own, points, column = [], [], dict[str, int]()
        for kind, ((corners, entities), index_map) in enumerate(zip(tables, maps, strict=True)):
            size = index_map.size_local + index_map.num_ghosts
            whole = index_map.local_to_global(np.arange(size, dtype=np.int32))
            begins = np.concatenate([[0], np.cumsum(sizes[:, kind])])
            owner = np.searchsorted(begins, whole, side="right") - 1
            own.append((first[owner, kind] + whole - begins[owner])[entities[:count]])
            middle = np.empty((size, 3))
            for place, between in enumerate(corners):
                middle[entities[:, place]] = mesh.geometry.x[vertices[:, between]].mean(axis=1)
                column["".join(map(str, sorted(between)))] = len(column)
            points.append(middle[: index_map.size_local])
        return cls(own=np.hstack(own), column=column, points=np.concatenate(points))

    def of_cells(self, parts: list[list[str]]) -> Numbers:
        """Return the cells that this rank's cells are cut into, shape (n, 4 or 8)."""
        columns = [[self.column[name] for name in part] for part in parts]
        return self.own[:, columns].reshape(-1, len(parts[0]))


def _cut_facets(tagged: TaggedMesh, nodes: _Nodes) -> tuple[Numbers, NDArray[np.int32]]:
    """Return the facets that marked ones of this rank's cells are cut into, and their tags."""
    topology = tagged.mesh.topology
    topology.create_connectivity(3, 2)
    _, shapes = compat.reference_facets(topology.cell_name())
    sides = topology.connectivity(3, 2).array.reshape(-1, len(shapes))[: len(nodes.own)]
    marked, tag_of = (np.zeros(int(sides.max(initial=-1)) + 1, kind) for kind in (bool, np.int32))
    known = np.asarray(tagged.facet_tags.indices) < len(marked)
    indices = np.asarray(tagged.facet_tags.indices)[known]
    marked[indices], tag_of[indices] = True, np.asarray(tagged.facet_tags.values)[known]
    parts = _TRIANGLE if shapes.shape[1] == 3 else _QUADRILATERAL
    found, tags = [], []
    for side, corners in enumerate(shapes):
        here = np.flatnonzero(marked[sides[:, side]])
        columns = [[nodes.column[_on(corners, name)] for name in part] for part in parts]
        found.append(nodes.own[here][:, columns].reshape(-1, shapes.shape[1]))
        tags.append(np.repeat(tag_of[sides[here, side]], len(parts)))
    return np.concatenate(found), np.concatenate(tags)


def _on(corners: NDArray[np.intp], name: str) -> str:
    """Return the name in a cell of a node of one of its facets."""
    return "".join(sorted(str(corners[int(digit)]) for digit in name))
