"""Cells and corners of facets, and cells that share them, on one rank and across ranks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from patchlaw.geometry.face_frame import gauss_rule
from patchlaw.macro import compat
from patchlaw.support import Array, Counts, Flags, Indices, InputError, Locals

Ints = Counts


@dataclass(frozen=True, slots=True, kw_only=True)
class FacetNodes:
    """Facets with a cell of each: the only one of outer facets.

    Attributes:
        cell: Rank-local cells, shape (n,).
        side: Indices of the facets in them, shape (n,).
        corners: Rows of ``mesh.geometry.x``, shape (n, 3 or 4); those of a quadrilateral as a
            tensor product, 0 and 3 being opposite; on a plane mesh the ends of an edge, (n, 2).
        nodes: The same with the nodes between corners of cells that may be curved, in the order of
            `facet_basis`, shape (n, 3, 4, 6 or 9); of an edge (n, 2 or 3).
    """

    cell: Locals
    side: Indices
    corners: Locals
    nodes: Locals


def facet_outline(nodes: Array) -> Array:
    """Return points of facets that they extend to: their nodes, or more on edges that are curved.

    Args:
        nodes: Nodes of facets, shape (n, m, k).

    Returns:
        Points, shape (n', k).
    """
    if nodes.shape[1] > 4:
        steps = np.linspace(0.0, 1.0, 17)
        zero, one = np.zeros(17), np.ones(17)
        sides = [(steps, zero), (zero, steps)]
        sides += [(1.0 - steps, steps)] if nodes.shape[1] == 6 else [(steps, one), (one, steps)]
        values, _ = facet_basis(
            nodes.shape[1], np.concatenate([np.stack(s, axis=1) for s in sides])
        )
        nodes = np.concatenate([nodes, np.einsum("qm,nmk->nqk", values, nodes)], axis=1)
    return nodes.reshape(-1, nodes.shape[2])


def facet_indices(mesh: Any, facets: Any) -> Locals:
    """Return facets that a user gives, as indices.

    Args:
        mesh: dolfinx mesh with facets.
        facets: Numbers of this rank's facets, or a mask of all of them, shape (n,).

    Raises:
        InputError: When there are no such facets.
    """
    numbers = mesh.topology.index_map(mesh.topology.dim - 1)
    count = numbers.size_local + numbers.num_ghosts
    allowed = f"this rank's facets, 0 … {count - 1}, or a mask of all {count}"
    given = np.atleast_1d(np.asarray(facets))
    if given.dtype == np.bool_:
        if given.shape != (count,):
            raise InputError("the mask does not fit the facets", value=given.shape, allowed=allowed)
        return np.flatnonzero(given).astype(np.int32)
    if given.size and given.dtype.kind not in "iu":
        raise InputError("facets are no numbers", value=facets, allowed=allowed)
    absent = given[(given < 0) | (given >= count)]
    if absent.size:
        raise InputError("the facets are not in the mesh", value=int(absent[0]), allowed=allowed)
    return given.astype(np.int32)


def on_all_ranks(mesh: Any, facets: NDArray[Any]) -> Locals:
    """Return this rank's facets among those that any rank gives, ascending.

    Whoever marks a facet may not have its cell.
    """
    numbers = mesh.topology.index_map(mesh.topology.dim - 1)
    chosen = mesh.comm.allgather(numbers.local_to_global(facets.astype(np.int32)))
    local = np.arange(numbers.size_local + numbers.num_ghosts, dtype=np.int32)
    return local[np.isin(numbers.local_to_global(local), np.concatenate(chosen))]


def facets_of_cells(mesh: Any) -> Locals:
    """Return the rank-local facets of every rank-local cell, shape (cells, facets of a cell).

    Args:
        mesh: dolfinx mesh.
    """
    topology, dim = mesh.topology, mesh.topology.dim
    topology.create_connectivity(dim, dim - 1)
    _, shapes = compat.reference_facets(topology.cell_name())
    return np.asarray(topology.connectivity(dim, dim - 1).array.reshape(-1, len(shapes)))


def facet_nodes(mesh: Any, facets: Locals) -> FacetNodes:
    """Return cells and corners of facets.

    Args:
        mesh: dolfinx mesh.
        facets: Rank-local facets, shape (n,); there may be none.
    """
    topology, dim = mesh.topology, mesh.topology.dim
    topology.create_connectivity(dim - 1, dim)
    cells_of, (_, shapes) = (
        topology.connectivity(dim - 1, dim),
        compat.reference_facets(topology.cell_name()),
    )
    cell = cells_of.array[cells_of.offsets[facets]]
    side = np.argmax(facets_of_cells(mesh)[cell] == np.asarray(facets)[:, None], axis=1)
    rows = compat.cell_vertices(mesh)[cell]
    corners = np.take_along_axis(rows, shapes[side], axis=1)
    nodes = corners
    if compat.geometry_degree(mesh) == 2:
        nodes = np.take_along_axis(rows, _side_nodes(topology.cell_name())[side], axis=1)
    return FacetNodes(cell=cell, side=side, corners=corners, nodes=nodes)


_STRIPS = {
    2: ([0, 1, 0, 1], [-1, -1, 1, 1]),
    3: ([0, 1, 0, 1, 2, 0, 1, 2, 2], [-1, -1, 1, 1, -1, 0, 0, 1, 0]),
}
"""Nodes of an edge that those of its strip lie beside, by their number, and on which side."""


def facet_places(mesh: Any, nodes: Locals) -> Array:
    """Return the places of the nodes of facets, shape (n, 3, 4, 6 or 9, 3) [mm].

    The edges of a plane mesh are the middles of strips, 1 mm wide across the plane: quadrilaterals.

    Args:
        mesh: dolfinx mesh.
        nodes: As `FacetNodes.nodes`.
    """
    places = mesh.geometry.x[nodes]
    if mesh.topology.dim == 3:
        return np.asarray(places)
    beside, side = _STRIPS[nodes.shape[1]]
    return np.asarray(places[:, beside] + np.multiply.outer(0.5 * np.array(side), (0.0, 0.0, 1.0)))


BETWEEN: dict[int, list[tuple[int, ...]]] = {
    2: [(0, 1)],
    3: [(1, 2), (0, 2), (0, 1)],
    4: [(0, 1), (0, 2), (1, 3), (2, 3), (0, 1, 2, 3)],
}
"""Corners of a facet, by their number, between which its nodes of second order lie."""


@cache
def _side_nodes(cell_name: str) -> Indices:
    """Return the nodes of second order of the facets of a cell, shape (facets, 3, 6 or 9)."""
    vertices, shapes = compat.reference_facets(cell_name)
    points = compat.lagrange_points(cell_name, 2)
    between = [*((k,) for k in range(shapes.shape[1])), *BETWEEN[shapes.shape[1]]]
    places = np.array(
        [[vertices[list(side[list(ends)])].mean(axis=0) for ends in between] for side in shapes]
    )
    apart = np.linalg.norm(places[:, :, None] - points, axis=3)
    return np.asarray(apart.argmin(axis=2))


def facet_basis(count: int, local: Array) -> tuple[Array, Array]:
    """Return the basis of a facet's shape, and its slopes.

    Args:
        count: Nodes of the facet: 3, 4, or with those between corners 6 or 9.
        local: Coordinates on the unit triangle or square, shape (n, 2).

    Returns:
        Values, shape (n, count), and slopes along both coordinates, shape (n, count, 2).
    """
    cell = "triangle" if count in (3, 6) else "quadrilateral"
    table = compat.lagrange_table(cell, 1 if count < 6 else 2, np.asarray(local, float))
    return table[0], np.moveaxis(table[1:], 0, -1)


def parts(mesh: Any) -> list[int]:
    """Return the numbers of cells of the parts of a mesh that share no facets, largest first.

    Args:
        mesh: dolfinx mesh.

    Note:
        Collective. Every rank labels its own cells; the labels are joined over common facets.
    """
    cells = mesh.topology.index_map(3).size_local
    first, second = inner_facets(mesh)[0].T
    graph = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(cells, cells))
    count, label = connected_components(graph, directed=False) if cells else (0, np.empty(0, int))
    facets, cell, _ = facets_between_ranks(mesh)
    counts = mesh.comm.allgather(count)
    label = label + sum(counts[: mesh.comm.rank])
    ends = mesh.comm.allgather((facets, label[cell]))
    facet, of = (np.concatenate([end[k] for end in ends]) for k in (0, 1))
    _, row = np.unique(facet, return_inverse=True)
    size = sum(counts) + (row.max() + 1 if len(row) else 0)
    joined = coo_array((np.ones(len(of)), (of, sum(counts) + row)), shape=(size, size))
    _, part = connected_components(joined, directed=False)
    sizes = np.zeros(size, np.int64)
    np.add.at(sizes, part[label], 1)
    total = mesh.comm.allreduce(sizes)
    return sorted((int(size) for size in total[total > 0]), reverse=True)


def inner_facets(mesh: Any) -> tuple[Ints, Ints]:
    """Return the facets between two cells that this rank owns.

    Args:
        mesh: dolfinx mesh.

    Returns:
        The two cells of every facet and its indices in them, shapes (n, 2).
    """
    facet, cell, side = _sides(mesh)
    inner = np.flatnonzero(facet[1:] == facet[:-1])
    pairs = np.column_stack([inner, inner + 1])
    return cell[pairs], side[pairs]


def facets_between_ranks(mesh: Any) -> tuple[Ints, Ints, Ints]:
    """Return the facets between a cell of this rank and one of another rank.

    Args:
        mesh: dolfinx mesh.

    Returns:
        The facets' global numbers, this rank's cells, and the indices in them, shapes (n,).
    """
    facet, cell, side = _sides(mesh)
    common = ~np.isin(facet, exterior_facets(mesh))
    common[1:] &= facet[1:] != facet[:-1]
    common[:-1] &= facet[:-1] != facet[1:]
    numbers = mesh.topology.index_map(2).local_to_global(facet[common].astype(np.int32))
    return np.asarray(numbers, dtype=np.int64), cell[common], side[common]


def exterior_facets(mesh: Any) -> Locals:
    """Return the outer facets of the cells that this rank owns, ascending, shape (n,)."""
    mesh.topology.create_connectivity(mesh.topology.dim - 1, mesh.topology.dim)
    return np.sort(dmesh.exterior_facet_indices(mesh.topology)).astype(np.int32)


def _sides(mesh: Any) -> tuple[Ints, Ints, Ints]:
    """Return the facets of all owned cells by ascending facet, the cells, and the places there."""
    facets = facets_of_cells(mesh)[: mesh.topology.index_map(3).size_local]
    sides, order = facets.shape[1], np.argsort(facets, axis=None, kind="stable")
    return facets.ravel()[order].astype(np.int64), order // sides, order % sides


@dataclass(frozen=True, slots=True, kw_only=True)
class OuterFacets:
    """Outer facets of the cells that this rank owns, and q quadrature points on each.

    Args:
        facet: Rank-local index of every facet, shape (f,).
        side: Its index in its cell, shape (f,).
        points: Places, shape (f, q, 3) [mm].
        normals: Outward unit normals, shape (f, q, 3).
        weights: Weights, whose sum over all ranks is the area of the body, shape (f, q) [mm²].
        nodes: Rank-local nodes of the cells, shape (f, m).
        values: Basis functions of these nodes by the side of the cell, shape (sides, q, m).
    """

    facet: Locals
    side: Indices
    points: Array
    normals: Array
    weights: Array
    nodes: Locals
    values: Array

    @property
    def on_facet(self) -> Flags:
        """Which of the nodes lie on the facet, shape (f, m)."""
        return self.values.any(axis=1)[self.side]

    def among(self, chosen: Flags) -> OuterFacets:
        """Return some of the facets, shape of the choice (f,)."""
        names = ("facet", "side", "points", "normals", "weights", "nodes")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})


def outer_facets(space: Any, exact: int) -> OuterFacets:
    """Place quadrature points on the outer facets of this rank's cells; there may be none.

    Args:
        space: Lagrange space of the displacements.
        exact: Polynomial degree on the reference facet that is integrated exactly.

    Note:
        Collective.
    """
    mesh = space.mesh
    name, degree = mesh.topology.cell_name(), compat.lagrange_degree(space)
    vertices, corners = compat.reference_facets(name)
    facets = exterior_facets(mesh)
    outer = facet_nodes(mesh, facets)
    cell, side = outer.cell, outer.side
    shape_nodes = compat.cell_vertices(mesh)[cell]
    shape = compat.geometry_degree(mesh)
    rule, weights = facet_rule(corners.shape[1], exact)
    first = vertices[corners[:, 0]]
    tangents = vertices[corners[:, 1:3]] - first[:, None]  # (sides, 2, 3)
    reference = first[:, None] + rule @ tangents
    flat = reference.reshape(-1, 3)
    by_side = (len(corners), len(rule))
    values, basis = (
        compat.lagrange_values(name, of, flat).reshape(*by_side, -1) for of in (shape, degree)
    )
    slopes = compat.lagrange_gradients(name, shape, flat).reshape(*by_side, -1, 3)
    outwards = np.cross(*tangents.transpose(1, 0, 2))
    outwards = np.sign(np.einsum("si,si->s", outwards, first - vertices.mean(axis=0)))
    places = mesh.geometry.x[shape_nodes]
    maps = np.einsum("fqak,faj->fqkj", slopes[side], places)  # ∂x_j/∂X_k
    along = np.einsum("ftk,fqkj->fqtj", tangents[side], maps)
    areas = np.cross(along[:, :, 0], along[:, :, 1]) * np.sign(np.linalg.det(maps))[..., None]
    areas *= outwards[side, None, None]
    sizes = np.linalg.norm(areas, axis=2)
    return OuterFacets(
        facet=facets,
        side=side,
        points=np.einsum("fqa,faj->fqj", values[side], places),
        normals=areas / sizes[..., None],
        weights=sizes * weights,
        nodes=compat.cell_nodes(space)[cell],
        values=basis,
    )


def facet_rule(corners: int, exact: int) -> tuple[Array, Array]:
    """Return points (q, 2) and weights (q,) of the unit triangle or square.

    Args:
        corners: 3 or 4.
        exact: Polynomial degree that is integrated exactly.
    """
    if corners == 3:
        return compat.triangle_rule(exact)
    nodes, weights = gauss_rule(exact // 2 + 1)
    nodes, weights = 0.5 * (1.0 + nodes), 0.5 * weights
    x, y = np.meshgrid(nodes, nodes, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel()]), np.outer(weights, weights).ravel()
