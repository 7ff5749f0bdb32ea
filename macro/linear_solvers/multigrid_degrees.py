"""Multigrid on quadratic elements: from all nodes to the vertices, and algebraic from there.

Linear displacements are a part of the quadratic ones, so that the interpolation is exact: a node in
the middle of an edge, a face or a cell takes the mean of its vertices. Galerkin's product makes the
matrix of the vertices, also on curved cells. It is seven times smaller, and algebraic multigrid
suits linear elements: on all nodes it took twice the time and four times the memory.

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
from macro.linear_solvers.algebraic import algebraic_options
from macro.linear_solvers.node_matrices import for_displacements
from macro.linear_solvers.options import CoarserGrid

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_SMOOTHING: Mapping[str, object] = {
    "pc_mg_galerkin": "none",
    "mg_levels_ksp_chebyshev_esteig": "0,0.05,0,1.05",
    "mg_levels_pc_type": "pbjacobi",
    "mg_coarse_ksp_type": "preonly",
}
"""Chebyshev smoothing with the nodes' blocks on all nodes. A third step saved one or two iterations
and Gauss–Seidel three, but both took more time."""

_HEXAHEDRAL_STEPS = 4
"""Smoothing steps on hexahedra, whose cells can be flat: 39 iterations instead of 54 where they are
eight times as long as high, in the same time."""


_ROUNDING = 1e-12
"""Rounding of the linear basis' values."""


def quadratic_options(*, hexahedral: bool) -> Mapping[str, object]:
    """Return PETSc's options of the two grids of `vertex_grid`.

    Args:
        hexahedral: Whether the cells are hexahedra.
    """
    algebraic = algebraic_options(hexahedral=hexahedral)
    steps = {"mg_levels_ksp_max_it": _HEXAHEDRAL_STEPS} if hexahedral else {}
    return {**_SMOOTHING, **steps, **{f"mg_coarse_{key}": algebraic[key] for key in algebraic}}


def vertex_grid(matrix: PETSc.Mat, space: Any, free: PETSc.Vec) -> list[CoarserGrid]:
    """Return the one coarser grid of displacements of degree 2: that of the vertices.

    Args:
        matrix: Stiffness, symmetric positive definite, with unit rows for constrained unknowns.
        space: Vector space of degree 2.
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
        space: Vector space of degree 2.
        free: 1 for unknowns that are free, 0 for constrained ones.

    Returns:
        The matrix, and the coordinates of the vertices that this rank owns, shape (n, 3) [mm].

    Note:
        Collective.
    """
    owned = space.dofmap.index_map.size_local
    near, shares = _vertices_near(space)
    near, shares = near[:owned], shares[:owned]
    vertices = np.flatnonzero(shares.max(axis=1) == 1.0)
    numbers, total = _vertex_numbers(space, vertices)
    used = shares > 0.0
    starts = np.concatenate([[0], np.cumsum(used.sum(axis=1))])
    weights = sparse.csr_matrix((shares[used], numbers[near[used]], starts), (owned, total))
    weights.sort_indices()
    matrix, _ = for_displacements(weights, vertices, free, blocks=True)
    return matrix, space.tabulate_dof_coordinates()[vertices]


def _vertices_near(space: Any) -> tuple[Indices, Array]:
    """Return the vertices of a cell of every node, and their shares in the node.

    Returns:
        Nodes that are the vertices, and the values there of the linear basis, shape (n, vertices of
        a cell), for the nodes of this rank's cells.
    """
    cell, nodes = space.mesh.topology.cell_name(), space.dofmap.index_map
    values = compat.lagrange_values(cell, 1, compat.lagrange_points(cell, 2))
    values[np.abs(values) < _ROUNDING] = 0.0
    values[np.abs(values - 1.0) < _ROUNDING] = 1.0
    cells = compat.cell_nodes(space)
    found = np.zeros((2, nodes.size_local + nodes.num_ghosts), dtype=np.intp)
    found[:, cells] = np.indices(cells.shape)  # a cell of every node, and its place there
    vertices = np.argmax(values, axis=0)
    return cells[found[0][:, None], vertices], values[found[1]]


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
