"""A digest of all that the stiffness of a meshed body depends on, for keys of the cache.

It is the same for every number of ranks: numbers of cells and supported nodes are mixed and summed.

Theory: section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike, NDArray

from macro import compat
from macro.elastic_body import ElasticBody

Words = NDArray[np.uint64]


def body_digest(body: ElasticBody) -> str:
    """Return a digest of a body's cells, elastic constants, supports and elements.

    Args:
        body: The body.

    Note:
        Collective.
    """
    mesh = body.mesh.mesh
    count = mesh.topology.index_map(3).size_local
    points = _mixed(mesh.geometry.x)
    cells = _mixed(points[compat.cell_vertices(mesh)[:count]])
    constants = np.zeros((count, 2))
    for column, values in enumerate(body.cell_lame):
        constants[:, column] = np.broadcast_to(values, max(count, np.size(values)))[:count]
    total = _sum(_mixed(np.column_stack([cells, constants.view(np.uint64)])))
    places = _mixed(body.space.tabulate_dof_coordinates())
    for condition in body.conditions:
        dofs = condition.dof_indices()[0]
        dofs = dofs[dofs < body.owned_dofs]
        held = np.column_stack([places[dofs // 3], (dofs % 3).astype(np.uint64)])
        total = total + _sum(_mixed(held))
    found = np.zeros_like(total)
    body.comm.Allreduce(total, found, op=MPI.SUM)
    return f"{int(found[0]):016x}-{body.hexahedral}-{body.degree}-{body.dofs}"


def _sum(words: Words) -> Words:
    """Return the sum modulo 2⁶⁴, shape (1,)."""
    return words.sum(dtype=np.uint64, keepdims=True)


def _mixed(rows: ArrayLike) -> Words:
    """Return a word for each row of numbers, which depends on all bits of all of them.

    Steele, Lea & Flood 2014, doi 10.1145/2660193.2660195: the finaliser of SplitMix64.
    """
    rows = np.ascontiguousarray(rows)
    words = (rows + 0.0).view(np.uint64) if rows.dtype == np.float64 else rows  # no −0
    found = np.full(len(words), 0x9E3779B97F4A7C15, dtype=np.uint64)
    for column in range(words.shape[1]):
        found = found * np.uint64(0xD1342543DE82EF95) + words[:, column]
        found = (found ^ (found >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        found = (found ^ (found >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        found = found ^ (found >> np.uint64(31))
    return found
