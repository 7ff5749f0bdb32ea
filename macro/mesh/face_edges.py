"""The edges that bound a contact face."""

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
    """Edges of this rank's facets that bound the whole face.

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
    every = np.concatenate(comm.allgather(middle))
    if not len(middle):
        return FaceEdges(middle, length)
    near = cKDTree(every).query_ball_point(middle, _SAME * length, return_length=True)
    outer = near == 1
    return FaceEdges(middle[outer], length[outer])
