"""The leak over the contact face of a mesh, between faces that share an edge with it.

The flow lies in one plane, ∇·(T/(12 η) ∇P) = 0. The transmissivity is known at the quadrature
points of the face. Its mean over a facet is that of the triangles of the facet, on which the flow
is solved by one rank.

Linear elements on triangles with a transmissivity each, along two axes, let too much through,
and converge with the square of the size of the triangles. The axes are those of the face, or polar
ones, which a triangle has at its middle. Their matrix is that of a network of
conductances between the nodes of each triangle, so that flows balance at every node.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from patchlaw.macro import compat
from patchlaw.macro.mesh.contact_face import ContactFacets, FacetQuadrature, vertex_means
from patchlaw.macro.mesh.facet_parts import facet_triangles
from patchlaw.macro.mesh.facets import facet_nodes
from patchlaw.support import Array, Flags, Indices, InputError, NotConverged, on_root
from patchlaw.support.network import Network, NetworkFlow, network_flow

_SAME = 1e-6
"""Distance of places that count as one, over the mean side of the triangles."""
_LEAST = 1e-9
"""Transmissivity of a triangle along the axis on which it is closed, over that along the other."""
_CORNER = 1.0
"""Angle from which two sides of the border meet at a corner; below they follow a curve [rad]."""
_MOST_BENT = 0.25
"""Largest way of the middle of a side towards the curve, over the height of its triangle."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FaceFlow:
    """The flow over a face whose inlet has the pressure 1 and whose outlet has 0.

    Args:
        total: Flow from inlet to outlet; times ΔP/(12 η) it is the flow rate [mm³]. 0 where no open
            triangles join the two.
        pressure: Pressures at the corners of the triangles, NaN where none of both reaches, shape
            (n, 3).
        leaving: What of it leaves the face from each triangle, shape (n,) [mm³].
        imbalance: Sum of the absolute differences of what enters and what leaves over all nodes,
            over the total.
    """

    total: float
    pressure: Array
    leaving: Array
    imbalance: float = 0.0


class TriangleFace:
    """Triangles of a face and the nodes on its two edges.

    Args:
        corners: Corners of the triangles, shape (n, 3, 2) [mm].
        inlet: Places of the nodes on the inlet, shape (k, 2) [mm]; those beyond the face are left
            out.
        outlet: Places of the nodes on the outlet [mm].
        centre: Centre of the polar axes, along the radius and around it, that transmissivities
            have, shape (2,) [mm]; None: they have those of the face.

    Attributes:
        corners: Corners of the triangles.

    Raises:
        InputError: When no node of the face lies on one of them, or one lies on both.
    """

    def __init__(
        self, corners: Array, inlet: Array, outlet: Array, centre: Array | None = None
    ) -> None:
        self.corners, self._ends, self._centre = corners, (inlet, outlet), centre
        edges = np.roll(corners, -1, axis=1) - corners
        near = _SAME * float(np.linalg.norm(edges, axis=2).mean())
        places = corners.reshape(-1, 2)
        _, first, node = np.unique(
            np.rint(places / near).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        self._places = nodes = places[first]
        ends = [_near(nodes, one, 1e3 * near) for one in (inlet, outlet)]
        for name, on_edge in zip(("inlet", "outlet"), ends, strict=True):
            if not on_edge.any():
                raise InputError(f"the {name} has no edge in common with the contact face")
        if (ends[0] & ends[1]).any():
            raise InputError("inlet and outlet touch each other on the contact face")
        # all nodes on an edge are one terminal of a network
        self._count = count = len(nodes)
        name_of = np.select(ends, [count, count + 1], np.arange(count))
        self._node = name_of[node.reshape(-1, 3)]
        self._own_node = node.reshape(-1, 3)
        # gradients of the three shape functions, turned sides over twice the area
        opposite = np.roll(edges, -1, axis=1)
        twice = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
        self._twice, self._area = twice, 0.5 * np.abs(twice)
        turned = np.stack([-opposite[..., 1], opposite[..., 0]], axis=2)
        self._gradient = turned / twice[:, None, None]
        if centre is not None:
            self._gradient = self._along_polar_axes(self._gradient, centre)

    def _along_polar_axes(self, gradient: Array, centre: Array) -> Array:
        """Return gradients along the radius through the middle of their triangle, and across."""
        radius = self.corners.mean(axis=1) - centre
        length = np.hypot(*radius.T)
        radius[length == 0.0] = 1.0, 0.0  # no direction is the right one
        length[length == 0.0] = 1.0
        x, y = radius.T / length
        axes = np.stack([np.stack([x, y], axis=1), np.stack([-y, x], axis=1)], axis=1)
        return np.asarray(np.einsum("nak,nik->nia", axes, gradient))

    def quartered(self, bent: float = 0.0) -> TriangleFace:
        """Return the face with every triangle cut into four, between the same edges.

        Args:
            bent: Part of the way that the new nodes on its border go from the straight sides to
                circles through the nodes beside them, `most_bent` at most; corners stay.
        """
        a, b, c = (self.corners[:, k] for k in range(3))
        middles = np.stack([0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)], axis=1)
        on_border = self._on_border
        middles[on_border] += bent * self._bends
        ab, bc, ca = (middles[:, k] for k in range(3))
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.stack([np.stack(part, axis=1) for part in parts], axis=1)
        # sides on the border of the face, both ends of which lie on an edge
        at = np.stack([self._node, np.roll(self._node, -1, axis=1)], axis=-1)
        ends = []
        for k, known in enumerate(self._ends):
            on_edge = on_border & (at == self._count + k).all(axis=-1)
            ends.append(np.concatenate([known, middles[on_edge]]))
        inlet, outlet = ends
        return TriangleFace(corners.reshape(-1, 3, 2), inlet, outlet, self._centre)

    @property
    def most_bent(self) -> float:
        """Largest part of the way to a curve that leaves every triangle its orientation."""
        height = np.abs(self._twice[np.nonzero(self._on_border)[0]]) / self._border_lengths
        way = np.hypot(*self._bends.T)
        return float(min(1.0, (_MOST_BENT * height / np.maximum(way, 1e-300)).min(initial=1.0)))

    @cached_property
    def _on_border(self) -> Flags:
        """Which sides of the triangles are on the border of the face, shape (n, 3)."""
        sides = np.sort(np.stack([self._own_node, np.roll(self._own_node, -1, axis=1)], -1), -1)
        _, side, times = np.unique(
            sides.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True
        )
        return np.asarray((times[side] == 1).reshape(-1, 3))

    @property
    def _border_lengths(self) -> Array:
        """Lengths of the sides on the border, shape (m,) [mm]."""
        ends = np.roll(self.corners, -1, axis=1) - self.corners
        return np.asarray(np.linalg.norm(ends[self._on_border], axis=1))

    @cached_property
    def _bends(self) -> Array:
        """Ways from the middles of sides on the border onto a curve, shape (m, 2) [mm]."""
        on_border = self._on_border
        triangle = np.nonzero(on_border)[0]
        ends = self._own_node, np.roll(self._own_node, -1, axis=1)
        tail, head = (one[on_border] for one in ends)
        turned = self._twice[triangle] < 0.0  # the face lies on the left of every side
        tail, head = np.where(turned, head, tail), np.where(turned, tail, head)
        way = self._places[head] - self._places[tail]
        length = np.hypot(*way.T)
        into = np.zeros(len(self._places), np.intp)
        into[head] = np.arange(len(head))  # the side that leads to a node
        before = into[tail]
        cross = way[before, 0] * way[:, 1] - way[before, 1] * way[:, 0]
        angle = np.arctan2(cross, (way[before] * way).sum(axis=1))  # at the tail of each side
        follows = np.abs(angle) < _CORNER
        curvature = np.where(follows, 2.0 * angle / (length[before] + length), 0.0)
        after = np.zeros(len(self._places), np.intp)
        after[tail] = np.arange(len(tail))
        count = follows + follows[after[head]].astype(float)
        mean = (curvature + curvature[after[head]]) / np.maximum(count, 1.0)
        outwards = np.stack([way[:, 1], -way[:, 0]], axis=1)
        return np.asarray((mean * length / 8.0)[:, None] * outwards)

    def flow(self, transmissivity: Array) -> FaceFlow:
        """Solve for the flow over the face.

        Args:
            transmissivity: T of the triangles along their axes, 0 where closed, (n, 2) [mm³].

        Raises:
            NotConverged: When what enters and leaves the nodes does not balance.
        """
        largest = transmissivity.max(axis=1)
        is_open = largest > 0.0
        part = np.maximum(transmissivity, _LEAST * largest[:, None])[is_open]
        whole = self._network(part, is_open)
        if whole.percolates:
            resolved = np.minimum(1.0, self._limits(largest, is_open) / largest[is_open])
            whole = self._network(part * resolved[:, None], is_open)
        found = self._solved(whole)
        pressure = np.full(self._node.shape, np.nan)
        pressure[is_open] = found.potential[self._node[is_open]]
        return FaceFlow(
            total=found.total,
            pressure=pressure,
            leaving=self._leaving(whole, found, is_open),
            imbalance=found.imbalance,
        )

    def _leaving(self, network: Network, found: NetworkFlow, is_open: Flags) -> Array:
        """Return what leaves the face from each triangle, shape (n,) [mm³]."""
        tail, head = self._links(is_open)
        of = np.repeat(np.flatnonzero(is_open)[:, None], 3, axis=1)[tail != head]
        into = (network.head == network.outlet).astype(float) - (network.tail == network.outlet)
        return np.asarray(np.bincount(of, into * found.flow, len(is_open)), float)

    def _solved(self, network: Network) -> NetworkFlow:
        try:
            return network_flow(network, limited=True)
        except NotConverged as error:
            raise NotConverged(
                "the flow over the contact face",
                reason=error.reason,
                iterations=error.iterations,
                remedy="take a finer mesh of the face, whose transmissivities differ too much",
            ) from None

    def _links(self, is_open: Flags) -> tuple[Indices, Indices]:
        """Return the nodes at both ends of the sides of open triangles, shape (m, 3) each."""
        node = self._node[is_open]
        return node, np.roll(node, -1, axis=1)

    def _network(self, transmissivity: Array, is_open: Flags) -> Network:
        """Return the network that the elements are, with conductances of either sign."""
        tail, head = self._links(is_open)
        gradient = self._gradient[is_open]
        weighted = gradient * (self._area[is_open, None] * transmissivity)[:, None, :]
        conductance = -np.einsum("nik,nik->ni", weighted, np.roll(gradient, -1, axis=1))
        apart = tail != head  # two nodes on an edge are one terminal
        return Network(self._count, tail[apart], head[apart], conductance[apart])

    def _limits(self, largest: Array, is_open: Flags) -> Array:
        """Return the transmissivities of open triangles that are resolved, shape (m,) [mm³]."""
        tail, head = self._links(is_open)
        apart, values = tail != head, np.repeat(largest[is_open, None], 3, axis=1)
        limits = Network(self._count, tail[apart], head[apart], values[apart]).limits
        return np.asarray(limits[self._node[is_open]].min(axis=1))


def _near(nodes: Array, places: Array, distance: float) -> Flags:
    """Return which nodes lie at one of some places, shape (n,)."""
    found = np.zeros(len(nodes), bool)
    if len(places):
        found |= np.isfinite(cKDTree(places).query(nodes, distance_upper_bound=distance)[0])
    return found


_ON_FACE = 1e-6
"""Distance from the plane of the face, over the size of the mesh, of nodes that lie on it."""
_LEAST_COVERED = 0.5
"""Part of a facet at least over which the transmissivity is known."""

Axes = Literal["x", "polar"]
"""What transmissivities lie along: the axes x and y of a face, or the radius and around it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FaceLeak:
    """What leaks over a contact face.

    Args:
        rate: Flow rate from the inlet to the outlet; 0 where the gap is closed [mm³/s].
        imbalance: Sum of the absolute differences of what enters and what leaves over all nodes,
            over the flow.
        pressure: Fluid pressure on the face, linear between its vertices [MPa]; 0 beside the face,
            and where no fluid comes.
    """

    rate: float
    imbalance: float
    pressure: Any

    @property
    def percolates(self) -> bool:
        """Whether an open path leads from edge to edge."""
        return self.rate != 0.0


class LeakingFace:
    """The facets of a contact face, and where fluid enters and leaves.

    Args:
        mesh: The mesh.
        facets: This rank's facets of the face.
        points: Quadrature points on them.
        edges: This rank's facets of the faces at inlet and outlet; those beside the contact face
            count by the edges that they share with it.
        known: Which points have a transmissivity; None: all.
        axes: Whether transmissivities lie along the axes x and y of the face, or are ``"polar"``:
            along the radius and around a centre.
        centre: A point over or on the centre of polar axes, in coordinates of the mesh, shape (3,)
            [mm]; the middle of the face's bounding rectangle when not given.

    Raises:
        InputError: On all ranks, when they share no edge, touch each other, or most of a facet has
            no transmissivity.

    Note:
        Everything is collective.
    """

    def __init__(
        self,
        mesh: Any,
        facets: ContactFacets,
        points: FacetQuadrature,
        edges: tuple[NDArray[Any], NDArray[Any]],
        known: Flags | None = None,
        *,
        axes: Axes = "x",
        centre: Sequence[float] | None = None,
    ) -> None:
        self._mesh, self._facets, self.comm = mesh, facets, mesh.comm
        self._facet = facets.at_cells(points.cell)
        self._patch = np.zeros(len(facets.cell), np.intp)
        self._patch[self._facet] = points.patch
        self._weight = points.weight if known is None else points.weight * known
        self._area = np.bincount(self._facet, self._weight, len(facets.cell))
        least = float((self._area / facets.area).min(initial=1.0))
        if min(self.comm.allgather(least)) < _LEAST_COVERED:
            raise InputError("a part of the contact face has no laws, or no face opposite")
        all_corners = self.comm.allgather(facets.vertices)
        self._counts = [len(one) for one in all_corners]
        triangles, self._triangle_facet = facet_triangles(np.concatenate(all_corners))
        places = triangles.reshape(-1, 2)
        middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
        about = middle if centre is None else facets.frame.in_plane(centre)
        polar = about if axes == "polar" else None
        inlet, outlet = (self._places(one) for one in edges)
        self._face = TriangleFace(triangles, inlet, outlet, polar)

    @property
    def triangles(self) -> Array:
        """Triangles of the facets of all ranks, in the frame of the face, shape (n, 3, 2) [mm]."""
        return self._face.corners

    @property
    def most_bent(self) -> float:
        """Largest part of the way to a curve for new nodes on the border of the face."""
        return self._face.most_bent

    def _places(self, facets: NDArray[Any]) -> Array:
        """Return where the nodes of facets of all ranks lie in the plane of the face, (n, 2)."""
        frame, points = self._facets.frame, self._mesh.geometry.x
        own = points[facet_nodes(self._mesh, facets).corners].reshape(-1, 3)
        found = np.concatenate(self.comm.allgather(own))
        spans = self.comm.allgather(float(np.abs(points).max(initial=0.0)))
        return np.asarray(
            frame.in_plane(found[np.abs(frame.height(found)) < _ON_FACE * max(spans)])
        )

    def flow(
        self,
        transmissivity: Array,
        *,
        harmonic: bool = False,
        quartered: bool = False,
        bent: float = 0.0,
    ) -> FaceFlow:
        """Solve for the flow.

        Args:
            transmissivity: T along both axes at this rank's points, shape (n, 2) [mm³].
            harmonic: Whether a facet has the harmonic mean over its points, as where T varies along
                the flow, instead of the mean, as where it varies across.
            quartered: Whether every triangle is cut into four, with its transmissivity.
            bent: Part of the way that new nodes on the border of the face then go to a curve.

        Returns:
            The flow, on every rank, with the pressures at the corners of the triangles of all
            ranks.

        Raises:
            NotConverged: When what enters and leaves the nodes does not balance.
        """
        with np.errstate(divide="ignore"):  # closed points close their facet
            values = 1.0 / transmissivity.T if harmonic else transmissivity.T
            values = np.where(self._weight > 0.0, values, 0.0)
            sums = [np.bincount(self._facet, self._weight * one, len(self._area)) for one in values]
            own = np.stack(sums, axis=1) / self._area[:, None]
            own = 1.0 / own if harmonic else own
        whole = np.concatenate(self.comm.allgather(own))[self._triangle_facet]
        if quartered:
            fourfold = np.repeat(whole, 4, axis=0)
            return on_root(self.comm, lambda: self._face.quartered(bent).flow(fourfold))
        return on_root(self.comm, lambda: self._face.flow(whole))

    def leaving_from(self, flow: FaceFlow, count: int) -> Array:
        """Return what leaves the face from each of some regions, shape (count,) [mm³]; collective.

        A facet belongs to the region of its points.

        Args:
            flow: What `flow` returned.
            count: Number of regions.
        """
        patch = np.concatenate(self.comm.allgather(self._patch))[self._triangle_facet]
        return np.asarray(np.bincount(patch, flow.leaving, count), float)

    def pressure(self, flow: FaceFlow, first: float, second: float, name: str = "fluid") -> Any:
        """Return the fluid pressure as a function, linear between the vertices of the mesh.

        Args:
            flow: What `flow` returned.
            first: Pressure at the inlet [MPa].
            second: Pressure at the outlet [MPa].
            name: Name of the function.
        """
        count, corners = len(self._triangle_facet), self._facets.vertices.shape[1]
        at = np.empty((sum(self._counts), corners))
        if corners == 3:
            at[:] = flow.pressure
        else:  # see facet_triangles
            at[:, [0, 2, 1]] = flow.pressure[: count // 2]
            at[:, 3] = flow.pressure[count // 2 :, 0]
        start = sum(self._counts[: self.comm.rank])
        own = at[start : start + len(self._facets.cell)]
        vertices = compat.reference_facets(self._mesh.topology.cell_name())[0]
        shapes = compat.reference_facets(self._mesh.topology.cell_name())[1][self._facets.side]
        wet = ~np.isnan(own)
        weights = np.zeros((*own.shape, len(vertices)))
        np.put_along_axis(weights, shapes[..., None], wet[..., None].astype(float), axis=2)
        values = np.where(wet, second + own * (first - second), 0.0)
        cell = np.repeat(self._facets.cell, corners)
        return vertex_means(
            self._mesh, name, cell, weights.reshape(-1, len(vertices)), values.ravel()
        )


def face_leak(
    face: LeakingFace, transmissivity: Array, viscosity: float, pressures: tuple[float, float]
) -> FaceLeak:
    """Return what leaks over a face; collective.

    Args:
        face: The face.
        transmissivity: T along both axes at this rank's points, shape (n, 2) [mm³].
        viscosity: Dynamic viscosity, > 0 [MPa s].
        pressures: Fluid pressures at inlet and outlet [MPa].

    Raises:
        InputError: When the pressures drive no flow.
        NotConverged: When what enters and leaves the nodes does not balance.
    """
    first, second = map(float, pressures)
    if first == second or not np.isfinite([first, second]).all():
        raise InputError(
            "drives no flow", key="pressures", value=[first, second], allowed="two different ones"
        )
    flow = face.flow(transmissivity)
    return FaceLeak(
        rate=flow.total * (first - second) / (12.0 * viscosity),
        imbalance=flow.imbalance,
        pressure=face.pressure(flow, first, second),
    )
