"""Flow over a face in one plane, ∇·(T/(12 η) ∇P) = 0, between two of its edges.

Linear elements on triangles with a transmissivity each, along x and along y. They let too much
through, and converge with the square of the size of the triangles.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from micro.flow.potential_flow import factorised
from support.arrays import Array, Flags, Indices
from support.errors import InputError, NotConverged

MOST_IMBALANCE = 1e-8
"""Largest difference of what enters and what leaves, over the flow."""
_SAME = 1e-6
"""Distance of places that count as one, over the mean side of the triangles."""
_LEAST = 1e-9
"""Transmissivity of a triangle along the axis on which it is closed, over that along the other."""
_REFINEMENTS = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TriangleFlow:
    """The flow over a face whose inlet has the pressure 1 and whose outlet has 0.

    Args:
        total: Flow from inlet to outlet; times ΔP/(12 η) it is the flow rate [mm³]. 0 where no open
            triangles join the two.
        pressure: Mean pressure of each triangle, NaN where none of both reaches, shape (n,).
        imbalance: Difference of what enters and what leaves, over the total.
    """

    total: float
    pressure: Array
    imbalance: float = 0.0


class TriangleFace:
    """Triangles of a face and the nodes on its two edges.

    Args:
        corners: Corners of the triangles, shape (n, 3, 2) [mm].
        inlet: Places of the nodes on the inlet, shape (k, 2) [mm]; those beyond the face are left
            out.
        outlet: Places of the nodes on the outlet [mm].

    Raises:
        InputError: When no node of the face lies on one of them, or one lies on both.
    """

    def __init__(self, corners: Array, inlet: Array, outlet: Array) -> None:
        edges = np.roll(corners, -1, axis=1) - corners
        near = _SAME * float(np.linalg.norm(edges, axis=2).mean())
        places = corners.reshape(-1, 2)
        _, first, node = np.unique(
            np.rint(places / near).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        nodes = places[first]
        self._count, self._node = len(nodes), node.reshape(-1, 3)
        self._inlet, self._outlet = (_near(nodes, one, 1e3 * near) for one in (inlet, outlet))
        for name, on_edge in (("inlet", self._inlet), ("outlet", self._outlet)):
            if not on_edge.any():
                raise InputError(f"the {name} has no edge in common with the contact face")
        if (self._inlet & self._outlet).any():
            raise InputError("inlet and outlet touch each other on the contact face")
        # gradients of the three shape functions, turned sides over twice the area
        opposite = np.roll(edges, -1, axis=1)
        twice = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
        self._area = 0.5 * np.abs(twice)
        turned = np.stack([-opposite[..., 1], opposite[..., 0]], axis=2)
        self._gradient = turned / twice[:, None, None]

    def flow(self, transmissivity: Array) -> TriangleFlow:
        """Solve for the flow over the face.

        Args:
            transmissivity: T of the triangles along x and y, 0 where closed, shape (n, 2) [mm³].

        Raises:
            NotConverged: When what enters and what leaves does not balance.
        """
        largest = transmissivity.max(axis=1)
        is_open = largest > 0.0
        used = np.maximum(transmissivity, _LEAST * largest[:, None])
        joined = self._joined(is_open)
        pressure = np.full(self._count, np.nan)
        both = np.intersect1d(joined[self._inlet], joined[self._outlet])
        for on_edge, value in ((self._inlet, 1.0), (self._outlet, 0.0)):
            pressure[np.isin(joined, joined[on_edge]) & self._is_open(is_open)] = value
        if not both.size:
            return TriangleFlow(total=0.0, pressure=self._means(pressure))
        part = is_open & np.isin(joined[self._node[:, 0]], both)
        total, imbalance, found = self._solved(used[part], part)
        pressure[np.isin(joined, both)] = found[np.isin(joined, both)]
        return TriangleFlow(total=total, pressure=self._means(pressure), imbalance=imbalance)

    def _solved(self, transmissivity: Array, part: Flags) -> tuple[float, float, Array]:
        """Return the flow through some triangles, its imbalance, and the pressures of all nodes."""
        matrix, nodes = self._matrix(transmissivity, part), np.unique(self._node[part])
        pressure = np.where(self._inlet, 1.0, 0.0)
        free = nodes[~(self._inlet | self._outlet)[nodes]]
        solve = factorised(matrix[free][:, free]) if free.size else None
        for _ in range(_REFINEMENTS):
            out = matrix @ pressure
            if solve is not None:
                pressure[free] -= solve(out[free])
        out = matrix @ pressure
        entering, leaving = float(out[self._inlet].sum()), -float(out[self._outlet].sum())
        total = 0.5 * (entering + leaving)
        imbalance = abs(entering - leaving) / abs(total) if total else np.inf
        if not (total > 0.0 and imbalance <= MOST_IMBALANCE):
            raise NotConverged(
                "the flow over the contact face",
                reason=f"{imbalance:.1e} of it does not balance, more than {MOST_IMBALANCE:g}",
                iterations=_REFINEMENTS,
                remedy="take a finer mesh of the face, whose transmissivities differ too much",
            )
        return total, imbalance, pressure

    def _matrix(self, transmissivity: Array, part: Flags) -> sparse.csr_matrix:
        """Return the matrix of the flows out of all nodes under their pressures."""
        gradient, node = self._gradient[part], self._node[part]
        weighted = gradient * (self._area[part, None] * transmissivity)[:, None, :]
        entries = np.einsum("nik,njk->nij", weighted, gradient)
        rows, columns = np.repeat(node, 3, axis=1), np.tile(node, (1, 3))
        shape = (self._count, self._count)
        places = rows.ravel(), columns.ravel()
        return sparse.coo_matrix((entries.ravel(), places), shape).tocsr()

    def _joined(self, is_open: Flags) -> Indices:
        """Return a number for each node that those share which open triangles join."""
        node = self._node[is_open]
        tail, head = node.ravel(), np.roll(node, -1, axis=1).ravel()
        shape = (self._count, self._count)
        links = sparse.coo_matrix((np.ones(len(tail)), (tail, head)), shape)
        return np.asarray(csgraph.connected_components(links, directed=False)[1])

    def _is_open(self, is_open: Flags) -> Flags:
        """Return which nodes belong to an open triangle, shape (nodes,)."""
        found = np.zeros(self._count, bool)
        found[self._node[is_open]] = True
        return found

    def _means(self, pressure: Array) -> Array:
        return np.asarray(pressure[self._node].mean(axis=1))


def _near(nodes: Array, places: Array, distance: float) -> Flags:
    """Return which nodes lie at one of some places, shape (n,)."""
    found = np.zeros(len(nodes), bool)
    if len(places):
        found |= np.isfinite(cKDTree(places).query(nodes, distance_upper_bound=distance)[0])
    return found
