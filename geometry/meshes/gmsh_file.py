"""Meshes in gmsh's own files, as arrays."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from patchlaw.geometry.meshes.msh_sections import KINDS, MshContent, msh_content
from patchlaw.support import Array, Counts, InputError, Locals, located, reading

Table = Counts

_ALLOWED = "tetrahedra alone, or hexahedra alone"

_CORNERS = {"tetrahedron": [0, 1, 2, 3], "hexahedron": [0, 1, 3, 2, 4, 5, 7, 6]}
"""Corners of gmsh's cells in the order of dolfinx; those of hexahedra form a tensor product."""

_FACETS = {"tetrahedron": ("triangle", 3), "hexahedron": ("quadrilateral", 4)}
"""Name and corners of the facets of a cell."""

_EDGES = (
    (0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)
)  # fmt: skip
_FACES = (0, 1, 2, 3), (0, 1, 4, 5), (0, 3, 4, 7), (1, 2, 5, 6), (2, 3, 6, 7), (4, 5, 6, 7)
_MIDDLES: Mapping[str, Sequence[Sequence[int]]] = {
    "tetrahedron": ((0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)),
    "hexahedron": (*_EDGES, *_FACES, range(8)),
}
"""Corners, as gmsh counts them, between which its nodes of second order lie."""

_SECOND_ORDER: Mapping[str, Sequence[int]] = {
    "tetrahedron": (8, 9, 5, 7, 6, 4),
    "hexahedron": (*range(8, 14), 15, 14, *range(16, 27)),
}
"""gmsh's nodes of second order in the order of dolfinx, which is that of basix' edges and faces."""

NO_GROUP = 0
"""Tag of cells without a physical group, where other cells have one; its name is the number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshArrays:
    """A whole mesh of tetrahedra or hexahedra, with the groups of its cells and facets.

    Attributes:
        points: Nodes that cells use, shape (n, 3), in the unit of the file.
        cells: Nodes of the cells in the order of dolfinx, shape (m, 4 or 8), or (m, 10 or 27) where
            some edge is curved.
        cell_tags: Group of every cell, shape (m,).
        facets: Corners of the facets that have a group, (k, 3 or 4); −1 where no cell has one.
        facet_tags: Their groups, shape (k,).
        cell_names: Tags by the names of the cells' groups; groups without a name have their number.
        facet_names: Tags by the names of the facets' groups, in the same way.
    """

    points: Array
    cells: Table
    cell_tags: Locals
    facets: Table
    facet_tags: Locals
    cell_names: dict[str, int]
    facet_names: dict[str, int]


def read_gmsh_file(path: Path) -> MeshArrays:
    """Read a mesh from gmsh's file, of format 2 or 4, text or binary; see `msh_sections`.

    The physical groups of volumes and surfaces give tags and names. Where a file has no physical
    group of volumes, their own numbers are the tags; surfaces in the same way.

    Args:
        path: The file.

    Raises:
        InputError: When it is no such file, or holds no mesh of tetrahedra or hexahedra alone, or
            when a volume or a surface has two groups.
    """
    with located(str(path)):
        with reading(path):
            content = path.read_bytes()
        return _arrays(msh_content(content))


def _arrays(content: MshContent) -> MeshArrays:
    """Return the mesh of a file."""
    sorting = np.argsort(content.numbers, kind="stable")
    numbers, points = content.numbers[sorting], content.points[sorting]
    if (again := numbers[1:][numbers[1:] == numbers[:-1]]).size:
        raise InputError(f"several nodes of the mesh have the number {again[0]}")
    kind = _kind_of_cells(content)
    name = KINDS[kind][2]
    cells, cell_tags, cell_names = _tagged(content, 3, name, KINDS[kind][1])
    table = _rows(numbers, cells)
    order = [*_CORNERS[name]]
    if cells.shape[1] > len(order) and _is_curved(points[table], _MIDDLES[name]):
        points, table = _with_middles(points, table, _MIDDLES[name])
        order += _SECOND_ORDER[name]
    table = table[:, order]
    refuse_repeated(keys_of_cells(table))
    facets, facet_tags, facet_names = _tagged(content, 2, *_FACETS[name])
    rows = _rows(numbers, facets)
    used = np.zeros(len(points), dtype=bool)  # nodes of arcs' centres and of other things do not
    used[table] = True
    renumbered = np.where(used, np.cumsum(used) - 1, -1)
    return MeshArrays(
        points=points[used],
        cells=renumbered[table],
        cell_tags=cell_tags,
        facets=renumbered[rows],
        facet_tags=facet_tags,
        cell_names=cell_names,
        facet_names=facet_names,
    )


def _kind_of_cells(content: MshContent) -> int:
    """Return the one kind of all cells."""
    counts = Counter[int]()
    for part in content.elements:
        if KINDS[part.kind][0] == 3 and len(part.nodes):
            counts[part.kind] += len(part.nodes)
    kinds = ", ".join(f"{count} × {KINDS[kind][2]}" for kind, count in counts.items())
    if not counts:
        flat = any(KINDS[part.kind][0] == 2 for part in content.elements)
        problem = "is two-dimensional, it has surfaces only" if flat else "has no cells"
        raise InputError(f"the mesh {problem}", allowed=_ALLOWED)
    if len(counts) > 1:
        raise InputError(f"the mesh has cells of several kinds: {kinds}", allowed=_ALLOWED)
    (kind,) = counts
    if KINDS[kind][2] not in _CORNERS:
        raise InputError(f"the mesh has cells of another kind: {kinds}", allowed=_ALLOWED)
    return kind


def _tagged(
    content: MshContent, dimension: int, name: str, nodes: int
) -> tuple[Table, Locals, dict[str, int]]:
    """Return nodes and tags of cells, or of the facets that have a tag, and the names of the tags.

    Args:
        content: The file.
        dimension: 3 for cells, 2 for facets.
        name: Of the elements that are meant.
        nodes: How many of their nodes are meant.
    """
    parts = [part for part in content.elements if KINDS[part.kind][0] == dimension]
    grouped = any(part.group.any() for part in parts)
    table, tags = np.empty((0, nodes), np.int64), np.empty(0, np.int64)
    known: set[int] = set()
    for part in parts:
        of_part = part.group if grouped else part.entity
        chosen = of_part != NO_GROUP if grouped and dimension == 2 else of_part >= 0
        known.update(map(int, np.unique(of_part[chosen])))
        if KINDS[part.kind][2] == name:
            table = np.concatenate([table, part.nodes[chosen, :nodes]])
            tags = np.concatenate([tags, of_part[chosen]])
    if known and max(known) > np.iinfo(np.int32).max:
        raise InputError("the number of a group is too large", value=max(known))
    names = {content.names.get((dimension, tag), str(tag)): tag for tag in sorted(known)}
    return table, tags.astype(np.int32), names


def _rows(numbers: Table, nodes: Table) -> Table:
    """Return where nodes stand among the numbers of all nodes, which ascend."""
    rows = np.minimum(np.searchsorted(numbers, nodes), max(len(numbers) - 1, 0))
    absent = nodes[numbers[rows] != nodes] if len(numbers) else nodes.ravel()
    if absent.size:
        raise InputError(
            f"elements of the mesh have the node {absent[0]}, which the file does not give"
        )
    return rows


def _is_curved(nodes: Array, middles: Sequence[Sequence[int]]) -> bool:
    """Tell whether edges or faces of cells of second order, nodes (m, count, 3), are curved.

    Args:
        nodes: Places of the nodes, corners first.
        middles: Between which corners each of the others lies.
    """
    corners = 1 + max(max(ends) for ends in middles)
    size = np.ptp(nodes[:, :corners], axis=1).max(axis=1)
    for k, ends in enumerate(middles[: nodes.shape[1] - corners], start=corners):
        straight = nodes[:, list(ends)].mean(axis=1)
        if np.any(np.abs(nodes[:, k] - straight).max(axis=1) > 1e-6 * size):
            return True
    return False


def _with_middles(
    points: Array, cells: Table, middles: Sequence[Sequence[int]]
) -> tuple[Array, Table]:
    """Return nodes and cells with the middles of faces and cells that serendipity ones lack.

    The shape of a hexahedron of 20 nodes is one of 27 nodes: a face's middle is half the sum of its
    edges' less a quarter of that of its corners, a cell's a quarter of both.
    """
    if cells.shape[1] in (10, 27):
        return points, cells
    nodes, edges = points[cells], middles[:12]
    added = []
    for corners in middles[12:]:
        inner = [8 + k for k, ends in enumerate(edges) if set(ends) <= set(corners)]
        share = 0.5 if len(corners) == 4 else 0.25
        added.append(
            share * nodes[:, inner].sum(axis=1) - 0.25 * nodes[:, list(corners)].sum(axis=1)
        )
    places = np.stack(added, axis=1)
    keys = np.column_stack([cells[:, list(corners)] for corners in middles[12:18]])
    faces = np.sort(keys.reshape(-1, 4), axis=1)
    _, first, which = np.unique(faces, axis=0, return_index=True, return_inverse=True)
    of_faces = places[:, :6].reshape(-1, 3)[first]
    numbers = len(points) + which.reshape(-1, 6)
    hubs = len(points) + len(first) + np.arange(len(cells))[:, None]
    return (
        np.concatenate([points, of_faces, places[:, 6]]),
        np.concatenate([cells, numbers, hubs], axis=1),
    )


def keys_of_cells(cells: Table) -> NDArray[np.uint64]:
    """Return a number for every cell, which is the same for any order of its nodes.

    Those of two cells are equal by chance once in 2⁶⁴ times.

    Args:
        cells: Nodes of the cells, shape (m, nodes).
    """
    odd = np.uint64(0x9E3779B97F4A7C15)
    mixed = (cells.astype(np.uint64) + np.uint64(1)) * odd
    mixed = (mixed ^ (mixed >> np.uint64(29))) * odd
    return np.asarray((mixed ^ (mixed >> np.uint64(32))).sum(axis=1))


def refuse_repeated(keys: NDArray[np.uint64]) -> None:
    """Refuse cells that stand in a mesh twice, such as those written once for every group.

    Args:
        keys: Those of its cells, see `keys_of_cells`.

    Raises:
        InputError: Says how many they are.
    """
    if again := len(keys) - len(np.unique(keys)):
        raise InputError(
            f"{again} cells stand in the mesh more than once; a volume may be in one physical group"
        )
