"""Parts of matrices of displacements that belong to some nodes, three unknowns per node."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csr_matrix

Indices = NDArray[np.intp]


def node_submatrix(matrix: PETSc.Mat, rows: Indices, columns: Indices) -> csr_matrix:
    """Return the part of a matrix that belongs to some nodes.

    Whole nodes are taken because matrices of PETSc's type ``baij`` give no smaller parts.

    Args:
        matrix: The matrix; of this process alone, or of all ranks.
        rows: Global numbers of the rows' nodes, ascending.
        columns: Global numbers of the columns' nodes, ascending.

    Note:
        Collective over the ranks of the matrix.
    """
    rows_of, columns_of = (
        PETSc.IS().createBlock(3, nodes.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
        for nodes in (rows, columns)
    )
    part = matrix.createSubMatrices(rows_of, columns_of)[0]
    starts, places, entries = part.getValuesCSR()
    part.destroy()
    return csr_matrix((entries, places, starts), shape=(3 * len(rows), 3 * len(columns)))


def coupled_nodes(matrix: PETSc.Mat) -> Indices:
    """Return this rank's nodes whose rows have entries in columns of other ranks, ascending.

    There, and nowhere else, the product of the matrix with random numbers differs from the
    product of the rank's own part with them.

    Args:
        matrix: The matrix of all ranks.

    Returns:
        Local numbers, shape (n,).

    Note:
        Collective.
    """
    local = matrix.getDiagonalBlock()
    numbers, whole = matrix.createVecs()
    part, alone = local.createVecs()
    part.array[:] = np.random.default_rng(1).standard_normal(part.local_size)
    numbers.array[:] = part.array_r
    matrix.mult(numbers, whole)
    local.mult(part, alone)
    differs = (whole.array_r != alone.array_r).reshape(-1, 3)
    return np.flatnonzero(differs.any(axis=1))


def dofs_of(nodes: Indices) -> Indices:
    """Return the three unknowns of every node, shape (3 n,)."""
    return (3 * nodes[:, None] + np.arange(3)).ravel()
