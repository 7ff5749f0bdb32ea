"""Multigrid on quadratic elements: from all nodes to the vertices, and algebraic from there.

Linear displacements are a part of the quadratic ones, so that the interpolation is exact: a node in
the middle of an edge, a face or a cell takes the mean of its vertices. The matrix of the vertices
is the stiffness of linear elements on the same mesh, which on straight cells is Galerkin's product
without its time and memory. It is seven times smaller, and algebraic multigrid suits linear
elements: on all nodes it took twice the time and four times the memory.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from macro import compat
from macro.linear_solvers.node_matrices import for_displacements
from macro.linear_solvers.options import CoarserGrid

Array = NDArray[np.float64]
Indices = NDArray[np.int32]


_ROUNDING = 1e-12
"""Rounding of the linear basis' values."""


def vertex_grid(
    space: Any, linear: Any, free: PETSc.Vec, springs: PETSc.Mat | None = None
) -> list[CoarserGrid]:
    """Return the one coarser grid of displacements of degree 2: that of the vertices.

    Args:
        space: Vector space of degree 2.
        linear: The same body with linear displacements, its stiffness of type ``aij``.
        free: 1 for unknowns that are free, 0 for constrained ones.
        springs: Stiffness besides that of the body, such as that of contact laws.

    Note:
        Collective.
    """
    transfer, matrix = vertex_transfer(space, linear.space, free), linear.stiffness
    if springs is not None:
        matrix, modes = matrix.copy(), matrix.getNearNullSpace()
        there = springs.ptap(transfer)
        matrix.axpy(1.0, there, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        matrix.setNearNullSpace(modes)
        there.destroy()
    return [CoarserGrid(transfer, matrix)]


def vertex_transfer(space: Any, linear: Any, free: PETSc.Vec) -> PETSc.Mat:
    """Return the interpolation from the vertices to all nodes, constrained unknowns apart.

    Args:
        space: Vector space of degree 2.
        linear: That of degree 1 on the same mesh, whose nodes the vertices are.
        free: 1 for unknowns that are free, 0 for constrained ones.

    Note:
        Collective.
    """
    owned, vertices = (of.dofmap.index_map.size_local for of in (space, linear))
    near, shares = (part[:owned] for part in _vertices_near(space, linear))
    used = shares > 0.0
    starts = np.concatenate([[0], np.cumsum(used.sum(axis=1))])
    numbers = linear.dofmap.index_map.local_to_global(near[used].astype(np.int32))
    total = linear.dofmap.index_map.size_global
    weights = sparse.csr_matrix((shares[used], numbers, starts), (owned, total))
    weights.sort_indices()
    own = np.flatnonzero(shares.max(axis=1) == 1.0)  # both spaces own a vertex on the same rank
    stay = np.empty(vertices, dtype=np.intp)
    stay[near[own, shares[own].argmax(axis=1)]] = own
    matrix, _ = for_displacements(weights, stay, free, blocks=True)
    return matrix


def _vertices_near(space: Any, linear: Any) -> tuple[Indices, Array]:
    """Return the vertices of a cell of every node, and their shares in the node.

    Returns:
        Nodes of the linear space that are the vertices, and the values there of its basis, shape
        (n, vertices of a cell), for the nodes of this rank's cells.
    """
    cell, nodes = space.mesh.topology.cell_name(), space.dofmap.index_map
    values = compat.lagrange_values(cell, 1, compat.lagrange_points(cell, 2))
    values[np.abs(values) < _ROUNDING] = 0.0
    values[np.abs(values - 1.0) < _ROUNDING] = 1.0
    cells = compat.cell_nodes(space)
    found = np.zeros((2, nodes.size_local + nodes.num_ghosts), dtype=np.int32)
    found[:, cells] = np.indices(cells.shape, dtype=np.int32)  # a cell of every node, and its place
    return compat.cell_nodes(linear)[found[0]], values[found[1]]
