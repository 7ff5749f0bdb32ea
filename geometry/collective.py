"""Work on the ranks of a communicator that succeeds or fails on all of them together.

Only mpi4py's lower-case methods of the communicator are used, so that nothing here imports MPI.
``None`` stands for a single process.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

from geometry.cores import lent, node_cores

T = TypeVar("T")

_NAP = 1e-3
"""Time between two looks of a waiting rank at whether the work is done [s]."""


def on_root(comm: Any, work: Callable[[], T]) -> T:
    """Do work on rank 0 and broadcast its result, or its error, to every rank.

    Args:
        comm: MPI communicator (mpi4py), or None.
        work: What to do; its result must be picklable.

    Returns:
        The result, on every rank.

    Raises:
        Exception: Whatever the work raised, on every rank.

    Note:
        Collective.
    """
    if comm is None or comm.size == 1:
        return work()
    result, error = _attempt(work) if comm.rank == 0 else (None, None)
    result, error = comm.bcast((result, error), root=0)
    if error is not None:
        raise error
    return result


def on_root_alone(comm: Any, work: Callable[[], T]) -> T:
    """Do long work on rank 0, which is lent the cores of its node, and broadcast the result.

    The other ranks sleep meanwhile. In a collective call of MPI they would keep their cores busy.

    Args:
        comm: MPI communicator, or None.
        work: What to do; its result must be picklable.

    Returns:
        The result, on every rank.

    Raises:
        Exception: Whatever the work raised, on every rank.

    Note:
        Collective.
    """
    if comm is None or comm.size == 1:
        return work()

    def lending() -> T:
        try:
            with lent(node_cores()):
                return work()
        finally:
            comm.Ibarrier().Wait()

    if comm.rank:
        done = comm.Ibarrier()
        while not done.Test():
            time.sleep(_NAP)
    return on_root(comm, lending)


def together(comm: Any, work: Callable[[], T]) -> T:
    """Do work on every rank; when one fails, all raise the error of the lowest failing rank.

    Args:
        comm: MPI communicator (mpi4py), or None.
        work: What to do; must not communicate itself, or fail on all ranks alike.

    Returns:
        This rank's own result.

    Raises:
        Exception: The first failing rank's error, on every rank.

    Note:
        Collective.
    """
    if comm is None or comm.size == 1:
        return work()
    result, error = _attempt(work)
    failures = [other for other in comm.allgather(error) if other is not None]
    if failures:
        raise failures[0]
    return result  # type: ignore[return-value]


def shared(
    comm: Any,
    count: int,
    work: Callable[[int], T],
    first: int = 0,
    observe: Callable[[int], None] | None = None,
) -> list[T]:
    """Do tasks of a list in turn on all ranks: the first on one, the second on the next.

    Args:
        comm: MPI communicator (mpi4py), or None.
        count: Number of tasks.
        work: Does the task of an index; must not communicate itself.
        first: Rank that takes the first task, modulo the number of ranks.
        observe: Called on every rank after each task of its own, with the number of tasks that all
            ranks have done by then if they are equally quick.

    Returns:
        The results of all tasks in their order, on every rank.

    Raises:
        Exception: The first failing rank's error, on every rank.

    Note:
        Collective.
    """
    rank, size = (0, 1) if comm is None else (comm.rank, comm.size)
    own = range((rank - first) % size, count, size)

    def done(turn: int, index: int) -> T:
        result = work(index)
        if observe is not None:
            observe(min(size * (turn + 1), count))
        return result

    mine = together(comm, lambda: [done(turn, index) for turn, index in enumerate(own)])
    gathered = [mine] if size == 1 else comm.allgather(mine)
    return [gathered[(index + first) % size][index // size] for index in range(count)]


def _attempt(work: Callable[[], T]) -> tuple[T | None, Exception | None]:
    """Return the result or the error of some work."""
    try:
        return work(), None
    except Exception as error:  # passed on by the caller on every rank
        return None, error
