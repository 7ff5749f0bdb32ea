"""Quadrature on the outer facets of any mesh: places, outward normals, basis functions.

Facets may be warped; integrals over them are those of the mapped reference facet.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from macro import compat
from macro.mesh.facets import outer_sides

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class OuterFacets:
    """Outer facets of the cells that this rank owns, and q quadrature points on each.

    Args:
        cell: Rank-local cell of every facet, shape (f,).
        side: Index of the facet in its cell, shape (f,).
        points: Places, shape (f, q, 3) [mm].
        normals: Outward unit normals, shape (f, q, 3).
        weights: Weights, whose sum over all ranks is the area of the body, shape (f, q) [mm²].
        nodes: Rank-local nodes of the cells, shape (f, m).
        values: Basis functions of these nodes by the side of the cell, shape (sides, q, m).
    """

    cell: NDArray[np.int64]
    side: NDArray[np.int64]
    points: Array
    normals: Array
    weights: Array
    nodes: NDArray[np.int32]
    values: Array

    @property
    def on_facet(self) -> NDArray[np.bool_]:
        """Which of the nodes lie on the facet, shape (f, m)."""
        return (np.abs(self.values).max(axis=1) > 1e-9)[self.side]

    def among(self, chosen: NDArray[np.bool_]) -> OuterFacets:
        """Return some of the facets, shape of the choice (f,)."""
        return OuterFacets(
            cell=self.cell[chosen],
            side=self.side[chosen],
            points=self.points[chosen],
            normals=self.normals[chosen],
            weights=self.weights[chosen],
            nodes=self.nodes[chosen],
            values=self.values,
        )


def outer_facets(space: Any, exact: int) -> OuterFacets:
    """Place quadrature points on the outer facets of this rank's cells; there may be none.

    Args:
        space: Lagrange space of the displacements.
        exact: Polynomial degree on the reference facet that is integrated exactly.

    Note:
        Collective.
    """
    mesh = space.mesh
    name, degree = mesh.topology.cell_name(), compat.lagrange_degree(space)
    vertices, corners = compat.reference_facets(name)
    cell, side = outer_sides(mesh)
    shape_nodes = compat.cell_vertices(mesh)[cell]
    shape = compat.geometry_degree(mesh)
    rule, weights = _facet_rule(corners.shape[1], exact)
    first = vertices[corners[:, 0]]
    tangents = vertices[corners[:, 1:3]] - first[:, None]  # (sides, 2, 3)
    reference = first[:, None] + rule @ tangents
    flat = reference.reshape(-1, 3)
    by_side = (len(corners), len(rule))
    values, basis = (
        compat.lagrange_values(name, of, flat).reshape(*by_side, -1) for of in (shape, degree)
    )
    slopes = compat.lagrange_gradients(name, shape, flat).reshape(*by_side, -1, 3)
    outwards = np.cross(*tangents.transpose(1, 0, 2))
    outwards = np.sign(np.einsum("si,si->s", outwards, first - vertices.mean(axis=0)))
    places = mesh.geometry.x[shape_nodes]
    maps = np.einsum("fqak,faj->fqkj", slopes[side], places)  # ∂x_j/∂X_k
    along = np.einsum("ftk,fqkj->fqtj", tangents[side], maps)
    areas = np.cross(along[:, :, 0], along[:, :, 1]) * np.sign(np.linalg.det(maps))[..., None]
    areas *= outwards[side, None, None]
    sizes = np.linalg.norm(areas, axis=2)
    return OuterFacets(
        cell=cell,
        side=side,
        points=np.einsum("fqa,faj->fqj", values[side], places),
        normals=areas / sizes[..., None],
        weights=sizes * weights,
        nodes=compat.cell_nodes(space)[cell],
        values=basis,
    )


def _facet_rule(corners: int, exact: int) -> tuple[Array, Array]:
    """Return points (q, 2) and weights of the unit triangle or square."""
    if corners == 3:
        return compat.triangle_rule(exact)
    nodes, weights = legendre.leggauss(exact // 2 + 1)
    nodes, weights = 0.5 * (1.0 + nodes), 0.5 * weights
    x, y = np.meshgrid(nodes, nodes, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel()]), np.outer(weights, weights).ravel()
