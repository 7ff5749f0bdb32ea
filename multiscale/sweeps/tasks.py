"""Hands the tasks of a sweep to the ranks, one by one as they become free.

The next task is a number in the memory of rank 0 that every rank reads and raises in one step
(one-sided communication of MPI), so that no rank only hands out. Which rank does a task depends on
time; its result does not, as every task begins from nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np


class TaskCounter:
    """The tasks that no rank has taken yet.

    Args:
        comm: MPI communicator (mpi4py); None for a process on its own.
        count: Number of tasks.

    Note:
        Construction and `close` are collective; what lies between is not.
    """

    def __init__(self, comm: Any, count: int) -> None:
        self._comm, self._count = comm, count
        self._rank: int = 0 if comm is None else comm.rank
        self._size: int = 1 if comm is None else comm.size
        self._window: Any = None
        if self._size > 1:
            from mpi4py import MPI

            self._shared, self._sum = MPI.LOCK_SHARED, MPI.SUM
            self._window = MPI.Win.Allocate(8 if self._rank == 0 else 0, 8, comm=comm)
            if self._rank == 0:
                np.frombuffer(self._window.tomemory(), np.int64)[:] = self._size
            comm.Barrier()

    def __iter__(self) -> Iterator[int]:
        """Yield the tasks of this rank; the first ones in the order of the ranks."""
        index = self._rank
        while index < self._count:
            yield index
            index = self._next() if self._window is not None else index + 1

    def _next(self) -> int:
        one, found = np.ones(1, np.int64), np.zeros(1, np.int64)
        self._window.Lock(0, self._shared)
        self._window.Fetch_and_op(one, found, 0, 0, self._sum)
        self._window.Unlock(0)
        return int(found[0])

    def progress(self) -> None:
        """Let MPI serve other ranks, on networks that need this rank's help; takes microseconds."""
        if self._window is not None:
            self._comm.Iprobe()

    def close(self) -> None:
        """Free the counter, after all ranks have come here."""
        if self._window is not None:
            self._window.Free()
            self._window = None
