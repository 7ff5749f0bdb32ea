"""Multigrid on quadratic elements: from all nodes to the vertices, and algebraic from there.

Linear displacements are a part of the quadratic ones, so that the interpolation is exact: a node in
the middle of an edge, a face or a cell takes the mean of its vertices. The matrix of the vertices
is the stiffness of linear elements on the same mesh, which on straight cells is Galerkin's product
without its time and memory. It is seven times smaller, and algebraic multigrid suits linear
elements: on all nodes it took twice the time and four times the memory.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from macro import compat
from macro.linear_solvers.algebraic import algebraic_options
from macro.linear_solvers.node_matrices import for_displacements
from macro.linear_solvers.options import CoarserGrid

Array = NDArray[np.float64]
Indices = NDArray[np.int32]


class Linear(Protocol):
    """A body with linear displacements."""

    @property
    def space(self) -> Any:
        """Vector space of the displacements."""
        ...

    @property
    def stiffness(self) -> PETSc.Mat:
        """Stiffness with unit rows for constrained unknowns, of type ``aij``."""
        ...


_SMOOTHING: Mapping[str, object] = {
    "pc_mg_galerkin": "none",
    "mg_levels_ksp_chebyshev_esteig": "0,0.05,0,1.1",
    "mg_levels_esteig_ksp_max_it": 30,
    "mg_levels_pc_type": "pbjacobi",
    "mg_coarse_ksp_type": "preonly",
}
"""Chebyshev smoothing with the nodes' blocks on all nodes. A third step saved one or two iterations
and Gauss–Seidel three, but both took more time. PETSc's 10 iterations missed 12 % of the largest
eigenvalue of a brake pad, so that the smoother was not definite; 20 found it."""

_FLAT = 4.0
"""Longest over shortest distance of a cell's vertices beyond which it counts as flat or slender."""

_SMOOTHING_FLAT: Mapping[str, object] = {
    "mg_levels_ksp_max_it": 6,
    "mg_levels_ksp_chebyshev_esteig": "0,0.02,0,1.1",
}
"""Smoothing where most cells are flat: 31 iterations instead of 54 to 58 where they are eight times
as long as high. The vertices do not see bending within a cell, which is soft there."""


def quadratic_options(mesh: Any) -> Mapping[str, object]:
    """Return PETSc's options of the two grids of `vertex_grid`.

    Args:
        mesh: dolfinx mesh of tetrahedra or hexahedra.

    Note:
        Collective.
    """
    algebraic = algebraic_options(hexahedral=mesh.topology.cell_name() == "hexahedron")
    flat = _SMOOTHING_FLAT if _mostly_flat(mesh) else {}
    return {**_SMOOTHING, **flat, **{f"mg_coarse_{key}": algebraic[key] for key in algebraic}}


def _mostly_flat(mesh: Any) -> bool:
    """Return whether most cells are flat or slender."""
    vertices = len(compat.lagrange_points(mesh.topology.cell_name(), 1))
    cells = compat.cell_vertices(mesh)[: mesh.topology.index_map(3).size_local, :vertices]
    least, most = np.full(len(cells), np.inf), np.zeros(len(cells))
    for one, other in combinations(range(vertices), 2):
        edge = mesh.geometry.x[cells[:, one]] - mesh.geometry.x[cells[:, other]]
        square = np.einsum("ck,ck->c", edge, edge)
        least, most = np.minimum(least, square), np.maximum(most, square)
    flat = int(np.sum(most > _FLAT**2 * least))
    return bool(2 * mesh.comm.allreduce(flat) > mesh.comm.allreduce(len(cells)))


_ROUNDING = 1e-12
"""Rounding of the linear basis' values."""


def vertex_grid(
    space: Any, linear: Linear, free: PETSc.Vec, springs: PETSc.Mat | None = None
) -> list[CoarserGrid]:
    """Return the one coarser grid of displacements of degree 2: that of the vertices.

    Args:
        space: Vector space of degree 2.
        linear: The same body with linear displacements.
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
