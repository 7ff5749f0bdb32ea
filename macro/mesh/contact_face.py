"""Facets of a planar contact face, and quadrature on it cut along borders of patches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from dolfinx import fem

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.face_frame import UPWARD, FaceFrame, gauss_rule
from patchlaw.macro import compat
from patchlaw.macro.mesh.block import TOP, BlockMesh
from patchlaw.macro.mesh.facet_parts import (
    cut_along,
    cut_into_patches,
    divided,
    map_determinants,
    off_parallel,
    triangle_areas,
)
from patchlaw.macro.mesh.facets import (
    facet_basis,
    facet_indices,
    facet_nodes,
    facet_places,
    facet_rule,
)
from patchlaw.support import Array, Indices, Locals


@dataclass(frozen=True, slots=True, kw_only=True)
class FacetQuadrature:
    """Quadrature points of this rank on the patches, sorted by patch; there may be none.

    Args:
        x: Abscissae in the frame of the face, shape (n,) [mm].
        y: Ordinates, shape (n,) [mm].
        depth: Depths of the face below the plane of its frame, shape (n,) [mm].
        weight: Weights, whose sum over a patch and all ranks is its area, shape (n,) [mm²].
        patch: Flat index of the patch, ascending, shape (n,).
        cell: Rank-local cell that the point belongs to, shape (n,).
        reference: Places on the reference cell, shape (n, 3).
        nodes: Rank-local nodes of that cell, shape (n, m).
        values: Basis functions of these nodes, shape (n, m).
    """

    x: Array
    y: Array
    depth: Array
    weight: Array
    patch: Indices
    cell: Locals
    reference: Array
    nodes: Locals
    values: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactFacets:
    """Facets of a contact face whose cells this rank owns: triangles, or quadrilaterals.

    Those of curved cells have nodes between their corners, too, see `facet_basis`; m is the number
    of their nodes, 3, 4, 6 or 9.

    Args:
        frame: Frame of the face, or of the one that it is pressed on.
        outward: Unit normal out of the body, shape (3,): that of the frame, or its opposite.
        cell: Rank-local cell that the facet belongs to, shape (n,).
        side: Index of the facet in its cell, shape (n,).
        reference: Vertices on the reference cell, shape (n, 3 or 4, 3).
        corners: Nodes in the plane, vertices first, shape (n, m, 2) [mm]; of a plane mesh those of
            the strips that its edges stand for, see `facet_places`.
        depth: Depths of the nodes below the plane, into the body, shape (n, m) [mm].
        axisymmetric: Whether the edges of a plane mesh are turned about x = 0, so that weights of
            quadrature points have the factor 2 π x.
    """

    frame: FaceFrame
    outward: Array
    cell: Locals
    side: Indices
    reference: Array
    corners: Array
    depth: Array
    axisymmetric: bool = False

    @property
    def directions(self) -> Array:
        """Where the body is loaded to by a pressure and by shear stresses, shape (3, 3).

        Into the body and along both axes of the frame; of a counter-body against these, as it bears
        the opposite stresses.
        """
        side = 1.0 if self.outward @ self.frame.normal > 0.0 else -1.0
        return np.stack([-self.outward, *(side * self.frame.axes[:2])])

    @property
    def area(self) -> Array:
        """Areas in the plane, shape (n,) [mm²]."""
        exact = 4 if self.corners.shape[1] > 4 else 1  # for the determinants of the maps
        rule, weights = facet_rule(self.reference.shape[1], exact)
        return np.asarray(np.abs(map_determinants(self.corners[:, None], rule[None]) @ weights))

    @property
    def vertices(self) -> Array:
        """Vertices in the plane, shape (n, 3 or 4, 2) [mm]."""
        return self.corners[:, : self.reference.shape[1]]

    def at_cells(self, cells: Locals) -> Indices:
        """Return the facets of rank-local cells, each of which has one.

        Args:
            cells: Numbers of the cells, shape (n,).
        """
        order = np.argsort(self.cell)
        return np.asarray(order[np.searchsorted(self.cell, cells, sorter=order)])

    def joined(self, others: Sequence[ContactFacets]) -> ContactFacets:
        """Return these facets and others of the same face."""
        one = ("frame", "outward", "axisymmetric")
        arrays = [each.name for each in fields(self) if each.name not in one]
        parts = (self, *others)
        return replace(
            self, **{name: np.concatenate([getattr(p, name) for p in parts]) for name in arrays}
        )

    def moved(self, x: float, y: float) -> ContactFacets:
        """Return the facets with coordinates that count from a point of the plane [mm]."""
        return replace(self, frame=self.frame.moved(x, y), corners=self.corners - (x, y))

    def local(self, facet: Indices, points: Array) -> Array:
        """Return the coordinates of points on the unit triangle or square, shape (n, 2).

        Those of points far from a curved facet, which its map may not reach, are infinite.

        Args:
            facet: The facet of each point, shape (n,).
            points: Points in the plane, shape (n, 2) [mm].
        """
        corners = self.vertices
        edges = np.swapaxes(corners[:, 1:3] - corners[:, :1], 1, 2)
        offset = points - corners[facet, 0]
        s = np.asarray(np.einsum("nij,nj->ni", np.linalg.inv(edges)[facet], offset))
        # straight triangles and parallelograms need no Newton step to invert the map
        bent = off_parallel(self.corners)[facet]
        at, nodes = s[bent], self.corners[facet[bent]]
        size = np.ptp(nodes, axis=1).max(axis=1)[:, None]
        for _ in range(24):  # 4 or 5 but beside corners where both edges have one direction
            values, slopes = facet_basis(nodes.shape[1], at)
            miss = np.einsum("nm,nmi->ni", values, nodes) - points[bent]
            if not np.any(np.abs(miss) > 1e-12 * size):
                break
            maps = np.einsum("nmi,nmj->nij", nodes, slopes)
            singular = np.abs(np.linalg.det(maps)) < 1e-12 * size[:, 0] ** 2
            maps[singular] = np.eye(2) * size[singular, None]
            at = np.clip(at - np.linalg.solve(maps, miss[..., None])[..., 0], -1.0, 2.0)
        s[bent] = np.where(np.abs(miss).max(axis=1, keepdims=True) <= 1e-6 * size, at, np.inf)
        return s

    def pull_back(self, facet: Indices, local: Array) -> Array:
        """Map coordinates (n, 2) on given facets (n,) to the reference cell, (n, 3)."""
        start, ends = self.reference[:, 0], self.reference[:, 1:3] - self.reference[:, :1]
        return start[facet] + np.einsum("nk,nkj->nj", local, ends[facet])

    def depths(self, facet: Indices, local: Array) -> Array:
        """Return depths below the plane at coordinates (n, 2) on given facets, shape (n,) [mm]."""
        values, _ = facet_basis(self.depth.shape[1], local)
        return np.einsum("nk,nk->n", values, self.depth[facet])


class Opposite(NamedTuple):
    """Facets of all ranks that lie opposite to a face.

    Attributes:
        corners: Corners of their straight parts, see `straight_parts`, shape (m, 3 or 4, 2) [mm].
        degree: Polynomial degree of the basis functions on them.
    """

    corners: Array
    degree: int


def facet_quadrature(
    facets: ContactFacets,
    space: Any,
    parts: PatchGrid | Indices,
    *,
    degree: int,
    counter: Opposite | None = None,
) -> FacetQuadrature:
    """Place quadrature points on the part of a contact face that the patches cover.

    Every facet is cut into triangles along the borders of the patches, so that integrals over a
    patch are exact for polynomials of the degree also where a border runs through elements.

    Args:
        facets: Facets of the face.
        space: Displacements on their mesh.
        parts: Patches on the face, in its frame; or the part that each whole facet is of, (n,).
        degree: Polynomial degree that is integrated exactly.
        counter: Facets that lie opposite. Triangles are cut along their edges, what no facet lies
            opposite to has no points, and small pieces have points that are enough for a uniform
            pressure.
    """
    if facets.reference.shape[2] == 2:
        return _on_edges(facets, space, parts, degree, counter)
    triangles, facet, curved = divided(facets.corners)
    part = np.arange(len(facet))
    if isinstance(parts, PatchGrid):
        triangles, part = cut_into_patches(triangles, part, parts)
    pieces = [(triangles, part, degree)]
    if counter is not None:
        degrees = (max(each, counter.degree) for each in (degree, -(-degree // 2)))
        pieces = cut_along(triangles, part, counter.corners, *degrees)
    points = [_in_triangles(*each) for each in pieces]
    positions, weight, part, middle = (np.concatenate(one) for one in zip(*points, strict=True))
    patch = parts.index_of(*middle.T) if isinstance(parts, PatchGrid) else parts[facet[part]]
    order = np.argsort(patch, kind="stable")
    positions, weight, part, patch = positions[order], weight[order], part[order], patch[order]
    facet = facet[part]
    if curved is None:
        local = facets.local(facet, positions)
    else:
        local, positions, share = curved.placed(part, positions, facets.corners[facet])
        weight = share * weight
    return _quadrature(facets, space, facet, local, positions, weight, patch)


def _in_triangles(
    triangles: Array, part: Indices, degree: int
) -> tuple[Array, Array, Indices, Array]:
    """Return points in triangles, their weights, parts, and the middles of their triangles."""
    points, weights = compat.triangle_rule(degree)
    edges = triangles[:, 1:] - triangles[:, :1]
    positions = (triangles[:, :1] + np.einsum("qk,nkj->nqj", points, edges)).reshape(-1, 2)
    weight = np.multiply.outer(2.0 * triangle_areas(triangles), weights).ravel()
    count = len(weights)
    middle = np.repeat(triangles.mean(axis=1), count, axis=0)
    return positions, weight, np.repeat(part, count), middle


def _on_edges(
    facets: ContactFacets,
    space: Any,
    parts: PatchGrid | Indices,
    degree: int,
    counter: Opposite | None,
) -> FacetQuadrature:
    """Return the quadrature on the edges of a plane mesh, cut at patches and at edges opposite."""
    ends = np.sort(facets.corners[:, :2, 0], axis=1)
    if isinstance(parts, PatchGrid):
        first, borders = np.zeros(len(ends), np.intp), parts.borders_x
    else:
        first, borders = parts, np.array([-np.inf, np.inf])
    lower, upper = (
        limit(ends[:, side, None], borders[None, at])
        for limit, side, at in ((np.maximum, 0, slice(-1)), (np.minimum, 1, slice(1, None)))
    )
    column, facet = np.nonzero((upper - lower > 1e-9 * np.diff(ends)).T)
    lower, upper = lower[facet, column], upper[facet, column]
    patch = first[facet] + column
    if counter is not None:
        owner, lower, upper = _cut_at(np.unique(counter.corners[..., 0]), lower, upper)
        facet, patch, degree = facet[owner], patch[owner], max(degree, counter.degree)
    length, order = upper - lower, np.argsort(patch, kind="stable")
    nodes, weights = (0.5 * part for part in gauss_rule(degree // 2 + 1))
    facet, patch = (np.repeat(part[order], len(nodes)) for part in (facet, patch))
    x = (lower[order, None] + np.multiply.outer(length[order], 0.5 + nodes)).ravel()
    positions = np.column_stack((x, facets.corners[facet, :4, 1].mean(axis=1)))
    weight = np.multiply.outer(length[order], weights).ravel()
    return _quadrature(
        facets, space, facet, facets.local(facet, positions), positions, weight, patch
    )


def _cut_at(at: Array, lower: Array, upper: Array) -> tuple[Indices, Array, Array]:
    """Cut intervals at places, ascending; return the interval that each piece is of, and its ends.

    Args:
        at: The places, shape (m,) [mm].
        lower: Lower ends of the intervals, shape (n,) [mm].
        upper: Upper ends [mm].
    """
    begin, end = np.searchsorted(at, lower, "right"), np.searchsorted(at, upper, "left")
    count = np.maximum(end - begin, 0) + 1
    owner = np.repeat(np.arange(len(lower)), count)
    place = np.arange(len(owner)) + np.repeat(begin - np.cumsum(count) + count, count)
    ends = np.concatenate(([-np.inf], at, [np.inf]))
    low, high = np.fmax(lower[owner], ends[place]), np.fmin(upper[owner], ends[place + 1])
    kept = high - low > 1e-9 * (upper - lower)[owner]
    return owner[kept], low[kept], high[kept]


def _quadrature(
    facets: ContactFacets,
    space: Any,
    facet: Indices,
    local: Array,
    positions: Array,
    weight: Array,
    patch: Indices,
) -> FacetQuadrature:
    """Return points on facets with their basis functions; of a turned edge those of its circles."""
    reference, depth = facets.pull_back(facet, local), facets.depths(facet, local)
    if facets.axisymmetric:
        weight = 2.0 * np.pi * facets.frame.in_space(positions)[:, 0] * weight
    return FacetQuadrature(
        x=positions[:, 0],
        y=positions[:, 1],
        depth=depth,
        weight=weight,
        patch=patch,
        cell=facets.cell[facet],
        reference=reference,
        nodes=compat.cell_nodes(space)[facets.cell[facet]],
        values=compat.lagrange_values(
            space.mesh.topology.cell_name(), compat.lagrange_degree(space), reference
        ),
    )


def vertex_means(mesh: Any, name: str, cell: Indices, weights: Array, values: Array) -> Any:
    """Return a function on a mesh, linear between vertices, from values of this rank's cells.

    Args:
        mesh: The mesh.
        name: Name of the function.
        cell: Rank-local cell of each of n values, shape (n,).
        weights: Their weights at the vertices of that cell, shape (n, vertices).
        values: The values, shape (n,).

    Returns:
        The weighted means at the vertices that have weights, and 0 elsewhere.

    Note:
        Collective.
    """
    space = compat.scalar_space(mesh, 1)
    function = fem.Function(space, name=name)
    nodes, size = compat.cell_nodes(space)[cell].ravel(), len(function.x.array)
    total, weight = (
        compat.sum_of_ranks(space, np.bincount(nodes, part.ravel(), size))
        for part in (weights * values[:, None], weights)
    )
    np.divide(total, weight, out=function.x.array[: len(total)], where=weight > 0.0)
    function.x.scatter_forward()
    return function


def point_field(mesh: Any, name: str, points: Any, values: Array) -> Any:
    """Return a function on a mesh from values at the quadrature points of a face, see above.

    Args:
        mesh: The mesh.
        name: Name of the function.
        points: The points, with their cells, weights and places in the reference cell.
        values: The values, shape (n,).

    Note:
        Collective.
    """
    shapes = compat.lagrange_values(mesh.topology.cell_name(), 1, points.reference)
    return vertex_means(mesh, name, points.cell, points.weight[:, None] * shapes, values)


def contact_facets(
    mesh: Any,
    facets: Locals,
    frame: FaceFrame,
    *,
    opposed: bool = False,
    axisymmetric: bool = False,
) -> ContactFacets:
    """Return those of this rank's outer facets whose cells it owns; there may be none.

    Args:
        mesh: dolfinx mesh.
        facets: Rank-local facets of the contact face, shape (n,), or a mask of all.
        frame: Frame of the face.
        opposed: Whether the frame is that of the face of another body, which this one is pressed
            on: its normal points into this body.
        axisymmetric: Whether a plane mesh is turned about x = 0.

    Raises:
        InputError: On this rank, when there are no such facets.
    """
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    side_of_body = -1.0 if opposed else 1.0
    nodes = facet_nodes(mesh, facet_indices(mesh, facets))
    owned = nodes.cell < mesh.topology.index_map(dim).size_local
    vertices, shapes = compat.reference_facets(mesh.topology.cell_name())
    side = nodes.side[owned]
    corners = facet_places(mesh, nodes.nodes[owned])
    ends = shapes if shapes.shape[1] > 2 else shapes[:, [0, 1, 0, 1]]  # of strips
    return ContactFacets(
        frame=frame,
        outward=side_of_body * frame.normal,
        cell=nodes.cell[owned],
        side=side,
        reference=vertices[ends[side]],
        corners=frame.in_plane(corners),
        depth=-side_of_body * frame.height(corners),
        axisymmetric=axisymmetric,
    )


def top_facets(block: BlockMesh) -> ContactFacets:
    """Return the facets of a block's top whose cells this rank owns; there may be none."""
    return contact_facets(block.mesh, block.facet_tags.find(TOP), UPWARD)
