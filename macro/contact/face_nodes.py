"""The nodes of a rough face, their shares of the patches, and the contact area between them.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from dolfinx import fem
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from patchlaw.geometry import PatchGrid
from patchlaw.macro import compat
from patchlaw.macro.contact.rough_face import RoughFace
from patchlaw.macro.mesh.facet_parts import triangle_areas
from patchlaw.support import Array, Flags, Indices

Index = Indices

_NO_AREA = 1e-9
"""Area of the nodes in a patch, relative to the patch, that counts as none."""


class TopNodes:
    """Nodes of a rough face, and areas, patch sums and regions of contact from nodal values.

    The force and the area of a node on the border of patches are divided equally between the two or
    four patches there. Facets are divided into triangles between neighbouring nodes; squares are
    divided along both diagonals, with half the weight each.

    Args:
        face: The face, the top of its body.
        patches: Patches on it.

    Attributes:
        dofs: Vertical degrees of freedom of this rank's nodes of the top, shape (n,).
        x: Abscissae of this rank's nodes, shape (n,) [mm].
        y: Their ordinates [mm].
        height: Their heights z [mm].
        held: Which of them a support holds along z, so that no plane can move them, shape (n,).
        area: Their tributary areas, the integrals of their basis functions over the plane [mm²];
            none at the vertices of quadratic triangles.
        patches: The patches.

    Note:
        Everything here is collective. A rank may have no node.
    """

    def __init__(self, face: RoughFace, patches: PatchGrid) -> None:
        self._face, self._body, self.patches = face, face.body, patches
        space, tags = self._body.space, self._body.mesh.facet_tags
        nodes = fem.locate_dofs_topological(space, 2, tags.find(face.marker))
        nodes = np.sort(nodes[nodes < space.dofmap.index_map.size_local])
        self.dofs = 3 * nodes + 2
        self.x, self.y, self.height = space.tabulate_dof_coordinates()[nodes].T.copy()
        self.held = self._body.supported[self.dofs]
        points = face.loaded.quadrature
        self.area = self.sum_of_ranks(points.nodes, points.weight[:, None] * points.values)
        self._patch_areas = self.patch_sums(self.area)

    @cached_property
    def facets(self) -> Index:
        """Rank-local nodes of every facet of this rank's cells, shape (facets, nodes)."""
        facets = self._face.facets
        cells = compat.cell_nodes(self._body.space)[facets.cell]
        return np.take_along_axis(cells, self._lattice.nodes[facets.side], axis=1)

    @cached_property
    def triangles(self) -> tuple[Index, Array]:
        """Rank-local nodes of the triangles, shape (m, 3), and their weighted areas (m,) [mm²]."""
        triangles = self.facets[:, self._lattice.corners].reshape(-1, 3)
        place = self._body.space.tabulate_dof_coordinates()[triangles, :2]
        weight = np.tile(self._lattice.weight, len(self.facets))
        return triangles, weight * triangle_areas(place)

    @cached_property
    def edges(self) -> Array:
        """Lengths of the edges opposite the triangles' corners, in the plane, (m, 3) [mm]."""
        place = self._body.space.tabulate_dof_coordinates()[self.triangles[0], :2]
        return np.linalg.norm(np.roll(place, -1, axis=1) - np.roll(place, 1, axis=1), axis=2)

    @cached_property
    def _lattice(self) -> FacetLattice:
        return facet_lattice(self._body.mesh.mesh.topology.cell_name(), self._body.degree)

    def covered_area(self, touching: Flags, nodal_force: Array, gap: Array) -> float:
        """Return the contact area, whose border may lie within facets; see `covered` [mm²].

        Args:
            touching: Whether this rank's nodes are in contact, shape (n,).
            nodal_force: Their contact forces, shape (n,) [N].
            gap: Their gaps, shape (n,) [mm].
        """
        triangles, area = self.triangles
        pressure = nodal_force / (self._thirds * self._face.modulus)
        values = self.with_ghosts(touching.astype(float), pressure, gap)
        flags, pressure, gap = (value[triangles] for value in values)
        share = covered(flags > 0.5, pressure, gap, self.edges)
        return float(self._body.comm.allreduce(float(area @ share)))

    def with_ghosts(self, *values: Array) -> list[Array]:
        """Return nodal values by rank-local node of the space, including ghosts.

        Args:
            values: Up to three fields of this rank's nodes of the top, shape (n,) each.
        """
        owned = np.zeros(self._body.owned_dofs)
        for axis, part in enumerate(values):
            owned[self.dofs - 2 + axis] = part
        everywhere = self._body.function(owned).x.array
        return [everywhere[axis::3].copy() for axis in range(len(values))]

    def pressure(self, nodal_force: Array) -> Array:
        """Return the pressures of this rank's nodes, 0 where they have no area, (n,) [MPa].

        Args:
            nodal_force: Their contact forces, shape (n,) [N].
        """
        some = self.area > _NO_AREA * self._thirds
        return np.divide(nodal_force, self.area, out=np.zeros(len(self.area)), where=some)

    def patch_sums(self, values: Array) -> Array:
        """Return the sums of nodal values over every patch, shape (N,), on every rank."""
        return np.asarray(self._body.comm.allreduce(self._shares.T @ values))

    def patch_means(self, values: Array) -> Array:
        """Return the means of nodal values over every patch, shape (N,), on every rank.

        A patch without a node has the value of the nearest node, or the mean of several.
        """
        empty, nearest = self._empty
        means = np.empty(self.patches.count)
        means[~empty] = self.patch_sums(self.area * values)[~empty] / self._patch_areas[~empty]
        if empty.any():
            total = self._body.comm.allreduce
            means[empty] = total(nearest.T @ values) / total(nearest.sum(axis=0))
        return means

    def regions(self, touching: Flags) -> tuple[Index, int]:
        """Find the regions of nodes in contact that facets connect, over all ranks.

        Args:
            touching: Whether this rank's nodes are in contact, shape (n,).

        Returns:
            The region 0 … m − 1 of each of this rank's nodes, −1 outside, shape (n,), and m.
        """
        (flags,) = self.with_ghosts(touching.astype(float))
        linked = flags[self.facets] > 0.5
        some = linked.any(axis=1)
        nodes, linked = self._numbers(self.facets[some]), linked[some]
        hub = np.where(linked, nodes, -1).max(axis=1, initial=-1)  # one node of every facet
        pairs = np.stack([np.broadcast_to(hub[:, None], nodes.shape)[linked], nodes[linked]])
        pairs = np.concatenate(self._body.comm.allgather(pairs), axis=1)
        names, ends = np.unique(pairs, return_inverse=True)
        regions = np.full(len(self.dofs), -1, dtype=np.intp)
        if not len(names):
            return regions, 0
        shape = (len(names), len(names))
        graph = coo_array((np.ones(pairs.shape[1]), tuple(ends.reshape(2, -1))), shape=shape)
        count, region = connected_components(graph, directed=False)
        own = self._numbers(self.dofs[touching] // 3)
        regions[touching] = region[np.searchsorted(names, own)]
        return regions, int(count)

    @cached_property
    def _empty(self) -> tuple[Flags, csr_array]:
        """Which patches hold no node, shape (N,), and marks on the nodes nearest to each."""
        # the area of vertices of quadratic triangles is rounding of either sign
        empty = self._patch_areas <= _NO_AREA * self.patches.area
        centres = self.patches.centres[empty]
        tree = cKDTree(np.stack([self.x, self.y], axis=1))
        apart = tree.query(centres)[0] if tree.n else np.full(len(centres), np.inf)
        least = np.min(self._body.comm.allgather(apart), axis=0)
        # all nodes at the smallest distance
        near = tree.query_ball_point(centres, (1.0 + 1e-9) * least) if tree.n else []
        rows = np.concatenate([np.empty(0, dtype=np.intp), *map(np.asarray, near)]).astype(np.intp)
        counts = np.array([len(nodes) for nodes in near], dtype=np.intp)
        columns = np.repeat(np.arange(len(near)), counts)
        shape = (len(self.x), len(centres))
        return empty, coo_array((np.ones(len(rows)), (rows, columns)), shape=shape).tocsr()

    @cached_property
    def _shares(self) -> csr_array:
        """Share of every node of this rank that belongs to every patch, shape (n, N)."""
        # four points around each node, of which two or four may lie in other patches
        steps = 1e-9 * max(self.patches.lengths) * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])
        around = (np.column_stack([self.x, self.y]) + steps[:, None]).reshape(-1, 2)
        count, lower = len(self.x), np.array(self.patches.origin)
        inside = np.all((around > lower) & (around < lower + self.patches.lengths), axis=1)
        rows = np.tile(np.arange(count), 4)[inside]
        columns = self.patches.index_of(*around[inside].T)
        entries = 1.0 / np.bincount(rows, minlength=count)[rows]
        return coo_array((entries, (rows, columns)), shape=(count, self.patches.count)).tocsr()

    @cached_property
    def _thirds(self) -> Array:
        """A third of the area of the triangles around each of this rank's nodes [mm²]."""
        triangles, area = self.triangles
        return self.sum_of_ranks(triangles, np.repeat(area[:, None] / 3.0, 3, axis=1))

    def sum_of_ranks(self, nodes: Index, values: Array) -> Array:
        """Return the sums of all ranks' values at this rank's nodes, shape (n,).

        Args:
            nodes: Rank-local nodes of the top, any shape.
            values: Values for them, of the same shape.
        """
        space = self._body.space
        index_map = space.dofmap.index_map
        size = 3 * (index_map.size_local + index_map.num_ghosts)
        local = np.bincount(3 * nodes.ravel() + 2, values.ravel(), minlength=size)
        return compat.sum_of_ranks(space, local)[self.dofs]

    def _numbers(self, nodes: Index) -> Index:
        """Return the global numbers of rank-local nodes."""
        index_map = self._body.space.dofmap.index_map
        return index_map.local_to_global(nodes.ravel().astype(np.int32)).reshape(nodes.shape)


class FacetLattice(NamedTuple):
    """The nodes of a facet and the triangles between neighbours.

    Attributes:
        nodes: Nodes of the cell that lie on each of its facets, shape (facets, n).
        corners: Indices of the triangles' corners into a row of ``nodes``, shape (m, 3).
        weight: Weight of each triangle, shape (m,): ½ in squares, which both diagonals divide.
    """

    nodes: Index
    corners: Index
    weight: Array


def facet_lattice(cell_name: str, degree: int) -> FacetLattice:
    """Divide the facets of a Lagrange element into triangles between neighbouring nodes.

    Args:
        cell_name: ``hexahedron`` or ``tetrahedron``.
        degree: Polynomial degree of the element.
    """
    vertices, facets = compat.reference_facets(cell_name)
    points, square = compat.lagrange_points(cell_name, degree), facets.shape[1] == 4
    steps = [
        (i, j) for i in range(degree + 1) for j in range(degree + 1) if square or i + j <= degree
    ]
    nodes = np.empty((len(facets), len(steps)), dtype=np.intp)
    for side, at in enumerate(facets):
        start, edges = vertices[at[0]], vertices[at[1:3]] - vertices[at[0]]
        places = start + np.array(steps) @ edges / degree
        nodes[side] = np.argmin(np.linalg.norm(points[None] - places[:, None], axis=2), axis=1)
    number = {step: n for n, step in enumerate(steps)}
    corners = []
    for i, j in steps:
        a, b, c, d = (i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)
        triangles = [(a, b, c), (d, c, b)] + ([(b, d, a), (c, a, d)] if square else [])
        corners += [[number[x] for x in t] for t in triangles if all(x in number for x in t)]
    weight = np.full(len(corners), 0.5 if square else 1.0)
    return FacetLattice(nodes=nodes, corners=np.array(corners), weight=weight)


def covered(touching: Flags, pressure: Array, gap: Array, length: Array) -> Array:
    """Return the share of every triangle that is in contact, shape (m,).

    The border of contact crosses the edges between a node in contact and one out of contact. For
    smooth bodies the pressure grows as κ √s with the distance s inside the border, and the gap as
    (4 κ / 3 E*) s^(3/2) with the distance outside (Johnson 1985, section 5.1,
    doi 10.1017/CBO9781139171731). The pressure at one node and the gap at the other give its place.

    Args:
        touching: Whether corners are in contact, shape (m, 3).
        pressure: Pressures there, over the contact modulus E*, shape (m, 3).
        gap: Gaps there, shape (m, 3) [mm].
        length: Lengths of the edges opposite the corners, shape (m, 3) [mm].
    """
    count = touching.sum(axis=1)
    share = (count == 3).astype(float)
    for alone in (True, False):  # one corner that touches, or one that does not
        rows = np.flatnonzero(count == (1 if alone else 2))
        one = np.argmax(touching[rows] == alone, axis=1)
        cut = np.ones(len(rows))
        for turn in (1, 2):
            other, third = (one + turn) % 3, (one - turn) % 3
            inner, outer = (one, other) if alone else (other, one)
            inside = _inside(pressure[rows, inner], gap[rows, outer], length[rows, third])
            cut *= inside if alone else 1.0 - inside
        share[rows] = cut if alone else 1.0 - cut
    return share


def _inside(pressure: Array, gap: Array, length: Array) -> Array:
    """Return the share of edges that is in contact: 1 − z with c z³ + z = 1.

    The real root is z = 2/√(3c) sinh(asinh(3√(3c)/2)/3), a hyperbolic form of Cardano's.
    """
    open_ = gap > 0.0
    c = np.divide(4.0 * pressure * length, 3.0 * gap, out=np.zeros_like(gap), where=open_) ** 2
    root = np.sqrt(3.0 * np.maximum(c, 1e-100))
    return np.where(open_, 1.0 - 2.0 / root * np.sinh(np.arcsinh(1.5 * root) / 3.0), 1.0)
