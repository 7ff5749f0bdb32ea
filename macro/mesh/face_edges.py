"""The edges that bound a contact face, and the samples beside them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from macro.mesh.contact_face import ContactFacets
from support.arrays import Array

_SAME = 1e-6
"""Distance of two midpoints of one edge over the edge."""
_ORDER = {3: (0, 1, 2), 4: (0, 1, 3, 2)}  # vertices of a square are numbered row by row


class FaceEdges(NamedTuple):
    """Edges that bound the whole face, on every rank.

    Attributes:
        middle: Their midpoints in the plane, shape (n, 2) [mm].
        length: Their lengths, shape (n,) [mm].
    """

    middle: Array
    length: Array


def outer_edges(facets: ContactFacets, comm: Any) -> FaceEdges:
    """Return the edges of a contact face that only one facet has.

    Args:
        facets: This rank's facets; there may be none.
        comm: MPI communicator of the mesh.

    Note:
        Collective.
    """
    vertices = facets.vertices
    start = vertices[:, list(_ORDER[vertices.shape[1]])]
    end = np.roll(start, -1, axis=1)
    middle = 0.5 * (start + end).reshape(-1, 2)
    length = np.linalg.norm(end - start, axis=2).ravel()
    parts = comm.allgather((middle, length))
    middle, length = (np.concatenate([part[i] for part in parts]) for i in range(2))
    near = cKDTree(middle).query_ball_point(middle, _SAME * length, return_length=True)
    outer = near == 1
    return FaceEdges(middle[outer], length[outer])


def nearest_samples(edges: FaceEdges, x: Array, y: Array, comm: Any) -> list[tuple[Array, float]]:
    """Return this rank's samples that are nearest to every edge.

    Args:
        edges: The edges.
        x: Abscissae of this rank's samples, shape (n,) [mm].
        y: Ordinates, shape (n,) [mm].
        comm: MPI communicator of the mesh.

    Returns:
        For every edge the indices of this rank's samples, and the share of each: 1 over the number
        of samples on all ranks that are as near.

    Note:
        Collective.
    """
    tree, count = cKDTree(np.column_stack([x, y])), len(edges.length)
    own = tree.query(edges.middle)[0] if len(x) else np.full(count, np.inf)
    distance = np.min(comm.allgather(own), axis=0) * (1.0 + _SAME)
    found = tree.query_ball_point(edges.middle, distance) if len(x) else [[]] * count
    number = np.sum(comm.allgather([len(indices) for indices in found]), axis=0)
    return [
        (np.array(indices, np.intp), 1.0 / total)
        for indices, total in zip(found, number, strict=True)
    ]
