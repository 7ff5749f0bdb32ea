"""Geometric multigrid on blocks whose nodes form a rectangular lattice: the transfers.

Grids coarsen where the planes of the lattice are close (see `coarsenings`). Displacements are
interpolated trilinearly in the flat lattice, also on rough blocks, and the coarser matrices are
Galerkin's products of the true matrix. A coarse node is one of the finer grid's nodes, and lives on
the same rank.

Theory: section 11 of ``demos/theory.md``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from geometry.meshes.block import BlockShape
from macro import compat
from macro.linear_solvers.multigrid_grids import Kept, Lines, coarsenings
from macro.linear_solvers.multigrid_products import galerkin
from macro.linear_solvers.options import CoarserGrid
from macro.mesh.block import BlockMesh

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_CORNERS = np.indices((2, 2, 2)).reshape(3, 8).T


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """The rectangular lattice that the nodes of a space form.

    Args:
        grid: The planes across x, y and z.
        nodes: Indices of the planes that meet at each of this rank's nodes, shape (n, 3).
    """

    grid: Sequence[Lines]
    nodes: Indices


@dataclass(frozen=True, slots=True, eq=False)
class Transfer:
    """From a grid to the next finer one.

    Args:
        weights: Interpolation of nodes from coarse nodes.
        interpolation: Interpolation of unknowns from coarse unknowns, constrained ones apart.
        free: 1 for unknowns of the finer grid that are free, 0 for constrained ones.
        coarse_free: The same for the coarser grid.
    """

    weights: PETSc.Mat
    interpolation: PETSc.Mat
    free: PETSc.Vec
    coarse_free: PETSc.Vec


def lattice_of(space: Any, mesh: BlockMesh) -> Lattice | None:
    """Return the lattice of a Lagrange space's nodes, or None where the mesh has none.

    Args:
        space: Space of degree 1 or 2 on the mesh.
        mesh: The block's mesh; its nodes may have moved.
    """
    shape = mesh.shape
    if mesh.planes is None or not isinstance(shape, BlockShape):
        return None
    degree, cell = shape.degree, mesh.mesh.topology.cell_name()
    corners = compat.lagrange_values(cell, 1, compat.lagrange_points(cell, degree))
    places = np.einsum(
        "nv,cvk->cnk", degree * corners, mesh.planes[compat.cell_vertices(mesh.mesh)]
    )
    nodes = space.dofmap.index_map
    found = np.zeros((nodes.size_local + nodes.num_ghosts, 3), dtype=np.intp)
    found[compat.cell_nodes(space)] = np.rint(places)
    grid = [Lines.of_elements(ticks, degree) for ticks in shape.ticks]
    return Lattice(grid, found[: nodes.size_local])


def coarser_grids(lattice: Lattice, matrix: PETSc.Mat, free: PETSc.Vec) -> list[CoarserGrid]:
    """Return the interpolations and matrices of every grid but the finest, finest grid first.

    Args:
        lattice: Nodes of the finest grid.
        matrix: Its matrix, of PETSc's type ``baij``, with unit rows and columns where
            constrained.
        free: 1 for unknowns that are free, 0 for constrained ones.

    Note:
        Collective.
    """
    found = []
    for step in transfers(lattice, free):
        matrix = galerkin(matrix, step.weights, step.free, step.coarse_free)
        step.weights.destroy()  # PETSc would keep what several ranks drop
        found.append(CoarserGrid(step.interpolation, matrix))
    return found


def transfers(lattice: Lattice, free: PETSc.Vec) -> Iterator[Transfer]:
    """Yield the transfers from every grid but the finest to the next finer one.

    Constrained unknowns are separate on every grid: they neither contribute to others nor take
    from others, and every coarser matrix has unit rows for them.

    Args:
        lattice: Nodes of the finest grid.
        free: 1 for unknowns that are free, 0 for constrained ones.

    Yields:
        Finest grid first.

    Note:
        Collective.
    """
    grid, nodes = lattice.grid, lattice.nodes
    for kept in coarsenings(grid):
        rows, stay = _node_weights(grid, kept, nodes, free.comm)
        weights = _distributed(rows, len(stay), free.comm)
        interpolation, coarse = for_displacements(rows, stay, free)
        yield Transfer(weights, interpolation, free, coarse)
        nodes = np.stack([np.searchsorted(of, nodes[stay, k]) for k, of in enumerate(kept)], axis=1)
        grid, free = [lines.only(of) for lines, of in zip(grid, kept, strict=True)], coarse


def _node_weights(
    grid: Sequence[Lines], kept: Kept, nodes: Indices, comm: PETSc.Comm
) -> tuple[sparse.csr_matrix, Indices]:
    """Return trilinear weights (nodes of this rank, all coarse nodes), and the kept nodes."""
    shares = [lines.shares(of) for lines, of in zip(grid, kept, strict=True)]
    before = np.stack([share[0][nodes[:, k]] for k, share in enumerate(shares)], axis=1)
    ahead = np.stack([share[1][nodes[:, k]] for k, share in enumerate(shares)], axis=1)
    weights = np.prod(np.where(_CORNERS, ahead[:, None], 1.0 - ahead[:, None]), axis=2)
    used = weights > 0.0
    size = [len(of) for of in kept]
    corners = np.ravel_multi_index(tuple((before[:, None] + _CORNERS)[used].T), size)
    stay = np.flatnonzero((ahead == 0.0).all(axis=1))
    # coarse nodes are numbered rank after rank; PETSc distributes the table of their numbers
    own = np.ravel_multi_index(tuple(before[stay].T), size).astype(PETSc.IntType)
    directory = PETSc.AO().createMemoryScalable(own, comm=comm)
    wanted, back = np.unique(corners, return_inverse=True)
    columns = directory.app2petsc(wanted.astype(PETSc.IntType))[back]
    starts = np.concatenate([[0], np.cumsum(used.sum(axis=1))])
    rows = sparse.csr_matrix((weights[used], columns, starts), (len(nodes), int(np.prod(size))))
    rows.sort_indices()
    return rows, stay


def _distributed(
    rows: sparse.csr_matrix, columns: int, comm: PETSc.Comm, block_size: int | None = None
) -> PETSc.Mat:
    """Return a matrix from the rows on every rank and the number of columns that this rank owns."""
    pattern = (part.astype(PETSc.IntType) for part in (rows.indptr, rows.indices))
    size = ((rows.shape[0], None), (columns, None))
    return PETSc.Mat().createAIJ(size, bsize=block_size, csr=(*pattern, rows.data), comm=comm)


def for_displacements(
    weights: sparse.csr_matrix, stay: Indices, free: PETSc.Vec, *, blocks: bool = False
) -> tuple[PETSc.Mat, PETSc.Vec]:
    """Interpolate all three components of displacements, constrained unknowns apart.

    Args:
        weights: Weights of all coarse nodes, numbered rank after rank, in this rank's nodes.
        stay: This rank's nodes that are its coarse nodes.
        free: 1 for unknowns that are free, 0 for constrained ones.
        blocks: Whether the matrix has PETSc's block size 3, which products with it inherit.

    Returns:
        The matrix, and ``free`` of the coarse unknowns.

    Note:
        Collective.
    """
    count = weights.shape[0]
    rows = weights[np.repeat(np.arange(count), 3)]
    component = np.repeat(np.tile(np.arange(3), count), np.diff(rows.indptr))
    rows.indices = 3 * rows.indices + component
    matrix = _distributed(rows, 3 * len(stay), free.comm, 3 if blocks else None)
    coarse = matrix.createVecRight()
    same = (3 * stay[:, None] + np.arange(3)).ravel()
    coarse.array[:] = free.array_r[same]
    matrix.diagonalScale(free, coarse)
    fixed = np.flatnonzero(coarse.array_r == 0.0)
    if len(fixed):
        first_row, first_column = matrix.getOwnershipRange()[0], coarse.getOwnershipRange()[0]
        matrix.setValuesIJV(
            np.arange(len(fixed) + 1, dtype=PETSc.IntType),
            (fixed + first_column).astype(PETSc.IntType),
            np.ones(len(fixed)),
            rowmap=(same[fixed] + first_row).astype(PETSc.IntType),
        )
    matrix.assemble()
    return matrix, coarse
