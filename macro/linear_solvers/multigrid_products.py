"""Galerkin's products of matrices of 3 × 3 blocks, made by every rank from the rows it owns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from macro.linear_solvers.petsc_blocks import BlockRows, block_rows

Indices = NDArray[np.integer]

_AT_ONCE = 20_000
"""Nodes whose rows are multiplied at a time: 30 MB."""


def galerkin(
    matrix: PETSc.Mat, weights: PETSc.Mat, free: PETSc.Vec, coarse_free: PETSc.Vec
) -> PETSc.Mat:
    """Return the coarser matrix (W ⊗ I₃)ᵀ A (W ⊗ I₃), held unknowns apart.

    A product of numbers serves for all nine entries of a block. PETSc's own product knows no
    blocks, and several ranks spend four times the work on it, or 1 kB of memory per unknown.

    Args:
        matrix: A, symmetric, of PETSc's type ``baij``; unit rows and columns where held.
        weights: W, of nodes by coarse nodes.
        free: 1 for unknowns that are free, 0 for those that are held.
        coarse_free: The same for the coarser grid.

    Returns:
        The matrix, of the same type, with unit rows and columns where held.

    Note:
        Collective.
    """
    parts = []
    with block_rows(matrix) as rows:
        far, coarse = _weights_of(rows, weights)
        near = far[: rows.own.shape[1]]
        held = -_diagonal_blocks(free.array_r == 0.0)  # their units are no part of the product
        terms = ((rows.own, near), (rows.beside, far[rows.own.shape[1] :]), (held, near))
        for blocks, columns in terms:
            parts += list(_products(near, blocks, columns))
    coarser = _sum_of_parts(parts, coarse, weights)
    first = coarser.getOwnershipRange()[0]
    units = first + np.flatnonzero(coarse_free.array_r == 0.0)
    coarser.zeroRowsColumns(units.astype(PETSc.IntType), 1.0)
    return coarser


def _weights_of(rows: BlockRows, weights: PETSc.Mat) -> tuple[sparse.csr_matrix, Indices]:
    """Return the weights of own nodes, then of ghosts, and the coarse nodes that they are of."""
    first, last = weights.getOwnershipRange()
    wanted = np.sort(np.concatenate([np.arange(first, last), rows.ghosts])).astype(PETSc.IntType)
    at = PETSc.IS().createGeneral(wanted, comm=PETSc.COMM_SELF)
    every = PETSc.IS().createStride(weights.getSize()[1], 0, 1, comm=PETSc.COMM_SELF)
    found = weights.createSubMatrices(at, every)[0]
    starts, columns, values = found.getValuesCSR()
    found.destroy()
    coarse, places = np.unique(columns, return_inverse=True)
    table = sparse.csr_matrix((values, places, starts), shape=(len(wanted), len(coarse)))
    order = np.searchsorted(wanted, np.concatenate([np.arange(first, last), rows.ghosts]))
    return table[order], coarse


def _diagonal_blocks(flags: NDArray[np.bool_]) -> sparse.bsr_matrix:
    """Return flags of unknowns on the diagonals of blocks as in `BlockRows`, where there are any.

    Args:
        flags: Of every unknown of the rank.
    """
    nodes = flags.reshape(-1, 3)
    some = nodes.any(axis=1)
    blocks = np.einsum("na,ab->nab", nodes[some].astype(float), np.eye(3)).reshape(-1, 9, 1)
    starts = np.concatenate([[0], np.cumsum(some)])
    shape = (9 * len(nodes), len(nodes))
    return sparse.bsr_matrix((blocks, np.flatnonzero(some), starts), shape=shape)


def _products(
    left: sparse.csr_matrix, blocks: sparse.bsr_matrix, right: sparse.csr_matrix
) -> Iterator[sparse.bsr_matrix]:
    """Multiply from both sides, some rows of blocks at a time, without those that are empty.

    Yields:
        Parts of the product, blocks (1, 9) whose entries stand as in `BlockRows`.
    """
    filled = np.flatnonzero(np.diff(blocks.indptr))
    right = right.tobsr((1, 1))
    for nodes in np.array_split(filled, -(-len(filled) // _AT_ONCE) or 1):
        if not len(nodes):
            return
        first, last = nodes[0], nodes[-1] + 1
        starts = blocks.indptr[first : last + 1]
        within = slice(starts[0], starts[-1])
        some = (blocks.data[within], blocks.indices[within], starts - starts[0])
        shape = (9 * (last - first), blocks.shape[1])
        half = sparse.bsr_matrix(some, shape=shape, copy=False) @ right
        turned = (half.data.reshape(-1, 1, 9), half.indices, half.indptr)
        half = sparse.bsr_matrix(turned, shape=(last - first, 9 * right.shape[1]))
        yield left[first:last].T.tocsr().tobsr((1, 1)) @ half


def _sum_of_parts(parts: list[sparse.bsr_matrix], coarse: Indices, weights: PETSc.Mat) -> PETSc.Mat:
    """Add parts of the coarser matrix, of all ranks, at the coarse nodes that they are of."""
    comm, owners = weights.comm, weights.getOwnershipRangesColumn()
    owner = np.searchsorted(owners, coarse, side="right")
    here = [weights.createVecRight() for _ in range(2)]
    entries = []
    for part in parts:
        counts = np.diff(part.indptr)
        filled = np.flatnonzero(counts)
        rows, columns = coarse[filled].astype(PETSc.IntType), coarse[part.indices]
        near = owner[part.indices] == np.repeat(owner, counts)
        shared = np.add.reduceat(near, part.indptr[filled], dtype=float)
        here[0].setValues(rows, shared, addv=True)
        here[1].setValues(rows, counts[filled] - shared, addv=True)
        starts = np.concatenate([[0], np.cumsum(counts[filled])])
        entries.append((starts, columns, part.data.ravel(), rows))
    for vector in here:
        vector.assemble()
    local, size = here[0].getSizes()
    near, far = (np.rint(vector.array_r).astype(PETSc.IntType) for vector in here)
    for vector in here:
        vector.destroy()
    room = (np.minimum(near, local), np.minimum(far, size - local))
    matrix = PETSc.Mat().create(comm)
    matrix.setSizes(((3 * local, 3 * size),) * 2)
    matrix.setType("baij")
    matrix.setBlockSize(3)
    matrix.setPreallocationNNZ(room)
    # ranks without rows do not set this by themselves, and assembly hangs where ranks differ in it
    matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)
    matrix.setOption(PETSc.Mat.Option.ROW_ORIENTED, False)
    for starts, columns, values, rows in entries:
        pattern = (part.astype(PETSc.IntType) for part in (starts, columns))
        matrix.setValuesBlockedIJV(*pattern, values, addv=True, rowmap=rows)
    matrix.assemble()
    return matrix
