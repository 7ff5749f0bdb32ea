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
from scipy.sparse import linalg

from patchlaw.support import Array
from patchlaw.support.network import Numbers, joined

_NARROW = 0.1
"""Links of a pool to others and to terminals, over the sum of all links of its cells, below which
it is not merged with others. Flows along x and y through 512² cells at 20 % contact took 9 and 8
iterations so, 10 and 8 with 0.02, 29 and 21 with 0.003, and 24 and 21 without pools."""


class Pools:
    """Pools of cells, which grow along their widest links until narrow ones alone lead out.

    Args:
        head: Neighbours of m cells, shape (k, m).
        link: Links to them, shape (k, m).
        diagonal: Sums of all links of cells, with those to terminals; 0 in closed ones, shape (m,).
    """

    def __init__(self, head: Numbers, link: Array, diagonal: Array) -> None:
        link = np.where(diagonal[head] > 0.0, link, 0.0)
        terminals = np.maximum(diagonal - link.sum(axis=0), 0.0)
        self._of, self._count = _grown(head, link, terminals, diagonal)
        side, tail = np.nonzero((self._of[head] != self._of) & (link != 0.0))
        head, link, ends = head[side, tail], link[side, tail], np.flatnonzero(terminals)
        rows = np.concatenate((ends, tail, tail))
        columns = self._of[np.concatenate((ends, tail, head))]
        entries = np.concatenate((terminals[ends], link, -link))
        self._out = _matrix(entries, rows, columns, (len(diagonal), self._count))
        among = _matrix(entries, self._of[rows], columns, (self._count, self._count))
        own = among.diagonal()  # 0 of closed cells alone, but for rounding
        among += sparse.diags(np.where(own > 0.0, 1e-12 * own, 1.0))
        self._factors = linalg.splu(among.tocsc())

    def changes(self, residual: NDArray[np.floating]) -> tuple[Array, Array]:
        """Return the changes that balance all pools, and the residual of cells that they leave.

        Args:
            residual: What does not balance in cells.
        """
        sums = np.bincount(self._of, residual, self._count)
        changes = self._factors.solve(sums)
        return changes, residual - self._out @ changes

    def balanced(self, found: NDArray[np.floating], changes: Array) -> Array:
        """Return potentials with the changes of pools, and those that balance what was found.

        Args:
            found: Potentials of cells for the residual that the changes leave.
            changes: See `changes`.
        """
        changes = changes - self._factors.solve(self._out.T @ found)
        return found + changes[self._of]


def _grown(head: Numbers, link: Array, terminals: Array, sums: Array) -> tuple[Numbers, int]:
    """Return the number of the pool of each cell, and how many there are.

    Args:
        head: See `Pools`.
        link: Likewise.
        terminals: Links of cells to terminals.
        sums: Sums of all links of cells.
    """
    cells = np.arange(len(sums))
    to = np.where(sums > 0.0, head[link.argmax(axis=0), cells], int(sums.argmin()))
    found: Numbers = joined(cells, to, len(sums))  # closed cells with each other
    own, sides = found, np.nonzero((found[head] != found) & (link != 0.0))
    tail: Numbers = sides[1]
    head, link = head[sides], link[sides]
    while True:
        count = int(own.max()) + 1
        terminals, sums = (np.bincount(own, one, count) * 1.0 for one in (terminals, sums))
        tail, head = own[tail], own[head]
        leads = tail != head
        links = _matrix(link[leads], tail[leads], head[leads], (count, count))
        each, link, head = np.diff(links.indptr), links.data, links.indices
        tail, linked, widest = np.repeat(np.arange(count), each), each > 0, np.zeros(count)
        if len(link):
            widest[linked] = np.maximum.reduceat(link, links.indptr[:-1][linked])
        out = terminals + np.bincount(tail, link, count)
        along = ((out > _NARROW * sums) & (widest > 0.0))[tail] & (link == widest[tail])
        if not along.any():
            return found, count
        own = joined(tail[along], head[along], count)
        found = own[found]


def _matrix(
    entries: Array, rows: Numbers, columns: Numbers, shape: tuple[int, int]
) -> sparse.csr_matrix:
    return sparse.coo_matrix((entries, (rows, columns)), shape).tocsr()
