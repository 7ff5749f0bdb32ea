"""The 3 × 3 blocks of a PETSc matrix, read where they lie: petsc4py only hands out copies."""

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

_PETSC = ctypes.CDLL(PETSc.__file__)  # finds what petsc4py itself is linked with
_INT = np.ctypeslib.as_ctypes_type(PETSc.IntType)
_INTS, _REALS = ctypes.POINTER(_INT), ctypes.POINTER(ctypes.c_double)


@dataclass(frozen=True, slots=True, eq=False)
class BlockRows:
    """A rank's rows of a matrix of 3 × 3 blocks, node by node.

    Every block stands as a column of its 9 entries, in PETSc's order: down its columns.

    Args:
        own: Blocks in columns of nodes that this rank owns, shape (9 n, n) with blocks (9, 1).
        beside: Blocks in columns of other ranks' nodes, shape (9 n, ghosts).
        ghosts: Global numbers of these nodes, ascending.
    """

    own: sparse.bsr_matrix
    beside: sparse.bsr_matrix
    ghosts: NDArray[np.integer]


@contextmanager
def block_rows(matrix: PETSc.Mat) -> Iterator[BlockRows]:
    """Lend this rank's rows of a matrix of PETSc's type ``baij`` without copying entries.

    Args:
        matrix: Assembled, block size 3; must not change while it is lent.
    """
    count = matrix.getLocalSize()[0] // 3
    none = np.zeros(0, dtype=PETSc.IntType)
    own, beside, ghosts = ctypes.c_void_p(matrix.handle), ctypes.c_void_p(), _INTS()
    if matrix.getType() == "seqbaij":
        with _sequential(own, count) as blocks:
            yield BlockRows(blocks, sparse.bsr_matrix((9 * count, 0), blocksize=(9, 1)), none)
        return
    _call("MatMPIBAIJGetSeqBAIJ", own, *map(ctypes.byref, (own, beside, ghosts)))
    with _sequential(own, count) as first, _sequential(beside, None) as second:
        others = second.shape[1]
        numbers = np.ctypeslib.as_array(ghosts, (others,)) if others else none
        yield BlockRows(first, second, numbers)


@contextmanager
def _sequential(matrix: ctypes.c_void_p, columns: int | None) -> Iterator[sparse.bsr_matrix]:
    """Lend the blocks of a ``seqbaij`` matrix; None takes its number of columns from itself."""
    count, width, rows, places = _INT(), _INT(), _INTS(), _INTS()
    entries, done = _REALS(), ctypes.c_int(0)
    pattern = (*map(ctypes.byref, (count, rows, places, done)),)
    _call("MatGetLocalSize", matrix, None, ctypes.byref(width))
    _call("MatGetRowIJ", matrix, _INT(0), 0, 1, *pattern)
    _call("MatSeqBAIJGetArray", matrix, ctypes.byref(entries))
    try:
        starts = np.ctypeslib.as_array(rows, (count.value + 1,))
        size = int(starts[-1])
        values = np.ctypeslib.as_array(entries, (size, 9, 1)) if size else np.empty((0, 9, 1))
        indices = np.ctypeslib.as_array(places, (size,)) if size else np.empty(0, starts.dtype)
        shape = (9 * count.value, width.value // 3 if columns is None else columns)
        yield sparse.bsr_matrix((values, indices, starts), shape=shape)
    finally:
        _call("MatSeqBAIJRestoreArray", matrix, ctypes.byref(entries))
        _call("MatRestoreRowIJ", matrix, _INT(0), 0, 1, *pattern)


def _call(name: str, *arguments: Any) -> None:
    code = getattr(_PETSC, name)(*arguments)
    if code:
        raise PETSc.Error(code)
