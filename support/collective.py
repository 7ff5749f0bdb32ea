"""Work on the ranks of a communicator that succeeds or fails on all of them together.

Only mpi4py's lower-case methods of the communicator are used, so that nothing here imports MPI.
``None`` stands for a single process.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from heapq import heappop, heappush
from itertools import chain
from typing import Any, TypeVar

from patchlaw.support.parallel import allocated, node_cores

T = TypeVar("T")


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
    return _from_root(comm, _attempt(work) if comm.rank == 0 else None)


def on_root_alone(comm: Any, work: Callable[[], T]) -> T:
    """Do long work on rank 0 with all cores of its node, and broadcast the result.

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
    here, done = node_cores(comm), None
    if comm.rank == 0:
        with allocated(here.alone, here.granted):
            done = _attempt(work)
    _sleep_until_all_arrive(comm)
    return _from_root(comm, done)


def _from_root(comm: Any, done: tuple[T | None, Exception | None] | None) -> T:
    """Return what `_attempt` gave on rank 0 on every rank, or raise its error there."""
    result, error = comm.bcast(done, root=0)
    if error is not None:
        raise error
    return result


def _sleep_until_all_arrive(comm: Any) -> None:
    """Wait for all ranks; in a collective call of MPI those that wait would keep cores busy.

    A rank looks for the others after a tenth of the time it has waited, a millisecond at most.
    """
    arrived, began = comm.Ibarrier(), time.perf_counter()
    while not arrived.Test():
        time.sleep(min(1e-3, 0.1 * (time.perf_counter() - began)))


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
    *,
    costs: Sequence[float] | None = None,
    observe: Callable[[int], None] | None = None,
) -> list[T]:
    """Do tasks of a list on all ranks; a single one on rank 0 with all cores of its node.

    Args:
        comm: MPI communicator (mpi4py), or None.
        count: Number of tasks.
        work: Does the task of an index; must not communicate itself.
        costs: What the tasks cost, relative to each other, the same on all ranks; see
            `distributed`.
        observe: Called on every rank after each task of its own, with the number of tasks that all
            ranks have done by then if they are equally quick.

    Returns:
        The results of all tasks in their order, on every rank.

    Raises:
        Exception: The first failing rank's error, on every rank.

    Note:
        Collective.
    """
    rank, size = place_in(comm)
    parts = distributed(count, size, costs)

    def work_off() -> list[T]:
        results = []
        for turn, index in enumerate(parts[rank]):
            results.append(work(index))
            if observe is not None:
                observe(min(size * (turn + 1), count))
        return results

    if size == 1:
        gathered = [work_off()]
    elif count == 1:
        return on_root_alone(comm, work_off)
    else:
        done = _attempt(work_off)
        _sleep_until_all_arrive(comm)
        outcomes = comm.allgather(done)
        failures = [error for _, error in outcomes if error is not None]
        if failures:
            raise failures[0]
        gathered = [result for result, _ in outcomes]
    results = dict(zip(chain(*parts), chain(*gathered), strict=True))
    return [results[index] for index in range(count)]


def place_in(comm: Any) -> tuple[int, int]:
    """Return rank and size of a communicator; None is one of a process on its own."""
    return (0, 1) if comm is None else (comm.rank, comm.size)


def distributed(count: int, ranks: int, costs: Sequence[float] | None = None) -> list[list[int]]:
    """Distribute tasks over ranks: the costliest first, each to the rank with the least to do.

    The last rank then ends at most a third later than with the best of all distributions.

    Args:
        count: Number of tasks.
        ranks: Number of ranks.
        costs: What the tasks cost, shape (count,); all the same when not given.

    Returns:
        The tasks of every rank, in the order in which it does them.

    Source:
        Graham 1969, doi 10.1137/0117039.
    """
    costs = [1.0] * count if costs is None else costs
    parts: list[list[int]] = [[] for _ in range(ranks)]
    ahead = [(0.0, rank) for rank in range(ranks)]  # what each has to do
    for index in sorted(range(count), key=lambda task: -costs[task]):
        load, rank = heappop(ahead)
        parts[rank].append(index)
        heappush(ahead, (load + costs[index], rank))
    return parts


def _attempt(work: Callable[[], T]) -> tuple[T | None, Exception | None]:
    """Return the result or the error of some work."""
    try:
        return work(), None
    except Exception as error:  # passed on by the caller on every rank
        return None, error
