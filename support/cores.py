"""How many cores this process may use, and work in as many threads.

The number is ``OMP_NUM_THREADS`` where that is set, as batch systems and users do, or the cores
that Slurm gives each task. Otherwise it is the cores that the operating system grants this process,
shared with the ranks beside it. Ranks that wait lend theirs to those of their node that work.
"""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import cache
from typing import Any, NamedTuple, TypeVar

Result = TypeVar("Result")

BLOCK = 2**20
"""Bytes of the rows or columns that are transformed at a time, so that they stay in the cache of a
core; blocks of half or twice the size take 5 to 60 % longer on grids of 4096²."""
_RANKS_HERE = ("OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "MV2_COMM_WORLD_LOCAL_SIZE")
"""Variables that launchers set to the number of ranks on this node: Open MPI's mpirun; Hydra, of
MPICH and Intel MPI; MVAPICH."""
_SLURM_TASKS = "SLURM_STEP_TASKS_PER_NODE"
"""Variable that Slurm's srun sets to the numbers of tasks on all nodes, such as ``4(x2),3``."""
_borrowed = 0
_pool: tuple[int, ThreadPoolExecutor] | None = None


class Place(NamedTuple):
    """Where a rank computes.

    Attributes:
        node: Name of its node.
        granted: Numbers of the cores that the operating system grants it.
        own: How many it may use by itself.
    """

    node: str
    granted: frozenset[int]
    own: int


def own_cores() -> int:
    """Return the number of cores that this process may use by itself."""
    for name in ("OMP_NUM_THREADS", "SLURM_CPUS_PER_TASK"):
        if stated := _count(os.environ.get(name, "").partition(",")[0].strip()):
            return stated
    return max(1, len(_granted()) // _ranks_here())


def place() -> Place:
    """Return where this process computes."""
    return Place(platform.node(), _granted(), own_cores())


def lendable(places: Sequence[Place], working: Collection[int], rank: int) -> Place:
    """Return where a rank computes while some ranks work and all others wait.

    Args:
        places: Where all ranks compute by themselves.
        working: The ranks that work; those of one node share what the others there lend.
        rank: One of them.
    """
    here = [k for k, one in enumerate(places) if one.node == places[rank].node]
    granted = frozenset().union(*(places[k].granted for k in here))
    all_own = min(sum(places[k].own for k in here), len(granted))
    share = all_own // sum(k in working for k in here)
    if share <= places[rank].own:
        return places[rank]
    return Place(places[rank].node, granted, share)


def _ranks_here() -> int:
    for name in _RANKS_HERE:
        if count := _count(os.environ.get(name, "")):
            return count
    tasks = []
    for count, _, repeated in re.findall(r"(\d+)(\(x(\d+)\))?", os.environ.get(_SLURM_TASKS, "")):
        tasks += [int(count)] * int(repeated or 1)
    node = _count(os.environ.get("SLURM_NODEID", ""))
    return max(1, tasks[node]) if node < len(tasks) else 1


def _count(text: str) -> int:
    """Return the number that a text is; 0 for any other text."""
    return int(text) if text.isdecimal() else 0


def _granted() -> frozenset[int]:
    """Return the cores that the operating system grants this process."""
    if hasattr(os, "sched_getaffinity"):
        return frozenset(os.sched_getaffinity(0))
    return frozenset(range(os.cpu_count() or 1))


def cores() -> int:
    """Return the number of cores for the work at hand: this process's own, or those it was lent."""
    return _borrowed or own_cores()


@contextmanager
def lent(count: int, granted: Collection[int] = ()) -> Iterator[None]:
    """Give this process the cores of ranks that wait meanwhile, for threads of ours and of BLAS.

    Args:
        count: How many it may use, its own included.
        granted: Numbers of all of them, where launchers bind ranks to cores: its threads may then
            leave those that it is bound to.
    """
    global _borrowed
    before, _borrowed = _borrowed, count
    try:
        with _bound_to(granted), blas_threads(count):
            yield
    finally:
        _borrowed = before


@contextmanager
def _bound_to(wanted: Collection[int]) -> Iterator[None]:
    """Bind this thread, and those that it starts, to some cores; leave it as it is for none."""
    bound = _granted()
    if not wanted or bound == wanted:
        yield
        return
    with suppress(OSError):  # a container may refuse
        os.sched_setaffinity(0, wanted)
    try:
        yield
    finally:
        with suppress(OSError):
            os.sched_setaffinity(0, bound)


def hold_blas() -> None:
    """Let BLAS take as many threads as this process may, for the rest of it.

    By default it takes a thread for every core of the node, on every rank.
    """
    blas_threads(own_cores())


def blocks(count: int, size: int) -> list[slice]:
    """Return ranges that divide a number of rows; work on them does not depend on the threads.

    Args:
        count: Number of rows.
        size: Rows in a range, the last one may have fewer; at least one.
    """
    size = max(1, size)
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
    global _pool
    count, listed = cores(), list(tasks)
    results: dict[int, Result] = {}
    todo = iter(range(len(listed)))

    def share() -> None:
        for task in todo:  # whoever is free takes the next
            results[task] = work(listed[task])

    others = min(count, len(listed)) - 1
    if others > 0 and (_pool is None or _pool[0] != count):
        _pool = count, ThreadPoolExecutor(count)
    if others <= 0 or _pool is None:
        share()
    else:
        with blas_threads(1):
            helping = [_pool[1].submit(share) for _ in range(others)]
            try:
                share()
            finally:
                wait(helping)
        for helper in helping:
            helper.result()
    return [results[task] for task in range(len(listed))]


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
