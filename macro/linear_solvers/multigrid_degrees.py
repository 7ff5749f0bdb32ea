"""Multigrid on quadratic tetrahedra: from all nodes to the vertices, and algebraic from there.

Linear displacements are quadratic ones, so that the transfer is exact: the middle of an edge takes
the mean of its ends. Galerkin's product makes the matrix of the vertices, on curved cells too; it
is seven times smaller, and smoothed aggregation is made for its like. On all nodes that takes ten
times as long to set up, and twice as long to solve.
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
from macro.elasticity import rigid_body_modes_at
from macro.linear_solvers.multigrid import for_displacements
from macro.linear_solvers.options import (
    ALGEBRAIC_DEFAULTS,
    KRYLOV_DEFAULTS,
    PREFIX,
    default_options,
)

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

DEFAULTS: Mapping[str, object] = {
    "pc_type": "mg",
    "pc_mg_galerkin": "none",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_esteig_ksp_type": "cg",
    "mg_levels_ksp_chebyshev_esteig": "0,0.05,0,1.05",
    "mg_levels_pc_type": "pbjacobi",
    "mg_coarse_ksp_type": "preonly",
} | {f"mg_coarse_{name}": value for name, value in ALGEBRAIC_DEFAULTS.items()}
"""Chebyshev on nodes' blocks above, smoothed aggregation below. A third step above takes one or
two iterations fewer, Gauss–Seidel three, but both more time; a coarse matrix that is factorised two
fewer in the same time, and more memory."""


def two_degree_solver(
    matrix: PETSc.Mat, space: Any, free: PETSc.Vec, prefix: str = PREFIX
) -> PETSc.KSP:
    """Return a solver for displacements of degree 2 on tetrahedra, its preconditioner set up.

    Args:
        matrix: Stiffness, symmetric positive definite, with unit rows for held unknowns.
        space: Its space.
        free: 1 for unknowns that are free, 0 for those that are held.
        prefix: Prefix of its PETSc options.

    Note:
        Collective.
    """
    transfer, points = vertex_transfer(space, free)
    coarse = matrix.ptap(transfer)
    coarse.setOption(PETSc.Mat.Option.SPD, True)
    coarse.setNearNullSpace(rigid_body_modes_at(points, matrix.comm))
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOptionsPrefix(prefix)
    solver.setOperators(matrix)
    solver.pc.setType("mg")
    solver.pc.setMGLevels(2)
    solver.pc.setMGInterpolation(1, transfer)
    with default_options(prefix, {**KRYLOV_DEFAULTS, **DEFAULTS}):
        solver.setFromOptions()
        solver.pc.getMGCoarseSolve().setOperators(coarse)
        solver.setUp()
    return solver


def vertex_transfer(space: Any, free: PETSc.Vec) -> tuple[PETSc.Mat, Array]:
    """Return the interpolation from the vertices to all nodes, held unknowns apart.

    Args:
        space: Vector space of degree 2 on tetrahedra.
        free: 1 for unknowns that are free, 0 for those that are held.

    Returns:
        The matrix, and the coordinates of the vertices that this rank owns, shape (n, 3) [mm].

    Note:
        Collective.
    """
    owned = space.dofmap.index_map.size_local
    ends = _ends(space)
    stay = np.flatnonzero(ends[:owned, 0] == ends[:owned, 1])
    numbers, total = _numbers(space, stay)
    columns = numbers[ends[:owned]].ravel()
    weights = sparse.csr_matrix(
        (np.full(2 * owned, 0.5), columns, np.arange(0, 2 * owned + 1, 2)), (owned, total)
    )
    weights.sum_duplicates()  # a vertex is both ends of itself
    matrix, _ = for_displacements(weights, stay, free, blocks=True)
    return matrix, space.tabulate_dof_coordinates()[stay]


def _ends(space: Any) -> Indices:
    """Return the two vertices between which each node of this rank's cells lies, shape (n, 2)."""
    cell, nodes = space.mesh.topology.cell_name(), space.dofmap.index_map
    shares = np.rint(2.0 * compat.lagrange_values(cell, 1, compat.lagrange_points(cell, 2)))
    vertices = np.argmax(shares, axis=0)  # among the nodes of a cell
    first, last = np.argmax(shares > 0.0, axis=1), 3 - np.argmax(shares[:, ::-1] > 0.0, axis=1)
    found = np.zeros((nodes.size_local + nodes.num_ghosts, 2), dtype=np.intp)
    cells = compat.cell_nodes(space)
    found[cells] = cells[:, vertices[np.stack([first, last], axis=1)]]
    return found


def _numbers(space: Any, stay: Indices) -> tuple[Indices, int]:
    """Number the vertices, rank after rank; ghosts' numbers come from their owners.

    Returns:
        The number of each node of this rank and its ghosts, nonsense where it is no vertex, and how
        many there are.
    """
    comm = space.mesh.comm
    counts = comm.allgather(len(stay))
    named = fem.Function(space)
    named.x.array[3 * stay] = sum(counts[: comm.rank]) + np.arange(len(stay))
    named.x.scatter_forward()
    return np.rint(named.x.array[::3]).astype(np.intp), sum(counts)
