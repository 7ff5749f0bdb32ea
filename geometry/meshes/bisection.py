"""Meshes of tetrahedra that are refined where asked, by bisection of their longest edges.

Theory: docs/theory.md, section 12.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from patchlaw.support import Array, Counts, Flags, Locals

Table = Counts

_PAIRS = {
    3: np.array([(0, 1), (0, 2), (1, 2)]),
    4: np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]),
}
"""Corners at the ends of the edges of triangles and of tetrahedra."""

_HOLLOW = np.radians(20.0)
"""Least angle between the planes of two facets at which an edge counts as hollow."""

_FACES = np.array([(0, 1, 3), (0, 2, 4), (1, 2, 5), (3, 4, 5)])
"""Edges of the facets of a tetrahedron."""

_DIGITS = 1e-6
"""Relative difference of lengths that counts as none, so that rounding does not order edges."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tetrahedra:
    """A whole mesh of straight tetrahedra, and marked triangles between or on them.

    Attributes:
        points: Nodes, shape (n, 3).
        cells: Nodes of the cells, shape (m, 4).
        cell_tags: Tag of every cell, shape (m,).
        facets: Nodes of marked facets, shape (k, 3).
        facet_tags: Their tags, shape (k,).
    """

    points: Array
    cells: Table
    cell_tags: Locals
    facets: Table
    facet_tags: Locals


def refined(mesh: Tetrahedra, size: Callable[[Array], Array]) -> Tetrahedra:
    """Bisect edges until none is longer than asked at its middle.

    A cell is only ever divided through its longest edge, or after that has been divided, so that
    its angles stay bounded by those of the mesh to begin with (Rivara). Planar surfaces stay in
    their planes, and every facet has the tag of the one that it is part of.

    Args:
        mesh: The mesh to begin with.
        size: Largest length of an edge whose middle is at given points, (n, 3) to (n,).

    Source:
        Rivara 1984, doi 10.1002/nme.1620200412; Plaza & Carey 2000,
        doi 10.1016/S0168-9274(99)00022-7, on conforming division in three dimensions.
    """
    while True:
        edges, of_cell = _edges(mesh.cells)
        ends = mesh.points[edges]
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        wanted = lengths > size(ends.mean(axis=1))
        if not wanted.any():
            return mesh
        order = _order(lengths)
        mesh = _divided(mesh, edges, order, _closed(wanted, of_cell, order))


def _edges(cells: Table) -> tuple[Table, Table]:
    """Return every edge of a mesh once, (e, 2), ascending, and the edges of the cells, (m, 6)."""
    pairs = np.sort(cells[:, _PAIRS[4]], axis=2).reshape(-1, 2)
    count = int(cells.max(initial=0)) + 1
    keys, which = np.unique(pairs[:, 0] * count + pairs[:, 1], return_inverse=True)
    return np.column_stack(np.divmod(keys, count)), which.reshape(-1, 6)


def _order(lengths: Array) -> Table:
    """Return the rank of every edge by its length, and by its number among equal ones."""
    rounded = np.rint(np.log(lengths) / _DIGITS)
    order = np.empty(len(lengths), dtype=np.int64)
    order[np.argsort(rounded, kind="stable")] = np.arange(len(lengths))
    return order


def _closed(wanted: Flags, of_cell: Table, order: Table) -> Flags:
    """Return the edges to divide: with an edge also the longest of every cell and facet with it."""
    marked, cells = wanted.copy(), of_cell
    while True:
        before = int(marked.sum())
        cells_now = cells[marked[cells].any(axis=1)]
        marked[_longest(cells_now, order)] = True
        faces = cells_now[:, _FACES].reshape(-1, 3)
        marked[_longest(faces[marked[faces].any(axis=1)], order)] = True
        if int(marked.sum()) == before:
            return marked


def _longest(edges: Table, order: Table) -> Table:
    """Return the longest edge of every row."""
    return np.take_along_axis(edges, np.argmax(order[edges], axis=1)[:, None], axis=1).ravel()


def _divided(mesh: Tetrahedra, edges: Table, order: Table, marked: Flags) -> Tetrahedra:
    """Return the mesh with marked edges divided, longest first.

    On a facet between two cells the same edges are divided in the same order from both sides.
    """
    rows = np.flatnonzero(marked)
    count = len(mesh.points)
    keys, ranks = edges[rows, 0] * count + edges[rows, 1], order[rows]
    middles = mesh.points[edges[rows]].mean(axis=1)
    cells, cell_tags = _parts(mesh.cells, mesh.cell_tags, keys, ranks, count)
    facets, facet_tags = _parts(mesh.facets, mesh.facet_tags, keys, ranks, count)
    return replace(
        mesh,
        points=np.concatenate([mesh.points, middles]),
        cells=cells,
        cell_tags=cell_tags,
        facets=facets,
        facet_tags=facet_tags,
    )


def _parts(
    whole: Table, tags: Locals, keys: Table, ranks: Table, count: int
) -> tuple[Table, Locals]:
    """Return what triangles or tetrahedra are divided into, and their tags.

    Args:
        whole: Corners, shape (m, 3 or 4).
        tags: Their tags, shape (m,).
        keys: Edges to divide as first node × ``count`` + second node, ascending, shape (e,).
        ranks: Their ranks by length, shape (e,).
        count: Number of nodes; the middle of edge k becomes node ``count`` + k.
    """
    pairs, done, done_tags = _PAIRS[whole.shape[1]], [], []
    while len(whole):
        ends = np.sort(whole[:, pairs], axis=2)
        wanted = ends[..., 0] * count + ends[..., 1]
        wanted[ends[..., 1] >= count] = -1  # parts of edges, and edges between middles
        at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        rank = np.where(keys[at] == wanted, ranks[at], -1)
        longest = np.argmax(rank, axis=1)
        rows = np.arange(len(whole))
        divided = rank[rows, longest] >= 0
        done.append(whole[~divided])
        done_tags.append(tags[~divided])
        rows, longest = rows[divided], longest[divided]
        middle = count + at[rows, longest]
        parts = []
        for corner in pairs[longest].T:
            part = whole[rows].copy()
            part[np.arange(len(part)), corner] = middle
            parts.append(part)
        whole, tags = np.concatenate(parts), np.concatenate([tags[rows]] * 2)
    if not done:
        return whole, tags
    return np.concatenate(done), np.concatenate(done_tags)


def with_middles(mesh: Tetrahedra) -> tuple[Array, Table]:
    """Return nodes, and cells of second order with straight edges, in the order of dolfinx.

    Args:
        mesh: The mesh.

    Returns:
        The nodes, shape (n + edges, 3), and those of the cells, shape (m, 10).
    """
    edges, of_cell = _edges(mesh.cells)
    points = np.concatenate([mesh.points, mesh.points[edges].mean(axis=1)])
    return points, np.concatenate([mesh.cells, len(mesh.points) + of_cell[:, ::-1]], axis=1)


def from_hexahedra(points: Array, cells: Table, facets: Table) -> tuple[Array, Table, Table]:
    """Divide hexahedra into 24 tetrahedra each, around the middles of cells and facets.

    Args:
        points: Nodes, shape (n, 3).
        cells: Hexahedra in the order of dolfinx, shape (m, 8).
        facets: Marked quadrilaterals of these, as tensor products, shape (k, 4).

    Returns:
        All nodes; tetrahedra, 24 of every cell in turn; triangles, 4 of every facet in turn.
    """
    sides = hexahedron_sides(cells)
    every, which = np.unique(
        np.sort(np.concatenate([sides, facets]), axis=1), axis=0, return_inverse=True
    )
    middles = points[every].mean(axis=1)
    hubs = points[cells].mean(axis=1)
    middle = len(points) + which.ravel()
    hub = len(points) + len(every) + np.repeat(np.arange(len(cells)), 24)
    triangles = _around(np.concatenate([sides, facets]), middle)
    inner, outer = triangles[: 4 * len(sides)], triangles[4 * len(sides) :]
    return np.concatenate([points, middles, hubs]), np.column_stack([inner, hub]), outer


_HEXAHEDRON = np.array(
    [(0, 1, 2, 3), (0, 1, 4, 5), (0, 2, 4, 6), (1, 3, 5, 7), (2, 3, 6, 7), (4, 5, 6, 7)]
)
"""Corners of the facets of a hexahedron, as tensor products."""


def hexahedron_sides(cells: Table) -> Table:
    """Return the facets of hexahedra (m, 8), six of every cell in turn, shape (6 m, 4)."""
    return cells[:, _HEXAHEDRON].reshape(-1, 4)


def _around(squares: Table, middle: Table) -> Table:
    """Return the four triangles of every quadrilateral (n, 4) around its middle (n,)."""
    ring = squares[:, [0, 1, 3, 2]]
    pairs = np.stack([ring, np.roll(ring, -1, axis=1)], axis=2)
    hub = np.broadcast_to(middle[:, None, None], (len(squares), 4, 1))
    return np.concatenate([pairs, hub], axis=2).reshape(-1, 3)


def reentrant_edges(mesh: Tetrahedra) -> Array:
    """Return the edges of the surface where the body is hollow, whose stresses are singular.

    Args:
        mesh: A mesh whose marked facets are all of its surface.

    Returns:
        Their ends, shape (n, 2, 3).
    """
    outward, inside = _outward(mesh)
    corners = mesh.points[mesh.facets[inside]]
    rows = np.arange(len(corners))
    pairs = np.sort(mesh.facets[inside][:, _PAIRS[3]], axis=2).reshape(-1, 2)
    order = np.lexsort(pairs.T)
    first, second = order[:-1], order[1:]
    alike = np.all(pairs[first] == pairs[second], axis=1)
    first, second = first[alike], second[alike]
    one, other = rows[first // 3], rows[second // 3]
    start = mesh.points[pairs[first, 0]]
    middle = corners[other].mean(axis=1) - start
    rise = np.einsum("ni,ni->n", outward[one], middle)
    between = np.einsum("ni,ni->n", outward[one], outward[other])
    hollow = (rise > 0.0) & (between < np.cos(_HOLLOW))
    return mesh.points[pairs[first[hollow]]]


def _outward(mesh: Tetrahedra) -> tuple[Array, Flags]:
    """Return outward unit normals of the marked facets that one cell has, and which these are."""
    sides = mesh.cells[:, [(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)]].reshape(-1, 3)
    rows = np.concatenate([np.sort(mesh.facets, axis=1), np.sort(sides, axis=1)])
    _, which, counts = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    which = which.ravel()
    count = len(mesh.facets)
    opposite = np.full(len(counts), -1)
    opposite[which[count:]] = mesh.cells.ravel()
    single = counts[which[:count]] == 2
    corners = mesh.points[mesh.facets[single]]
    apex = mesh.points[opposite[which[:count][single]]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    inward = np.einsum("ni,ni->n", normal, apex - corners[:, 0]) > 0.0
    return np.where(inward[:, None], -normal, normal), single
