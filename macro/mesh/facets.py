"""Cells and corners of facets, and cells that share them, on one rank and across ranks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

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


Ints = NDArray[np.int64]


def parts(mesh: Any) -> list[int]:
    """Return the numbers of cells of the parts of a mesh that share no facets, largest first.

    Args:
        mesh: dolfinx mesh.

    Note:
        Collective. Every rank labels its own cells; the labels are joined over common facets.
    """
    cells = mesh.topology.index_map(3).size_local
    first, second = inner_facets(mesh)[0].T
    graph = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(cells, cells))
    count, label = connected_components(graph, directed=False) if cells else (0, np.empty(0, int))
    facets, cell, _ = facets_between_ranks(mesh)
    counts = mesh.comm.allgather(count)
    label = label + sum(counts[: mesh.comm.rank])
    ends = mesh.comm.allgather((facets, label[cell]))
    facet, of = (np.concatenate([end[k] for end in ends]) for k in (0, 1))
    _, row = np.unique(facet, return_inverse=True)
    size = sum(counts) + (row.max() + 1 if len(row) else 0)
    joined = coo_array((np.ones(len(of)), (of, sum(counts) + row)), shape=(size, size))
    _, part = connected_components(joined, directed=False)
    sizes = np.zeros(size, np.int64)
    np.add.at(sizes, part[label], 1)
    total = mesh.comm.allreduce(sizes)
    return sorted((int(size) for size in total[total > 0]), reverse=True)


def inner_facets(mesh: Any) -> tuple[Ints, Ints]:
    """Return the facets between two cells that this rank owns.

    Args:
        mesh: dolfinx mesh.

    Returns:
        The two cells of every facet and its indices in them, shapes (n, 2).
    """
    facet, cell, side = _sides(mesh)
    inner = np.flatnonzero(facet[1:] == facet[:-1])
    pairs = np.column_stack([inner, inner + 1])
    return cell[pairs], side[pairs]


def facets_between_ranks(mesh: Any) -> tuple[Ints, Ints, Ints]:
    """Return the facets between a cell of this rank and one of another rank.

    Args:
        mesh: dolfinx mesh.

    Returns:
        The facets' global numbers, this rank's cells, and the indices in them, shapes (n,).

    Note:
        Collective.
    """
    facet, cell, side = _sides(mesh)
    single = np.ones(len(facet), dtype=bool)
    single[1:] &= facet[1:] != facet[:-1]
    single[:-1] &= facet[:-1] != facet[1:]
    facet, cell, side = facet[single], cell[single], side[single]
    numbers = mesh.topology.index_map(2)
    known = np.asarray(numbers.local_to_global(facet.astype(np.int32)), dtype=np.int64)
    foreign = known[facet >= numbers.size_local]
    common = np.isin(known, np.concatenate(mesh.comm.allgather(foreign)))
    return known[common], cell[common], side[common]


def outer_sides(mesh: Any) -> tuple[Ints, Ints]:
    """Return the outer facets of the cells that this rank owns.

    Args:
        mesh: dolfinx mesh.

    Returns:
        The cell of every facet and its index there, shapes (n,).

    Note:
        Collective.
    """
    facet, cell, side = _sides(mesh)
    single = np.ones(len(facet), dtype=bool)
    single[1:] &= facet[1:] != facet[:-1]
    single[:-1] &= facet[:-1] != facet[1:]
    _, others, places = facets_between_ranks(mesh)
    sides = len(compat.reference_facets(mesh.topology.cell_name())[1])
    single &= ~np.isin(sides * cell + side, sides * others + places)
    return cell[single], side[single]


def _sides(mesh: Any) -> tuple[Ints, Ints, Ints]:
    """Return the facets of all owned cells by ascending facet, the cells, and the places there."""
    topology = mesh.topology
    topology.create_connectivity(3, 2)
    cells = topology.index_map(3).size_local
    table = topology.connectivity(3, 2)
    facet = table.array[: table.offsets[cells]]
    sides = len(compat.reference_facets(topology.cell_name())[1])
    order = np.argsort(facet, kind="stable")
    return facet[order].astype(np.int64), order // sides, order % sides
