"""Quadrature on outer facets of any mesh: places, outward normals, basis functions.

Facets may be warped; integrals over them are those of the mapped reference facet.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from numpy.polynomial import legendre
from numpy.typing import NDArray

from macro import compat

Array = NDArray[np.float64]
Facets = NDArray[np.int32]

_GEOMETRY = {4: 1, 10: 2, 8: 1, 27: 2}
"""Degree of a cell's shape by the number of its nodes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OuterQuadrature:
    """Quadrature points of this rank on outer facets; there may be none.

    Args:
        points: Places, shape (n, 3) [mm].
        normals: Outward unit normals, shape (n, 3).
        weights: Weights, whose sum over all ranks is the facets' area, shape (n,) [mm²].
        nodes: Rank-local nodes of the cell of every point, shape (n, m).
        values: Basis functions of these nodes, shape (n, m).
    """

    points: Array
    normals: Array
    weights: Array
    nodes: NDArray[np.int32]
    values: Array


def outer_facets(mesh: Any) -> Facets:
    """Return the outer facets whose cells this rank owns, ascending.

    Note:
        Collective.
    """
    mesh.topology.create_connectivity(2, 3)
    facets = np.sort(dmesh.exterior_facet_indices(mesh.topology)).astype(np.int32)
    cells = _cells_of(mesh, facets)
    return facets[cells < mesh.topology.index_map(3).size_local]


def outer_quadrature(space: Any, degree: int, facets: Facets, exact: int) -> OuterQuadrature:
    """Place quadrature points on outer facets.

    Args:
        space: Lagrange space of the displacements.
        degree: Its polynomial degree.
        facets: Rank-local outer facets whose cells this rank owns, shape (f,).
        exact: Polynomial degree on the reference facet that is integrated exactly.
    """
    mesh = space.mesh
    name = mesh.topology.cell_name()
    vertices, shapes = compat.reference_facets(name)
    cells = _cells_of(mesh, facets)
    mesh.topology.create_connectivity(3, 2)
    mates = mesh.topology.connectivity(3, 2).array.reshape(-1, len(shapes))[cells]
    sides = np.argmax(mates == facets[:, None], axis=1)
    shape_nodes, nodes = compat.cell_vertices(mesh), compat.cell_nodes(space)
    geometry = _GEOMETRY[shape_nodes.shape[1]]
    rule, weights = _facet_rule(shapes.shape[1], exact)
    middle = vertices.mean(axis=0)
    parts = []
    for side, corners in enumerate(shapes):
        members = cells[sides == side]
        corner, *ends = vertices[corners[:3]]
        tangents = np.array(ends) - corner
        reference = corner + rule @ tangents
        places = mesh.geometry.x[shape_nodes[members]]
        values = compat.lagrange_values(name, geometry, reference)
        slopes = compat.lagrange_gradients(name, geometry, reference)
        points = np.einsum("qa,caj->cqj", values, places)
        maps = np.einsum("qak,tk,caj->cqtj", slopes, tangents, places)
        areas = np.cross(maps[:, :, 0], maps[:, :, 1])
        areas *= np.sign(np.dot(np.cross(*tangents), corner - middle)) * _handed(
            name, geometry, places
        )
        basis = compat.lagrange_values(name, degree, reference)
        count = len(members), len(rule)
        parts.append(
            (
                points.reshape(-1, 3),
                (areas * weights[:, None]).reshape(-1, 3),
                np.repeat(nodes[members], count[1], axis=0),
                np.tile(basis, (count[0], 1)),
            )
        )
    points, areas, cell_nodes, basis = (np.concatenate(part) for part in zip(*parts, strict=True))
    sizes = np.linalg.norm(areas, axis=1)
    return OuterQuadrature(
        points=points,
        normals=areas / np.where(sizes > 0.0, sizes, 1.0)[:, None],
        weights=sizes,
        nodes=cell_nodes,
        values=basis,
    )


def _cells_of(mesh: Any, facets: Facets) -> NDArray[np.int32]:
    """Return the one cell of every outer facet."""
    mesh.topology.create_connectivity(2, 3)
    cells = mesh.topology.connectivity(2, 3)
    return np.asarray(cells.array[cells.offsets[facets]])


def _handed(name: str, geometry: int, places: Array) -> Array:
    """Return 1 for cells that are mapped from the reference cell without a mirror, else −1."""
    slopes = compat.lagrange_gradients(name, geometry, np.full((1, 3), 0.25))[0]
    return np.sign(np.linalg.det(np.einsum("ak,caj->ckj", slopes, places)))[:, None, None]


def _facet_rule(corners: int, exact: int) -> tuple[Array, Array]:
    """Return points (q, 2) and weights of the unit triangle or square."""
    if corners == 3:
        return compat.triangle_rule(exact)
    nodes, weights = legendre.leggauss(exact // 2 + 1)
    nodes, weights = 0.5 * (1.0 + nodes), 0.5 * weights
    x, y = np.meshgrid(nodes, nodes, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel()]), np.outer(weights, weights).ravel()
