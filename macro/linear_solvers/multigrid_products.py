"""Galerkin's products of matrices of 3 × 3 blocks, made by every rank from the rows it owns.

Theory: section 11 of ``demos/theory.md``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from macro.linear_solvers.node_matrices import coupled_nodes, dofs_of, node_submatrix

Indices = NDArray[np.intp]

_NODES_AT_ONCE = 5_000
"""Nodes whose rows are copied and multiplied at a time: 30 MB."""


def galerkin(
    matrix: PETSc.Mat,
    weights: PETSc.Mat,
    free: PETSc.Vec,
    coarse_free: PETSc.Vec,
    *,
    nodes_at_once: int = _NODES_AT_ONCE,
) -> PETSc.Mat:
    """Return the coarser matrix (W ⊗ I₃)ᵀ A (W ⊗ I₃), constrained unknowns apart.

    One product of scalar weights serves all nine entries of a block. PETSc's own product does not
    use the blocks: on several ranks it takes four times the work, or 1 kB of memory per unknown.

    Args:
        matrix: A, symmetric, of PETSc's type ``baij``; unit rows and columns where constrained.
        weights: W, of nodes by coarse nodes.
        free: 1 for unknowns that are free, 0 for constrained ones.
        coarse_free: The same for the coarser grid.
        nodes_at_once: Nodes whose rows are multiplied at a time.

    Returns:
        The matrix, of the same type, with unit rows and columns where constrained.

    Note:
        Collective.
    """
    parts = _products(matrix, weights, free.array_r == 0.0, nodes_at_once)
    own, constrained = _sum_over_ranks(_sum(list(parts)), weights), coarse_free.array_r == 0.0
    coarser = _distributed(own + _units(constrained, own, weights), weights)
    rows = coarser.getOwnershipRange()[0] + np.flatnonzero(constrained)
    coarser.zeroRowsColumns(rows.astype(PETSc.IntType), 1.0)
    return coarser


def _products(
    matrix: PETSc.Mat, weights: PETSc.Mat, constrained: NDArray[np.bool_], nodes_at_once: int
) -> Iterator[sparse.bsr_matrix]:
    """Yield parts of the product by this rank's rows, blocks (1, 9) of all coarse nodes.

    Most rows are taken from the rank's own part of the matrix, some at a time. Rows that have
    entries in columns of other ranks come together, because all ranks take part in that.
    """
    first, last = weights.getOwnershipRange()
    own, local = np.arange(last - first), matrix.getDiagonalBlock()
    coupled, own_weights = coupled_nodes(matrix), _rows(weights, first + own)
    if matrix.comm.size > 1:
        rows = node_submatrix(matrix, first + coupled, np.arange(weights.getSize()[0]))
        seen = np.unique(rows.indices // 3)
        columns = rows[:, dofs_of(seen)]
        fixed = constrained[dofs_of(coupled)]
        yield _product(own_weights[coupled], columns, fixed, _rows(weights, seen))
    inner = np.setdiff1d(own, coupled)
    for nodes in np.array_split(inner, max(1, -(-len(inner) // nodes_at_once))):
        if len(nodes):
            rows, fixed = node_submatrix(local, nodes, own), constrained[dofs_of(nodes)]
            yield _product(own_weights[nodes], rows, fixed, own_weights)


def _product(
    left: sparse.csr_matrix,
    rows: sparse.csr_matrix,
    constrained: NDArray[np.bool_],
    right: sparse.csr_matrix,
) -> sparse.bsr_matrix:
    """Multiply rows of unknowns by weights of nodes from both sides, without constrained rows."""
    if constrained.any():
        rows.data[np.repeat(constrained, np.diff(rows.indptr))] = 0.0
    blocks = rows.tobsr((3, 3))
    nine = (blocks.data.reshape(-1, 9, 1), blocks.indices, blocks.indptr)
    half = sparse.bsr_matrix(nine, shape=(9 * left.shape[0], right.shape[0])) @ right.tobsr((1, 1))
    turned = (half.data.reshape(-1, 1, 9), half.indices, half.indptr)
    half = sparse.bsr_matrix(turned, shape=(left.shape[0], 9 * right.shape[1]))
    return left.T.tocsr().tobsr((1, 1)) @ half


def _rows(weights: PETSc.Mat, nodes: Indices) -> sparse.csr_matrix:
    """Return the weights of all coarse nodes in some nodes of any rank, ascending; collective."""
    at = PETSc.IS().createGeneral(nodes.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    every = PETSc.IS().createStride(weights.getSize()[1], 0, 1, comm=PETSc.COMM_SELF)
    found = weights.createSubMatrices(at, every)[0]
    starts, columns, values = found.getValuesCSR()
    found.destroy()
    return sparse.csr_matrix((values, columns, starts), shape=(len(nodes), weights.getSize()[1]))


def _sum(parts: Sequence[sparse.bsr_matrix]) -> sparse.bsr_matrix:
    """Add matrices in pairs, so that no large sum is copied for every small part."""
    while len(parts) > 1:
        pairs = zip(parts[::2], parts[1::2], strict=False)
        parts = [one + other for one, other in pairs] + [*parts[len(parts) // 2 * 2 :]]
    return parts[0]


def _sum_over_ranks(part: sparse.bsr_matrix, weights: PETSc.Mat) -> sparse.bsr_matrix:
    """Add the parts of all ranks, and return the rows of the coarse nodes that this rank owns."""

    def rows(first: int, last: int) -> tuple[Any, ...]:
        starts = part.indptr[first : last + 1]
        within = slice(starts[0], starts[-1])
        return part.data[within], part.indices[within], starts - starts[0]

    owners = weights.getOwnershipRangesColumn()
    comm = weights.comm.tompi4py()
    received = comm.alltoall([rows(first, last) for first, last in pairwise(owners)])
    shape = (owners[comm.rank + 1] - owners[comm.rank], part.shape[1])
    return _sum([sparse.bsr_matrix(piece, shape=shape) for piece in received])


def _units(
    constrained: NDArray[np.bool_], own: sparse.bsr_matrix, weights: PETSc.Mat
) -> sparse.bsr_matrix:
    """Return 1 on the diagonal of constrained unknowns, whose rows of a sum may be empty."""
    nodes = constrained.reshape(-1, 3)
    some = nodes.any(axis=1)
    blocks = nodes[some][:, :, None] * np.eye(3)
    columns = weights.getOwnershipRangeColumn()[0] + np.flatnonzero(some)
    starts = np.concatenate([[0], np.cumsum(some)])
    return sparse.bsr_matrix((blocks.reshape(-1, 1, 9), columns, starts), shape=own.shape)


def _distributed(own: sparse.bsr_matrix, weights: PETSc.Mat) -> PETSc.Mat:
    """Return the matrix of type ``baij`` from the rows that every rank owns."""
    first, last = weights.getOwnershipRangeColumn()
    count, size = last - first, weights.getSize()[1]
    near = (own.indices >= first) & (own.indices < last)
    row = np.repeat(np.arange(count), np.diff(own.indptr))
    filled = [np.bincount(row[which], minlength=count) for which in (near, ~near)]
    matrix = PETSc.Mat().create(weights.comm)
    matrix.setSizes(((3 * count, 3 * size),) * 2)
    matrix.setType("baij")
    matrix.setBlockSize(3)
    matrix.setPreallocationNNZ(tuple(part.astype(PETSc.IntType) for part in filled))
    # ranks without rows do not set this by themselves, and assembly hangs where ranks differ in it
    matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)
    if own.nnz:
        pattern = (part.astype(PETSc.IntType) for part in (own.indptr, own.indices))
        rows = np.arange(first, last, dtype=PETSc.IntType)
        matrix.setValuesBlockedIJV(*pattern, own.data.ravel(), rowmap=rows)
    matrix.assemble()
    return matrix
