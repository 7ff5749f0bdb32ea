"""Galerkin's products of matrices of 3 × 3 blocks, made by every rank from the rows it owns.

petsc4py only hands out copies of a matrix's entries, so the blocks are read in place through
PETSc's C interface.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from patchlaw.macro.compat import call

Indices = NDArray[np.integer]

_NODES_AT_ONCE = 20_000
"""Nodes whose rows are multiplied at a time: 30 MB."""


@dataclass(frozen=True, slots=True, eq=False)
class BlockRows:
    """A rank's rows of a matrix of 3 × 3 blocks, node by node.

    Every block stands as a column of its 9 entries, in PETSc's order: down its columns.

    Args:
        own: Blocks in columns of nodes that this rank owns, shape (9 n, n) with blocks (9, 1).
        ghost: Blocks in columns of other ranks' nodes, shape (9 n, ghosts).
        ghosts: Global numbers of these nodes, ascending.
    """

    own: sparse.bsr_matrix
    ghost: sparse.bsr_matrix
    ghosts: Indices


def galerkin(
    matrix: PETSc.Mat,
    weights: PETSc.Mat,
    free: PETSc.Vec,
    coarse_free: PETSc.Vec,
) -> PETSc.Mat:
    """Return the coarser matrix (W ⊗ I₃)ᵀ A (W ⊗ I₃), constrained unknowns apart.

    One product of scalar weights serves all nine entries of a block. PETSc's own product does not
    use the blocks: on several ranks it takes four times the work, or 1 kB of memory per unknown.

    Args:
        matrix: A, symmetric, of PETSc's type ``baij``; unit rows and columns where constrained.
        weights: W, of nodes by coarse nodes.
        free: 1 for unknowns that are free, 0 for constrained ones.
        coarse_free: The same for the coarser grid.

    Returns:
        The matrix, of the same type, with unit rows and columns where constrained.

    Note:
        Collective.
    """
    parts = []
    with block_rows(matrix) as rows:
        weights_seen, coarse = _weights_of(rows, weights)
        own = weights_seen[: rows.own.shape[1]]
        units = -_diagonal_blocks(free.array_r == 0.0)  # are no part of the product
        terms = ((rows.own, own), (rows.ghost, weights_seen[rows.own.shape[1] :]), (units, own))
        for blocks, right in terms:
            parts += list(_products(own, blocks, right))
    coarser = _sum_of_parts(parts, coarse, weights)
    first = coarser.getOwnershipRange()[0]
    constrained = first + np.flatnonzero(coarse_free.array_r == 0.0)
    coarser.zeroRowsColumns(constrained.astype(PETSc.IntType), 1.0)
    return coarser


def _weights_of(rows: BlockRows, weights: PETSc.Mat) -> tuple[sparse.csr_matrix, Indices]:
    """Return the weights of own nodes, then of ghosts, and the coarse nodes that they are of."""
    first, last = weights.getOwnershipRange()
    seen = np.concatenate([np.arange(first, last), rows.ghosts])
    wanted = np.sort(seen).astype(PETSc.IntType)
    at = PETSc.IS().createGeneral(wanted, comm=PETSc.COMM_SELF)
    every = PETSc.IS().createStride(weights.getSize()[1], 0, 1, comm=PETSc.COMM_SELF)
    part = weights.createSubMatrices(at, every)[0]
    starts, columns, values = part.getValuesCSR()
    part.destroy()
    coarse, places = np.unique(columns, return_inverse=True)
    table = sparse.csr_matrix((values, places, starts), shape=(len(wanted), len(coarse)))
    return table[np.searchsorted(wanted, seen)], coarse


def _diagonal_blocks(flags: NDArray[np.bool_]) -> sparse.bsr_matrix:
    """Return flags of a rank's unknowns on the diagonals of blocks as in `BlockRows`."""
    nodes = flags.reshape(-1, 3)
    some = nodes.any(axis=1)
    blocks = np.einsum("na,ab->nab", nodes[some].astype(float), np.eye(3)).reshape(-1, 9, 1)
    starts = np.concatenate([[0], np.cumsum(some)])
    parts = (blocks, np.flatnonzero(some), starts)
    return sparse.bsr_matrix(parts, shape=(9 * len(nodes), len(nodes)))


def _products(
    left: sparse.csr_matrix,
    blocks: sparse.bsr_matrix,
    right: sparse.csr_matrix,
) -> Iterator[sparse.bsr_matrix]:
    """Multiply from both sides, some rows of blocks at a time, without those that are empty.

    Yields:
        Parts of the product, blocks (1, 9) whose entries stand as in `BlockRows`.
    """
    filled = np.flatnonzero(np.diff(blocks.indptr))
    right = right.tobsr((1, 1))
    for nodes in np.array_split(filled, -(-len(filled) // _NODES_AT_ONCE) or 1):
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
    owner = np.searchsorted(weights.getOwnershipRangesColumn(), coarse, side="right")
    counted = [weights.createVecRight() for _ in range(2)]
    entries = []
    for part in parts:
        counts = np.diff(part.indptr)
        filled = np.flatnonzero(counts)
        rows, columns = (coarse[at].astype(PETSc.IntType) for at in (filled, part.indices))
        near = owner[part.indices] == np.repeat(owner, counts)
        own = np.add.reduceat(near, part.indptr[filled], dtype=float)
        counted[0].setValues(rows, own, addv=True)
        counted[1].setValues(rows, counts[filled] - own, addv=True)
        starts = np.concatenate([[0], np.cumsum(counts[filled])]).astype(PETSc.IntType)
        entries.append((starts, columns, part.data.ravel(), rows))
    local, size = counted[0].getSizes()
    room = []  # blocks per row in columns of the same rank, and of others
    for vector, most in zip(counted, (local, size - local), strict=True):
        vector.assemble()
        room.append(np.minimum(np.rint(vector.array_r).astype(PETSc.IntType), most))
        vector.destroy()
    matrix = PETSc.Mat().create(weights.comm)
    matrix.setSizes(((3 * local, 3 * size),) * 2)
    matrix.setType("baij")
    matrix.setBlockSize(3)
    matrix.setPreallocationNNZ(tuple(room))
    # ranks without rows do not set this by themselves, and assembly hangs where ranks differ in it
    matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)
    matrix.setOption(PETSc.Mat.Option.ROW_ORIENTED, False)
    for starts, columns, values, rows in entries:
        matrix.setValuesBlockedIJV(starts, columns, values, addv=True, rowmap=rows)
    matrix.assemble()
    return matrix


@contextmanager
def block_rows(matrix: PETSc.Mat) -> Iterator[BlockRows]:
    """Yield this rank's rows of a matrix of PETSc's type ``baij`` without copying entries.

    Args:
        matrix: Assembled, block size 3; must not change inside the context.

    Raises:
        PETSc.Error: When the matrix is of another type.
    """
    count = matrix.getLocalSize()[0] // 3
    none = np.zeros(0, dtype=PETSc.IntType)
    own, ghost, ghosts = ctypes.c_void_p(matrix.handle), ctypes.c_void_p(), _pointer(PETSc.IntType)
    if matrix.getType() == "seqbaij":
        with _sequential(own, count) as blocks:
            yield BlockRows(blocks, sparse.bsr_matrix((9 * count, 0), blocksize=(9, 1)), none)
        return
    call("MatMPIBAIJGetSeqBAIJ", own, *map(ctypes.byref, (own, ghost, ghosts)))
    with _sequential(own, count) as first, _sequential(ghost, None) as second:
        numbers = np.ctypeslib.as_array(ghosts, second.shape[1:]) if second.shape[1] else none
        yield BlockRows(first, second, numbers)


@contextmanager
def _sequential(matrix: ctypes.c_void_p, columns: int | None) -> Iterator[sparse.bsr_matrix]:
    """Yield the blocks of a ``seqbaij`` matrix; None takes its number of columns from itself."""
    integer = np.ctypeslib.as_ctypes_type(PETSc.IntType)
    count, width, done = integer(), integer(), ctypes.c_int(0)
    rows, places, entries = map(_pointer, (PETSc.IntType, PETSc.IntType, np.float64))
    pattern = (*map(ctypes.byref, (count, rows, places, done)),)
    call("MatGetLocalSize", matrix, None, ctypes.byref(width))
    call("MatGetRowIJ", matrix, integer(0), 0, 1, *pattern)
    call("MatSeqBAIJGetArray", matrix, ctypes.byref(entries))
    try:
        starts = np.ctypeslib.as_array(rows, (count.value + 1,))
        size = int(starts[-1])
        values = np.ctypeslib.as_array(entries, (size, 9, 1)) if size else np.empty((0, 9, 1))
        indices = np.ctypeslib.as_array(places, (size,)) if size else np.empty(0, starts.dtype)
        shape = (9 * count.value, width.value // 3 if columns is None else columns)
        yield sparse.bsr_matrix((values, indices, starts), shape=shape)
    finally:
        call("MatSeqBAIJRestoreArray", matrix, ctypes.byref(entries))
        call("MatRestoreRowIJ", matrix, integer(0), 0, 1, *pattern)


def _pointer(number: Any) -> Any:
    return ctypes.POINTER(np.ctypeslib.as_ctypes_type(number))()
