"""Contact area within the facets of a block's top, from pressures and gaps of its nodes.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from macro import compat

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_TINY = 1e-100


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


def covered(touching: NDArray[np.bool_], pressure: Array, gap: Array, length: Array) -> Array:
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
    root = np.sqrt(3.0 * np.maximum(c, _TINY))
    return np.where(open_, 1.0 - 2.0 / root * np.sinh(np.arcsinh(1.5 * root) / 3.0), 1.0)
