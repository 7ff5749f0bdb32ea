"""Facets of a planar contact face, its edges, and quadrature on it cut along borders of patches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from patchlaw.geometry.face_frame import UPWARD, FaceFrame
from patchlaw.geometry.legendre_modes import gauss_rule
from patchlaw.geometry.patches import PatchGrid
from patchlaw.macro import compat
from patchlaw.macro.mesh.block import TOP, BlockMesh
from patchlaw.macro.mesh.facets import (
    BETWEEN,
    facet_basis,
    facet_indices,
    facet_nodes,
    facet_places,
    facet_rule,
)
from patchlaw.support import Array, Indices


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
    patch: NDArray[np.intp]
    cell: NDArray[np.int32]
    reference: Array
    nodes: NDArray[np.int32]
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
    cell: NDArray[np.int32]
    side: NDArray[np.intp]
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
        return np.asarray(np.abs(_jacobians(self.corners[:, None], rule[None]) @ weights))

    @property
    def vertices(self) -> Array:
        """Vertices in the plane, shape (n, 3 or 4, 2) [mm]."""
        return self.corners[:, : self.reference.shape[1]]

    def at_cells(self, cells: NDArray[np.int32]) -> NDArray[np.intp]:
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

    def local(self, facet: NDArray[np.intp], points: Array) -> Array:
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
        bent = _off_parallel(self.corners)[facet]
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

    def pull_back(self, facet: NDArray[np.intp], local: Array) -> Array:
        """Map coordinates (n, 2) on given facets (n,) to the reference cell, (n, 3)."""
        start, ends = self.reference[:, 0], self.reference[:, 1:3] - self.reference[:, :1]
        return start[facet] + np.einsum("nk,nkj->nj", local, ends[facet])

    def depths(self, facet: NDArray[np.intp], local: Array) -> Array:
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
    parts: PatchGrid | NDArray[np.intp],
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
    triangles, facet, curved = _divided(facets.corners)
    part = np.arange(len(facet))
    if isinstance(parts, PatchGrid):
        triangles, part = _cut_into_patches(triangles, part, parts)
    pieces = [(triangles, part, degree)]
    if counter is not None:
        degrees = (max(each, counter.degree) for each in (degree, -(-degree // 2)))
        pieces = _cut_along(triangles, part, counter.corners, *degrees)
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
    triangles: Array, part: NDArray[np.intp], degree: int
) -> tuple[Array, Array, NDArray[np.intp], Array]:
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
    parts: PatchGrid | NDArray[np.intp],
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


def _cut_at(at: Array, lower: Array, upper: Array) -> tuple[NDArray[np.intp], Array, Array]:
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
    facet: NDArray[np.intp],
    local: Array,
    positions: Array,
    weight: Array,
    patch: NDArray[np.intp],
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
    facets: NDArray[np.int32],
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


def facet_triangles(corners: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return facets as triangles (n, 3, 2) and the facet that each comes from (n,).

    Args:
        corners: Corners of the facets, shape (m, 3 or 4, 2) [mm].
    """
    facet = np.arange(len(corners))
    if corners.shape[1] == 3:
        return corners, facet
    # Tensor order: vertices 0 and 3 of a square are opposite. The orientation decides the diagonal
    # of what is left of a triangle cut by a border, on which the quadrature error depends.
    return np.concatenate([corners[:, [0, 2, 1]], corners[:, [3, 1, 2]]]), np.tile(facet, 2)


_OFF, _OFF_INSIDE, _PARTS, _CHORDS = 2e-4, 1e-2, 4, 16
"""What straight parts of edges of second order may lie off them, of the edge's length, and chords
of edges between two facets that lie opposite, which only tell facets apart; the most parts of an
edge, in which borders of patches are taken for straight; the most chords of one opposite. Sixteen
edges around a disc have 16 chords each and lose 1.0e-4 of its area."""


def straight_parts(nodes: Array) -> Array:
    """Return straight convex parts of facets, corners against the clock, (n, 3 or 4, 2) [mm].

    Facets are parts themselves. If any is curved, those that are straight are divided into as few
    triangles as they can be, others into those between their middles and chords of their edges.
    Facets with an edge in common have its chords in common.

    Args:
        nodes: Nodes of all facets of a face in the plane, shape (m, 3, 4, 6 or 9, 2) [mm].
    """
    count = {6: 3, 9: 4}.get(nodes.shape[1], nodes.shape[1])
    found = nodes[:, [0, 1, 3, 2] if count == 4 else [0, 1, 2]]
    if nodes.shape[1] > count:
        start, end = (nodes[:, [ends[k] for ends in BETWEEN[count][:count]]] for k in (0, 1))
        between, along = nodes[:, count : 2 * count], end - start
        off = between - 0.5 * (start + end)
        share = np.abs(_cross(along, off)) / np.maximum((along**2).sum(axis=2), 1e-300)
        _, same, times = np.unique(
            between.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True
        )
        inner = times[same].reshape(share.shape) > 1
        chords = np.sqrt(share / np.where(inner, _OFF_INSIDE, _OFF))
        chords = np.clip(np.ceil(chords), 1, _CHORDS).astype(int)
        curved = chords.max(axis=1, initial=1) > 1
        if curved.any():
            whole = facet_triangles(nodes[~curved, :count])[0]
            fans = _fans(*(one[curved] for one in (start, along, off, between, chords)))
            found = np.concatenate((whole, fans))
    clockwise = _cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]) < 0.0
    return np.where(clockwise[:, None, None], found[:, ::-1], found)


def _fans(
    start: Array, along: Array, off: Array, between: Array, chords: NDArray[np.intp]
) -> Array:
    """Return triangles between the middles of facets and chords of their edges, (n, 3, 2) [mm].

    Args:
        start: Starts of the edges of every facet, shape (m, 3 or 4, 2) [mm].
        along: From there to their ends [mm].
        off: From the middles of these to the nodes between them [mm].
        between: The nodes between them [mm].
        chords: Numbers of chords, shape (m, 3 or 4).
    """
    number = chords.ravel()
    edge = np.repeat(np.arange(len(number)), number)
    first = np.arange(len(edge)) - np.repeat(np.cumsum(number) - number, number)
    start, along, off = (one.reshape(-1, 2)[edge] for one in (start, along, off))
    at = [((first + k) / number[edge])[:, None] for k in (0, 1)]
    ends = (start + t * along + 4.0 * t * (1.0 - t) * off for t in at)
    return np.stack([between.mean(axis=1)[edge // chords.shape[1]], *ends], axis=1)


class _CurvedParts(NamedTuple):
    """Triangles that facets of second order are divided into, straight on the unit facet.

    Attributes:
        corners: Their corners in the plane, shape (n, 3, 2) [mm].
        local: Their corners on the unit triangle or square, shape (n, 3, 2).
    """

    corners: Array
    local: Array

    def placed(
        self, part: NDArray[np.intp], positions: Array, nodes: Array
    ) -> tuple[Array, Array, Array]:
        """Return where points of straight triangles lie in curved facets.

        Args:
            part: The triangle of every point, shape (n,).
            positions: Points in the straight triangles in the plane, shape (n, 2) [mm].
            nodes: Nodes of the facet of each, shape (n, 6 or 9, 2) [mm].

        Returns:
            Their coordinates on the unit facet and in the plane, shape (n, 2), and the area there
            over that of the straight triangle, shape (n,).
        """
        plane, unit = (np.swapaxes(c[:, 1:] - c[:, :1], 1, 2) for c in self)
        map_ = unit @ np.linalg.inv(plane)
        offset = positions - self.corners[part, 0]
        local = self.local[part, 0] + np.einsum("nij,nj->ni", map_[part], offset)
        values, _ = facet_basis(nodes.shape[1], local)
        share = _jacobians(nodes, local) * np.linalg.det(map_)[part]
        return local, np.einsum("nm,nmi->ni", values, nodes), np.abs(share)


def _jacobians(nodes: Array, local: Array) -> Array:
    """Return the determinants of the maps of facets to the plane.

    Args:
        nodes: Nodes of the facets in the plane, shape (n, m, 2) or (n, 1, m, 2) [mm].
        local: Coordinates on the unit facets, shape (n, 2) or (1, q, 2).

    Returns:
        Determinants, shape (n,) or (n, q) [mm²].
    """
    _, slopes = facet_basis(nodes.shape[-2], local.reshape(-1, 2))
    slopes = slopes.reshape(*local.shape[:-1], *slopes.shape[1:])
    return np.asarray(np.linalg.det(np.einsum("...mi,...mj->...ij", nodes, slopes)))


def _divided(nodes: Array) -> tuple[Array, NDArray[np.intp], _CurvedParts | None]:
    """Return triangles of facets, the facet of each, and what they are of facets of second order.

    Args:
        nodes: Nodes of the facets in the plane, shape (m, 3, 4, 6 or 9, 2) [mm].
    """
    if nodes.shape[1] < 5:
        return *facet_triangles(nodes), None
    corners, found = {6: 3, 9: 4}[nodes.shape[1]], []
    number = np.clip(np.ceil(np.sqrt(_bending(nodes) / _OFF)), 1, _PARTS).astype(int)
    for parts in np.union1d(number, 1):
        chosen, unit = np.flatnonzero(number == parts), _lattice_triangles(corners, parts)
        values, _ = facet_basis(nodes.shape[1], unit.reshape(-1, 2))
        triangles = np.einsum("km,nmi->nki", values, nodes[chosen]).reshape(-1, 3, 2)
        owner = np.repeat(chosen, len(unit))
        found.append((triangles, owner, np.tile(unit, (len(chosen), 1, 1))))
    triangles, facet, local = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return triangles, facet, _CurvedParts(triangles, local)


def _lattice_triangles(count: int, n: int) -> Array:
    """Return n² parts of the unit triangle (3), or 2 n² of the square (4), shape (parts, 3, 2)."""
    found = []
    for i in range(n):
        for j in range(n):
            a, b, c, d = (i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)
            if count == 4 or i + j < n:
                found.append((a, b, c))
            if count == 4 or i + j < n - 1:
                found.append((d, c, b))
    return np.array(found) / n


def _bending(nodes: Array) -> Array:
    """Return how far nodes in the plane lie off the middles of their corners, of the size, (n,)."""
    if nodes.shape[1] < 5:
        return np.zeros(len(nodes))
    count = {6: 3, 9: 4}[nodes.shape[1]]
    middles = np.stack([nodes[:, list(ends)].mean(axis=1) for ends in BETWEEN[count]], axis=1)
    size = np.ptp(nodes[:, :count], axis=1).max(axis=1)
    return np.asarray(np.abs(nodes[:, count:] - middles).max(axis=(1, 2)) / size)


def _off_parallel(nodes: Array) -> NDArray[np.bool_]:
    """Tell which facets have a map to the plane that is not linear, shape (n,)."""
    bent = _bending(nodes) > 1e-9
    if nodes.shape[1] in (4, 9):
        twist = nodes[:, 0] - nodes[:, 1] - nodes[:, 2] + nodes[:, 3]
        bent |= np.abs(twist).max(axis=1) > 1e-12 * np.ptp(nodes[:, :4], axis=1).max(axis=1)
    return bent


def _cut_into_patches(
    triangles: Array, facet: NDArray[np.intp], patches: PatchGrid
) -> tuple[Array, NDArray[np.intp]]:
    """Cut triangles along all borders and keep those inside the patches."""
    slack = 1e-9 * max(patches.lengths)
    for axis, borders in enumerate((patches.borders_x, patches.borders_y)):
        for border in borders:
            triangles, facet = cut_triangles(triangles, facet, triangles[..., axis] - border, slack)
        middle = triangles.mean(axis=1)[:, axis]
        inside = (middle > borders[0]) & (middle < borders[-1])
        triangles, facet = triangles[inside], facet[inside]
    return triangles, facet


_SMALL_PIECE = 0.31
"""Share of a triangle, none of a regular mesh, below which pieces have fewer points. With these on
all pieces the force between tetrahedra that nearly match was off by 1.6e-3, by 2e-4 where they
match."""


def _cut_along(
    triangles: Array, part: NDArray[np.intp], others: Array, degree: int, fewer: int
) -> list[tuple[Array, NDArray[np.intp], int]]:
    """Cut triangles along the edges of facets that cover them once, in part or as a whole.

    Args:
        triangles: Corners, shape (n, 3, 2) [mm].
        part: What each is a part of, shape (n,).
        others: Corners of the facets, shape (m, 3 or 4, 2) [mm].
        degree: Polynomial degree that is exact on triangles that are not cut, and on large pieces.
        fewer: That on small pieces.

    Returns:
        Triangles, their parts and the degree: of those as they were, of large and of small pieces
        of what facets cover.
    """
    first, second, size = _near(triangles, others)
    pieces, pair = triangles[first], np.arange(len(first))
    for side in range(others.shape[1]):
        start = others[second, side]
        along = others[second, (side + 1) % others.shape[1]] - start
        normal = np.column_stack((-along[:, 1], along[:, 0]))
        normal /= (np.linalg.norm(normal, axis=1) * size[first])[:, None]
        height = np.einsum("nki,ni->nk", pieces - start[pair, None], normal[pair])
        pieces, pair = cut_triangles(pieces, pair, height, 1e-9)
        middle = pieces.mean(axis=1) - start[pair]
        inside = np.einsum("ni,ni->n", middle, normal[pair]) > 0.0
        pieces, pair = pieces[inside], pair[inside]
    owner, whole = first[pair], triangle_areas(triangles)
    area, count = triangle_areas(pieces), len(triangles)
    share, number = np.bincount(owner, area, count) / whole, np.bincount(owner, minlength=count)
    is_cut = (share < 1.0 + 1e-6) & ((number > 1) | (share < 1.0 - 1e-6))
    small = area < _SMALL_PIECE * whole[owner]
    found = [(triangles[~is_cut], part[~is_cut], degree)]
    for chosen, exact in ((is_cut[owner] & ~small, degree), (is_cut[owner] & small, fewer)):
        found.append((pieces[chosen], part[owner[chosen]], exact))
    return found


def _near(triangles: Array, others: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Return pairs of triangles and facets whose circles meet, and the triangles' radii [mm].

    Facets are looked up by octaves of their size, as few large ones may lie among many small ones.
    """
    (middles, size), (around, reach) = (
        (middle := one.mean(axis=1), np.linalg.norm(one - middle[:, None], axis=2).max(axis=1))
        for one in (triangles, others)
    )
    octave, pairs = np.frexp(reach)[1], [np.zeros((2, 0), np.intp)]
    for each in np.unique(octave) if len(triangles) else ():
        chosen = np.flatnonzero(octave == each)
        found = cKDTree(around[chosen]).query_ball_point(middles, size + reach[chosen].max())
        first = np.repeat(np.arange(len(triangles)), [len(one) for one in found])
        pairs.append(np.stack((first, chosen[np.concatenate(found).astype(np.intp)])))
    first, second = np.concatenate(pairs, axis=1)
    return first, second, size


def cut_triangles(
    triangles: Array, facet: NDArray[np.intp], height: Array, slack: float
) -> tuple[Array, NDArray[np.intp]]:
    """Cut the triangles that a line crosses into three each.

    Args:
        triangles: Corners, shape (n, 3, 2) [mm].
        facet: Facet that each triangle belongs to, shape (n,).
        height: Distances of the corners from the line on one side of it, negative on the other,
            shape (n, 3) [mm]; every triangle may have a line of its own.
        slack: Distance at which a corner counts as on the line [mm].

    Returns:
        The triangles and their facets.
    """
    side = np.where(np.abs(height) <= slack, 0, np.sign(height)).astype(int)
    crossed = (side.min(axis=1) < 0) & (side.max(axis=1) > 0)
    if not crossed.any():
        return triangles, facet
    side, corner = side[crossed], triangles[crossed]
    # the vertex that is alone on its side of the line comes first
    lonely = np.where((side > 0).sum(axis=1) == 1, 1, -1)
    first = np.argmax(side == lonely[:, None], axis=1)
    turn = (first[:, None] + np.arange(3)) % 3
    corner = np.take_along_axis(corner, turn[:, :, None], axis=1)
    height = np.take_along_axis(height[crossed], turn, axis=1)
    height[np.abs(height) <= slack] = 0.0
    a, b, c = np.swapaxes(corner, 0, 1)
    share = height[:, :1] / (height[:, :1] - height[:, 1:])
    p, q = a + share[:, :1] * (b - a), a + share[:, 1:] * (c - a)
    # the shorter diagonal, whichever way round the corners are: the quadrature depends on it
    longer = (((p - c) ** 2).sum(axis=1) > ((q - b) ** 2).sum(axis=1))[:, None]
    (p, q), (b, c) = (np.where(longer, (o, m), (m, o)) for m, o in ((p, q), (b, c)))
    pieces = np.concatenate([np.stack(t, axis=1) for t in ((a, p, q), (p, b, c), (p, c, q))])
    owners = np.tile(facet[crossed], 3)
    solid = triangle_areas(pieces) > slack**2  # a vertex on the line leaves empty pieces
    return (
        np.concatenate([triangles[~crossed], pieces[solid]]),
        np.concatenate([facet[~crossed], owners[solid]]),
    )


def triangle_areas(triangles: Array) -> Array:
    """Return the areas of triangles, corners of shape (n, 3, 2) [mm], shape (n,) [mm²]."""
    return 0.5 * np.abs(
        _cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    )


def _cross(u: Array, v: Array) -> Array:
    """Return the cross products of vectors in the plane, (..., 2) each, which numpy 2.5 refuses."""
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])
