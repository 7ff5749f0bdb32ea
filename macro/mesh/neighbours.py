"""Cells that share facets, on one rank and across ranks."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from macro import compat

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
