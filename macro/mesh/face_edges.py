"""The free edges of a contact face, and the samples beside them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from patchlaw.macro.mesh.contact_face import ContactFacets
from patchlaw.macro.mesh.facets import facet_nodes
from patchlaw.support.arrays import Array

_SAME = 1e-6
"""Distance of two midpoints of one edge over the edge."""
_FLAT = 1e-6
"""Extent of a plane along its normal over its longest side."""
_ORDER = {3: (0, 1, 2), 4: (0, 1, 3, 2)}  # vertices of a square are numbered row by row


class FaceEdges(NamedTuple):
    """Edges that bound a face, on every rank.

    Attributes:
        middle: Their midpoints in the plane, shape (n, 2) [mm].
        length: Their lengths, shape (n,) [mm].
    """

    middle: Array
    length: Array


def free_edges(body: Any, facets: ContactFacets) -> FaceEdges:
    """Return the edges that only one facet of a contact face has, but those on planes of symmetry.

    Args:
        body: The body, whose supports tell planes of symmetry.
        facets: This rank's facets; there may be none.

    Note:
        Collective.
    """
    middle, length = _edges(facets.vertices, body.comm)
    near = cKDTree(middle).query_ball_point(middle, _SAME * length, return_length=True)
    free = near == 1
    for corners in _planes_of_symmetry(body, facets.frame.normal):
        mirrored, _ = _edges(facets.frame.in_plane(corners), body.comm)
        free &= cKDTree(mirrored).query(middle)[0] > _SAME * length
    return FaceEdges(middle[free], length[free])


def _edges(vertices: Array, comm: Any) -> tuple[Array, Array]:
    """Return midpoints and lengths of the edges of all ranks' facets, of shared ones twice."""
    start = vertices[:, list(_ORDER[vertices.shape[1]])]
    end = np.roll(start, -1, axis=1)
    middle = 0.5 * (start + end).reshape(-1, 2)
    length = np.linalg.norm(end - start, axis=2).ravel()
    parts = comm.allgather((middle, length))
    middle, length = (np.concatenate([part[i] for part in parts]) for i in range(2))
    return middle, length


def _planes_of_symmetry(body: Any, normal: Array) -> Iterator[Array]:
    """Yield this rank's facets of the planes that a face is mirrored in, (n, 3 or 4, 3) [mm].

    Supports hold them along their normal alone, which lies in the face.

    Args:
        body: The body.
        normal: Normal of the face, shape (3,).
    """
    tagged = body.mesh
    for support in getattr(body, "supports", ()):
        held = [axis for axis, value in enumerate(support.displacement) if value is not None]
        if len(held) != 1 or abs(normal[held[0]]) > _FLAT:
            continue
        nodes = facet_nodes(tagged.mesh, tagged.facet_tags.find(support.tag))
        corners = tagged.mesh.geometry.x[nodes.corners]
        parts = np.concatenate(body.comm.allgather(corners.reshape(-1, 3)))
        extent = np.ptp(parts, axis=0)
        if extent[held[0]] <= _FLAT * extent.max():
            yield corners


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
