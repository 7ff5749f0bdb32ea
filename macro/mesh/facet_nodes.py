"""Cells and corners of facets on one rank."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from macro import compat
from support.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class FacetNodes:
    """Facets with a cell of each: the only one of outer facets.

    Attributes:
        cell: Rank-local cells, shape (n,).
        side: Indices of the facets in them, shape (n,).
        corners: Rows of ``mesh.geometry.x``, shape (n, 3 or 4); those of a quadrilateral as a
            tensor product, 0 and 3 being opposite.
    """

    cell: NDArray[np.int32]
    side: NDArray[np.intp]
    corners: NDArray[np.int32]


def facet_indices(mesh: Any, facets: Any) -> NDArray[np.int32]:
    """Return facets that a user gives, as indices.

    Args:
        mesh: dolfinx mesh with facets.
        facets: Numbers of this rank's facets, or a mask of all of them, shape (n,).

    Raises:
        InputError: When there are no such facets.
    """
    numbers = mesh.topology.index_map(2)
    count = numbers.size_local + numbers.num_ghosts
    allowed = f"this rank's facets, 0 … {count - 1}, or a mask of all {count}"
    given = np.atleast_1d(np.asarray(facets))
    if given.dtype == np.bool_:
        if given.shape != (count,):
            raise InputError("the mask does not fit the facets", value=given.shape, allowed=allowed)
        return np.flatnonzero(given).astype(np.int32)
    if given.size and given.dtype.kind not in "iu":
        raise InputError("facets are no numbers", value=facets, allowed=allowed)
    absent = given[(given < 0) | (given >= count)]
    if absent.size:
        raise InputError("the facets are not in the mesh", value=int(absent[0]), allowed=allowed)
    return given.astype(np.int32)


def facet_nodes(mesh: Any, facets: NDArray[np.int32]) -> FacetNodes:
    """Return cells and corners of facets.

    Args:
        mesh: dolfinx mesh of straight cells.
        facets: Rank-local facets, shape (n,); there may be none.
    """
    topology = mesh.topology
    topology.create_connectivity(2, 3)
    topology.create_connectivity(3, 2)
    cells_of, facets_of = topology.connectivity(2, 3), topology.connectivity(3, 2)
    _, shapes = compat.reference_facets(topology.cell_name())
    cell = cells_of.array[cells_of.offsets[facets]]
    sides = facets_of.array.reshape(-1, len(shapes))[cell]
    side = np.argmax(sides == np.asarray(facets)[:, None], axis=1)
    corners = np.take_along_axis(compat.cell_vertices(mesh)[cell], shapes[side], axis=1)
    return FacetNodes(cell=cell, side=side, corners=corners)
