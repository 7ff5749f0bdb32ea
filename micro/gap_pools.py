"""Pools of fluid that narrow links alone join to others, on a coarse grid of a map of gaps.

Multigrid hardly corrects the pressure of a pool that no cell of the next coarser grid stands for,
as the cells of the pool take pressures from others beyond its narrow links. Here they take one
change of pressure together, which balances what flows through these links (deflation: Nicolaides
1987, doi 10.1137/0724027; as a symmetric preconditioner: Mandel 1993, doi 10.1002/cnm.1640090307).

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph, linalg

from patchlaw.support import Array
from patchlaw.support.arrays import Indices

_NARROW = 0.1
"""Links of a pool to others and to terminals, over the sum of all links of its cells, below which
it is not merged with others. Flows along x and y through 512² cells at 20 % contact took 9 and 8
iterations so, 10 and 8 with 0.02, 29 and 21 with 0.003, and 24 and 21 without pools."""


class Pools:
    """Pools of cells, which grow along their widest links until narrow ones alone lead out.

    Args:
        tail: Cells that links leave, each link seen from both of its ends, shape (m,).
        head: Cells that they lead to, shape (m,).
        link: The links, shape (m,).
        diagonal: Sums of all links of cells, with those to terminals; 0 in closed cells.
    """

    def __init__(self, tail: Indices, head: Indices, link: Array, diagonal: Array) -> None:
        cells, is_open = np.flatnonzero(diagonal), (diagonal[tail] > 0.0) & (diagonal[head] > 0.0)
        tail, head, link = tail[is_open], head[is_open], link[is_open]
        terminals = np.maximum(diagonal - np.bincount(tail, link, len(diagonal)), 0.0)
        number = np.cumsum(diagonal > 0.0) - 1
        links = _matrix(link, number[tail], number[head], len(cells))
        pools, self._count = _grown(links, terminals[cells], diagonal[cells])
        self._of = np.full(len(diagonal), self._count)  # closed cells are in one of their own
        self._of[cells] = pools
        leaves = self._of[tail] != self._of[head]
        tail, head, link = tail[leaves], head[leaves], link[leaves]
        rows = np.concatenate((cells, tail, tail))
        columns = self._of[np.concatenate((cells, tail, head))]
        entries = np.concatenate((terminals[cells], link, -link))
        shape = len(diagonal), self._count
        self._out = sparse.coo_matrix((entries, (rows, columns)), shape).tocsr()
        self._into = self._out.T.tocsr()
        among = _matrix(entries, self._of[rows], columns, self._count)
        among += sparse.diags(1e-12 * among.diagonal() + 1e-300)  # rounding may leave no way out
        self._factors = linalg.splu(among.tocsc())

    def changes(self, residual: NDArray[np.floating]) -> tuple[Array, Array]:
        """Return the changes that balance all pools, and the residual of cells that they leave.

        Args:
            residual: What does not balance in cells.
        """
        sums = np.bincount(self._of, residual, self._count + 1)[:-1]
        changes = self._factors.solve(sums)
        return changes, residual - self._out @ changes

    def balanced(self, found: NDArray[np.floating], changes: Array) -> Array:
        """Return potentials with the changes of pools, and those that balance what was found.

        Args:
            found: Potentials of cells for the residual that the changes leave.
            changes: See `changes`.
        """
        changes = changes - self._factors.solve(self._into @ found)
        return found + np.append(changes, 0.0)[self._of]


def _grown(links: sparse.csr_matrix, terminals: Array, sums: Array) -> tuple[Indices, int]:
    """Return the number of the pool of each cell, and how many there are.

    Args:
        links: Links between cells.
        terminals: Their links to terminals.
        sums: Sums of all links of cells.
    """
    found = np.arange(len(sums))
    while links.nnz:
        count, starts = len(sums), links.indptr[:-1]
        some = np.flatnonzero(np.diff(links.indptr))
        widest, out = np.zeros(count), terminals.copy()
        widest[some] = np.maximum.reduceat(links.data, starts[some])
        out[some] += np.add.reduceat(links.data, starts[some])
        grows = (out > _NARROW * sums) & (widest > 0.0)
        if not grows.any():
            break
        tail = np.repeat(np.arange(count), np.diff(links.indptr))
        along = grows[tail] & (links.data == widest[tail])
        joined = _matrix(np.ones(along.sum()), tail[along], links.indices[along], count)
        count, own = csgraph.connected_components(joined, directed=False)
        found, tail, head = own[found], own[tail], own[links.indices]
        terminals, sums = (np.bincount(own, one, count) for one in (terminals, sums))
        links = _matrix(
            links.data[tail != head], *(one[tail != head] for one in (tail, head)), count
        )
    return found, len(sums)


def _matrix(entries: Array, rows: Indices, columns: Indices, size: int) -> sparse.csr_matrix:
    return sparse.coo_matrix((entries, (rows, columns)), (size, size)).tocsr()
