"""Multigrid on quadratic tetrahedra: from all nodes to the vertices, and algebraic from there.

Linear displacements are a part of the quadratic ones, so that the interpolation is exact: the node
in the middle of an edge takes the mean of the edge's ends. Galerkin's product makes the matrix of
the vertices, also on curved cells. It is seven times smaller, and smoothed aggregation suits linear
elements: on all nodes its set-up took ten times as long, and the solve twice as long.

Theory: section 11 of ``demos/theory.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from macro import compat
from macro.elasticity import rigid_body_modes
from macro.linear_solvers.node_matrices import for_displacements
from macro.linear_solvers.options import ALGEBRAIC_DEFAULTS, CoarserGrid

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

QUADRATIC_DEFAULTS: Mapping[str, object] = {
    "pc_mg_galerkin": "none",
    "mg_levels_ksp_chebyshev_esteig": "0,0.05,0,1.05",
    "mg_levels_pc_type": "pbjacobi",
    "mg_coarse_ksp_type": "preonly",
} | {f"mg_coarse_{name}": value for name, value in ALGEBRAIC_DEFAULTS.items()}
"""Chebyshev smoothing with the nodes' blocks on all nodes, smoothed aggregation on the vertices. A
third smoothing step saved one or two iterations and Gauss–Seidel three, but both took more time; a
factorised coarse matrix saved two in the same time, and took more memory."""


def vertex_grid(matrix: PETSc.Mat, space: Any, free: PETSc.Vec) -> list[CoarserGrid]:
    """Return the one coarser grid of displacements of degree 2: that of the vertices.

    Args:
        matrix: Stiffness, symmetric positive definite, with unit rows for constrained unknowns.
        space: Vector space of degree 2 on tetrahedra.
        free: 1 for unknowns that are free, 0 for constrained ones.

    Note:
        Collective.
    """
    transfer, points = vertex_transfer(space, free)
    coarse = matrix.ptap(transfer)
    coarse.setOption(PETSc.Mat.Option.SPD, True)
    coarse.setNearNullSpace(rigid_body_modes(points, matrix.comm))
    return [CoarserGrid(transfer, coarse)]


def vertex_transfer(space: Any, free: PETSc.Vec) -> tuple[PETSc.Mat, Array]:
    """Return the interpolation from the vertices to all nodes, constrained unknowns apart.

    Args:
        space: Vector space of degree 2 on tetrahedra.
        free: 1 for unknowns that are free, 0 for constrained ones.

    Returns:
        The matrix, and the coordinates of the vertices that this rank owns, shape (n, 3) [mm].

    Note:
        Collective.
    """
    owned = space.dofmap.index_map.size_local
    ends = _edge_ends(space)[:owned]
    vertices = np.flatnonzero(ends[:, 0] == ends[:, 1])
    numbers, total = _vertex_numbers(space, vertices)
    weights = sparse.csr_matrix(
        (np.full(2 * owned, 0.5), numbers[ends].ravel(), np.arange(0, 2 * owned + 1, 2)),
        (owned, total),
    )
    weights.sum_duplicates()  # a vertex is both ends of itself
    matrix, _ = for_displacements(weights, vertices, free, blocks=True)
    return matrix, space.tabulate_dof_coordinates()[vertices]


def _edge_ends(space: Any) -> Indices:
    """Return the two vertices between which each node of this rank's cells lies, shape (n, 2)."""
    cell, nodes = space.mesh.topology.cell_name(), space.dofmap.index_map
    shares = np.rint(2.0 * compat.lagrange_values(cell, 1, compat.lagrange_points(cell, 2)))
    vertices = np.argmax(shares, axis=0)  # among the nodes of a cell
    first, last = np.argmax(shares > 0.0, axis=1), 3 - np.argmax(shares[:, ::-1] > 0.0, axis=1)
    ends = np.zeros((nodes.size_local + nodes.num_ghosts, 2), dtype=np.intp)
    cells = compat.cell_nodes(space)
    ends[cells] = cells[:, vertices[np.stack([first, last], axis=1)]]
    return ends


def _vertex_numbers(space: Any, vertices: Indices) -> tuple[Indices, int]:
    """Number the vertices rank after rank; the numbers of ghosts come from their owners.

    Returns:
        The number of each node of this rank and its ghosts, meaningless where it is no vertex, and
        the number of vertices of all ranks.
    """
    comm = space.mesh.comm
    counts = comm.allgather(len(vertices))
    numbers = fem.Function(space)
    numbers.x.array[3 * vertices] = sum(counts[: comm.rank]) + np.arange(len(vertices))
    numbers.x.scatter_forward()
    return np.rint(numbers.x.array[::3]).astype(np.intp), sum(counts)
