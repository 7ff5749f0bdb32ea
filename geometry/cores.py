"""How many cores this process may use, and work in as many threads.

The number is ``OMP_NUM_THREADS`` where that is set, as batch systems and users do. Otherwise it is
the cores that the operating system grants this process, shared with the ranks beside it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import Any, TypeVar

Result = TypeVar("Result")

_RANKS_HERE = ("OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "SLURM_NTASKS_PER_NODE")
"""Variables that MPI and Slurm set to the number of ranks on this node."""
_borrowed = 0
_pool: tuple[int, ThreadPoolExecutor] | None = None


def own_cores() -> int:
    """Return the number of cores that this process may use by itself."""
    stated = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0].strip()
    if stated.isdigit() and int(stated) > 0:
        return int(stated)
    return max(1, _granted() // _ranks_here())


def node_cores() -> int:
    """Return the number of cores that this process may use while the ranks beside it wait."""
    return max(1, min(own_cores() * _ranks_here(), _granted()))


def _ranks_here() -> int:
    beside = (os.environ.get(name, "") for name in _RANKS_HERE)
    return next((int(text) for text in beside if text.isdigit() and int(text) > 0), 1)


def _granted() -> int:
    """Return the cores that the operating system grants this process."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def cores() -> int:
    """Return the number of cores for the work at hand: this process's own, or those it was lent."""
    return _borrowed or own_cores()


@contextmanager
def lent(count: int) -> Iterator[None]:
    """Give this process the cores of ranks that wait meanwhile.

    Args:
        count: All cores that it may use.
    """
    global _borrowed
    before, _borrowed = _borrowed, count
    try:
        yield
    finally:
        _borrowed = before


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
    helping = [_pool[1].submit(share) for _ in range(others)] if _pool is not None else []
    try:
        share()
    finally:
        wait(helping)
    for helper in helping:
        helper.result()
    return [results[task] for task in range(len(listed))]
