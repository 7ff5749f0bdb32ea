"""Parts of facets in the plane: triangles, straight parts of curved ones, pieces cut by lines."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from patchlaw.geometry import PatchGrid
from patchlaw.macro.mesh.facets import BETWEEN, facet_basis
from patchlaw.support import Array, Flags, Indices


def facet_triangles(corners: Array) -> tuple[Array, Indices]:
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


def _fans(start: Array, along: Array, off: Array, between: Array, chords: Indices) -> Array:
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

    def placed(self, part: Indices, positions: Array, nodes: Array) -> tuple[Array, Array, Array]:
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
        share = map_determinants(nodes, local) * np.linalg.det(map_)[part]
        return local, np.einsum("nm,nmi->ni", values, nodes), np.abs(share)


def map_determinants(nodes: Array, local: Array) -> Array:
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


def divided(nodes: Array) -> tuple[Array, Indices, _CurvedParts | None]:
    """Return triangles of facets, the facet of each, and what they are of facets of second order.

    Args:
        nodes: Nodes of the facets in the plane, shape (m, 3, 4, 6 or 9, 2) [mm].
    """
    if nodes.shape[1] < 5:
        return *facet_triangles(nodes), None
    corners, found = {6: 3, 9: 4}[nodes.shape[1]], []
    number = np.clip(np.ceil(np.sqrt(_bending(nodes) / _OFF)), 1, _PARTS).astype(int)
    for parts in np.union1d(number, 1):
        chosen, unit = np.flatnonzero(number == parts), lattice_triangles(corners, parts)
        values, _ = facet_basis(nodes.shape[1], unit.reshape(-1, 2))
        triangles = np.einsum("km,nmi->nki", values, nodes[chosen]).reshape(-1, 3, 2)
        owner = np.repeat(chosen, len(unit))
        found.append((triangles, owner, np.tile(unit, (len(chosen), 1, 1))))
    triangles, facet, local = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return triangles, facet, _CurvedParts(triangles, local)


def lattice_triangles(count: int, n: int) -> Array:
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


def off_parallel(nodes: Array) -> Flags:
    """Tell which facets have a map to the plane that is not linear, shape (n,).

    Args:
        nodes: Nodes of the facets in the plane, shape (n, 3, 4, 6 or 9, 2) [mm].
    """
    bent = _bending(nodes) > 1e-9
    if nodes.shape[1] in (4, 9):
        twist = nodes[:, 0] - nodes[:, 1] - nodes[:, 2] + nodes[:, 3]
        bent |= np.abs(twist).max(axis=1) > 1e-12 * np.ptp(nodes[:, :4], axis=1).max(axis=1)
    return bent


def cut_into_patches(triangles: Array, facet: Indices, patches: PatchGrid) -> tuple[Array, Indices]:
    """Cut triangles along all borders and keep those inside the patches.

    Args:
        triangles: Corners, shape (n, 3, 2) [mm].
        facet: Facet that each triangle belongs to, shape (n,).
        patches: The patches.
    """
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


def cut_along(
    triangles: Array, part: Indices, others: Array, degree: int, fewer: int
) -> list[tuple[Array, Indices, int]]:
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


def _near(triangles: Array, others: Array) -> tuple[Indices, Indices, Array]:
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
    triangles: Array, facet: Indices, height: Array, slack: float
) -> tuple[Array, Indices]:
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
