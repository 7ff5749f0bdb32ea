"""Work on ranks that succeeds or fails on all of them together, and in as many threads as may be.

The cores of a process are ``OMP_NUM_THREADS`` where that is set, as batch systems and users do, or
those that Slurm gives each task. Otherwise they are the cores that the operating system grants this
process, shared with the ranks beside it. What one rank does for all, while the others wait, takes
the cores of all ranks of its node.

Only mpi4py's lower-case methods of the communicator are used, so that nothing here imports MPI.
``None`` stands for a single process.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import cache
from heapq import heappop, heappush
from itertools import chain
from typing import Any, NamedTuple, TypeVar

Result = TypeVar("Result")

BLOCK = 2**20
"""Bytes of the rows or columns that are transformed at a time, so that they stay in the cache of a
core; blocks of half or twice the size take 5 to 60 % longer on grids of 4096²."""
_LINE = 8
"""Numbers in a line of the cache."""
_STATED = ("OMP_NUM_THREADS", "SLURM_CPUS_PER_TASK")
_RANKS_HERE = ("OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "MV2_COMM_WORLD_LOCAL_SIZE")
"""Variables that launchers set to the number of ranks on this node: Open MPI's mpirun; Hydra, of
MPICH and Intel MPI; MVAPICH."""
_allocated = 0


class NodeCores(NamedTuple):
    """The cores of the ranks on one node.

    Attributes:
        nodes: Number of nodes that all ranks are on.
        granted: Numbers of the cores that the operating system grants these ranks.
        threads: How many threads all of them together may start by themselves.
        own: How many this process may start by itself.
    """

    nodes: int
    granted: frozenset[int]
    threads: int
    own: int

    @property
    def alone(self) -> int:
        """Threads that this process may start while the other ranks wait."""
        return max(self.own, min(self.threads, len(self.granted)))


def own_cores() -> int:
    """Return the number of cores that this process may use by itself."""
    stated = next(filter(None, map(_number, _STATED)), 0)
    return stated or max(1, len(_granted()) // _ranks_here())


def node_cores(comm: Any) -> NodeCores:
    """Return the cores of the ranks on this process's node.

    Args:
        comm: MPI communicator (mpi4py), or None.

    Note:
        Collective.
    """
    mine = platform.node(), _granted(), own_cores()
    everywhere = [mine] if comm is None else comm.allgather(mine)
    here = [(granted, own) for node, granted, own in everywhere if node == mine[0]]
    granted = frozenset[int]().union(*(each for each, _ in here))
    return NodeCores(
        nodes=len({node for node, _, _ in everywhere}),
        granted=granted,
        threads=sum(own for _, own in here),
        own=mine[2],
    )


def cores() -> int:
    """Return the number of cores for the work at hand: this process's own, or those allocated."""
    return _allocated or own_cores()


@contextmanager
def allocated(count: int, granted: Collection[int] = ()) -> Iterator[None]:
    """Let this process use a number of cores, for threads of ours and of BLAS.

    Args:
        count: The number.
        granted: Numbers of these cores; launchers bind ranks to cores, which threads that start
            meanwhile may then leave. By default they stay where the process is bound to.
    """
    global _allocated
    before, bound = _allocated, _granted()
    _allocated = count
    _bind(granted or bound)
    try:
        with blas_threads(count):
            yield
    finally:
        _allocated = before
        _bind(bound)


def hold_blas() -> None:
    """Let BLAS take as many threads as this process may, for the rest of it.

    By default it takes a thread for every core of the node, on every rank.
    """
    blas_threads(own_cores())


def _ranks_here() -> int:
    """Return the number of ranks on this node, by what their launcher tells."""
    if here := next(filter(None, map(_number, _RANKS_HERE)), 0):
        return here
    nodes = _number("SLURM_STEP_NUM_NODES")
    return max(1, -(-_number("SLURM_STEP_NUM_TASKS") // nodes)) if nodes else 1


def _number(variable: str) -> int:
    """Return the number that a variable of the environment is; 0 for anything else."""
    text = os.environ.get(variable, "").partition(",")[0].strip()
    return int(text) if text.isdecimal() else 0


def _granted() -> frozenset[int]:
    """Return the cores that the operating system grants this process."""
    if hasattr(os, "sched_getaffinity"):
        return frozenset(os.sched_getaffinity(0))
    return frozenset(range(os.cpu_count() or 1))


def _bind(wanted: Collection[int]) -> None:
    """Bind this thread, and those that it starts, to some cores."""
    with suppress(OSError, AttributeError):  # a container may refuse; not every system can
        os.sched_setaffinity(0, wanted)


def blocks(count: int, size: int, least: int = 1) -> list[slice]:
    """Return ranges that divide a number of rows; work on them does not depend on the threads.

    There is one, or an even number of about equal ones: two threads then end together.

    Args:
        count: Number of rows.
        size: Most rows in a range, apart from rounding up to lines of the cache; at least one.
        least: Number of ranges at least, where there are so many rows.
    """
    if 0 < count <= size and least == 1:
        return [slice(0, count)]
    number = max(-(-count // max(1, size)), least)
    number += number % 2 if number > 1 else 0
    size = max(1, -(-count // number))
    size = -(-size // _LINE) * _LINE if size > _LINE else size
    return [slice(first, min(first + size, count)) for first in range(0, count, size)]


def in_threads(work: Callable[[Any], Result], tasks: Iterable[Any]) -> list[Result]:
    """Do work on every task, on all cores; it gains where the work leaves Python for long.

    BLAS takes one thread in each of them.

    Args:
        work: Called with each task; its error is raised.
        tasks: The tasks.

    Returns:
        The results, in the order of the tasks.
    """
    listed = list(tasks)
    others = min(cores(), len(listed)) - 1 if len(listed) > 1 else 0
    if not others:
        return [work(task) for task in listed]
    results: dict[int, Result] = {}
    todo = iter(range(len(listed)))

    def share() -> None:
        for task in todo:  # whoever is free takes the next
            results[task] = work(listed[task])

    with blas_threads(1):
        helping = [_pool(cores()).submit(share) for _ in range(others)]
        try:
            share()
        finally:
            wait(helping)
    for helper in helping:
        helper.result()
    return [results[task] for task in range(len(listed))]


def on_rows(work: Callable[[slice], Result], shape: tuple[int, ...]) -> list[Result]:
    """Do work on all rows of an array of two axes, in blocks that stay in the cache, on all cores.

    Blocks depend on the array alone: sums over them are the same on any number of threads.

    Args:
        work: Called with the rows of each block.
        shape: Shape (nx, ny) of the array.

    Returns:
        The results, in the order of the rows.
    """
    return in_threads(work, blocks(shape[0], BLOCK // (8 * shape[1])))


def largest(values: Any) -> float:
    """Return the largest size of some values; 0 of none."""
    return max(float(values.max(initial=0.0)), -float(values.min(initial=0.0)))


@cache
def _pool(count: int) -> ThreadPoolExecutor:
    """Return threads, which are started once: that takes as long as a small transform."""
    return ThreadPoolExecutor(count)


def blas_threads(count: int) -> AbstractContextManager[object]:
    """Set how many threads BLAS takes, at once; on leaving the context as many as before.

    Threads of BLAS keep a core busy for a while after their work, which then lacks to ours. Without
    threadpoolctl, which contacts do not require, BLAS keeps the number it has.

    Args:
        count: The number.
    """
    blas = _blas()
    return nullcontext() if blas is None else blas.limit(limits=count)


@cache
def _blas() -> Any:
    """Return what sets the threads of BLAS; most work needs none, and BLAS is loaded by then."""
    try:
        from threadpoolctl import ThreadpoolController
    except ModuleNotFoundError:
        return None
    return ThreadpoolController().select(user_api="blas")


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
    observe: Callable[[int], object] = bool,
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
    parts = distributed(count, size, costs) if size > 1 or costs is not None else [range(count)]

    def work_off() -> list[T]:
        results = []
        for turn, index in enumerate(parts[rank]):
            results.append(work(index))
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
