"""Runs many scenes on the ranks of a communicator and in the parts of a job, with a journal.

Each rank takes the next case as soon as it is free: its number is in the memory of rank 0, where
every rank reads and raises it in one step (one-sided communication of MPI), so that no rank only
hands out cases. No case starts from another one, so that the results do not depend on the number
of ranks, to the last bit.

A case that is done is a record in a file of the rank that ran it, which the next call reads. Any
number of processes and of jobs may so work on one study without waiting for each other, and a kill
costs no more than the cases that were under way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.multiscale.loading.load_step import COLUMNS
from patchlaw.multiscale.results.history import History
from patchlaw.multiscale.runs.output.results_folder import locked
from patchlaw.multiscale.runs.scene_run import Run
from patchlaw.multiscale.scene.scene import Scene, changes, told
from patchlaw.support import InputError, NotConverged, on_root, place_in, together
from patchlaw.support.files import append, plain, read_bytes, unsealed, written
from patchlaw.support.readable import Caution, unobserved

JOURNAL = "cases"
"""Folder of the cases that are done, within the folder of a study."""

REPEATABLE = ("done", "not converged", "refused")
"""How cases end that would end in the same way again: these alone are stored."""

_SUFFIX = ".cases"


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseResult:
    """What a case came to.

    Attributes:
        case: Key of the case, which says everything that its results depend on.
        rows: The rows of its ``history.csv``: a value for every column.
        notes: Remarks of the run on its own approximations.
        warnings: What a user should know about the validity of the scene, without cautions.
        cautions: Cautions of the scene and of the run.
        status: How the run ended; one of `REPEATABLE`, or why the case has no result for now.
        failure: Why the case ended early; empty when it did not.
        measured: What else was measured of the run, see `multiscale.runs.comparison`.
        arrays: Arrays of the load steps beside the rows, by name.
    """

    case: str = ""
    rows: Sequence[Sequence[Any]] = ()
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    cautions: Sequence[str] = ()
    status: str = "done"
    failure: str = ""
    measured: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def run_case(
    scene: Scene,
    *,
    progress: Callable[[], None] = lambda: None,
    describe: Callable[[Run, History], Mapping[str, Any]] = lambda run, history: {},
) -> CaseResult:
    """Run a scene on this process, to its end or to where it does not converge.

    Args:
        scene: The scene.
        progress: Called every now and then.
        describe: Returns further fields of the result.
    """
    run, status, failure = Run(scene), "done", ""
    try:
        run.clock.observe = lambda *_: progress()
        for _ in run.load_steps():
            progress()
    except NotConverged as error:
        status, failure = "not converged", str(error)
    history = run.history()
    rows = [[plain(column.of(step)) for column in COLUMNS] for step in history.steps]
    more = describe(run, history)
    said = [*run.coupling.about.warnings(), *history.notes]
    cautions = list(dict.fromkeys(str(one) for one in said if isinstance(one, Caution)))
    run.close()
    return CaseResult(
        rows=rows,
        notes=history.notes,
        warnings=[one for one in run.coupling.about.warnings() if not isinstance(one, Caution)],
        cautions=cautions,
        status=status,
        failure=failure,
        **more,
    )


def run_cases(
    cases: Sequence[Any],
    solve: Callable[[Any, Callable[[], None]], CaseResult],
    journal: Journal,
    comm: Any = None,
    *,
    part: tuple[int, int] = (1, 1),
    observe: Callable[[Any, CaseResult], object] | None = None,
) -> dict[int, CaseResult]:
    """Run the cases of a study that are not done yet.

    Args:
        cases: All cases, each with a `key` that says everything that its results depend on.
        solve: Runs one; it is also given what to call every now and then.
        journal: Where the results are stored.
        comm: MPI communicator (mpi4py); None for a process on its own.
        part: This call runs the k-th of n parts of the cases; from 1.
        observe: Called on its rank with every case that is done now.

    Returns:
        The results of all cases that are done, on every rank, by number.

    Raises:
        InputError: When another process runs the same part in the folder of the journal, or what
            shares that with no study.

    Note:
        Collective.
    """
    (which, parts), (rank, _) = part, place_in(comm)
    with journal.held(comm, part):
        mine, done = _read(journal, cases, comm)
        ahead = [number for number in range(which - 1, len(cases), parts) if number not in done]
        store = together(comm, lambda: journal.writer(part, rank))
        counter = TaskCounter(comm, len(ahead))

        def work() -> None:
            for task in counter:
                case = cases[ahead[task]]
                result = replace(solve(case, counter.progress), case=case.key)
                if result.status in REPEATABLE:
                    store(result)
                mine[ahead[task]] = result
                (observe or unobserved)(case, result)

        try:
            together(comm, work)
        except Exception:  # on all ranks alike; a signal ends one of them, and `close` would wait
            counter.close()
            raise
        counter.close()
        if parts > 1:  # other jobs have done more in the meantime
            mine, _ = _read(journal, cases, comm)
    held = [mine] if comm is None else comm.allgather(mine)
    return {number: one for share in held for number, one in share.items()}


class Journal:
    """Files with a record for every case that is done; every process appends to its own.

    Args:
        folder: Folder of the study; None stores nothing.
        identity: What all cases have in common; cases of another one are refused.
    """

    def __init__(self, folder: str | Path | None, identity: Mapping[str, Any]) -> None:
        self._folder = None if folder is None else Path(folder) / JOURNAL
        self._identity = dict(identity)

    @contextmanager
    def held(self, comm: Any, part: tuple[int, int]) -> Iterator[None]:
        """Hold the locks on the folder of the study, which other parts share, and on a part.

        Args:
            comm: MPI communicator, or None.
            part: The part of the study, the k-th of n.

        Raises:
            InputError: When another process runs this part, or what is no part of a study.
        """
        if self._folder is None:
            yield
            return
        own = self._folder / part_name(part)
        with locked(self._folder.parent, comm, shared=True), locked(own, comm):
            yield

    def files(self) -> list[Path]:
        """Return the files that are there, in the order of their names."""
        return sorted(self._folder.glob(f"*-of-*/rank-*{_SUFFIX}")) if self._folder else []

    def read(self, path: Path) -> Iterator[CaseResult]:
        """Yield the cases that are done, from one of the files.

        Raises:
            InputError: When they are cases of another scene, or the file is damaged.
        """
        try:
            for number, (value, _) in enumerate(unsealed(read_bytes(path))):
                if number > 0:
                    yield CaseResult(**value)
                elif differing := list(changes(self._identity, value)):
                    raise InputError(
                        f"holds the cases of another scene, where {told(differing)}", key="--out",
                        value=str(path.parents[2]), allowed="another folder, or --overwrite",
                    )  # fmt: skip
        except (InputError, TypeError, OSError) as error:
            if getattr(error, "key", None):
                raise
            problem = getattr(error, "problem", "was written by another patchlaw")
            if isinstance(error, OSError):
                problem = f"cannot be read: {error.strerror}"
            raise InputError(
                f"{problem}; remove it, and its cases are computed again", file=str(path)
            ) from None

    def writer(self, part: tuple[int, int], rank: int) -> Callable[[CaseResult], None]:
        """Return the function that appends results to the file of a process.

        Args:
            part: The part of the study, the k-th of n.
            rank: Its rank among those that work on the part.
        """
        if self._folder is None:
            return lambda result: None
        path = self._folder / part_name(part) / f"rank-{rank}{_SUFFIX}"
        with written(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            records = unsealed(read_bytes(path) if path.exists() else b"")
            end = max((behind for _, behind in records), default=0)

        def store(result: CaseResult) -> None:
            nonlocal end
            end = end or append(path, self._identity, 0)
            facts = {one.name: getattr(result, one.name) for one in fields(result)}
            end = append(path, facts, end)

        return store


class TaskCounter:
    """The tasks that no rank has taken yet.

    Args:
        comm: MPI communicator (mpi4py); None for a process on its own.
        count: Number of tasks.

    Note:
        Construction and `close` are collective; what lies between is not.
    """

    def __init__(self, comm: Any, count: int) -> None:
        self._comm, self._count, self._window = comm, count, None
        self._rank, self._size = place_in(comm)
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
            index = index + 1 if self._window is None else self._next(self._window)

    def _next(self, window: Any) -> int:
        one, taken = np.ones(1, np.int64), np.zeros(1, np.int64)
        window.Lock(0, self._shared)
        window.Fetch_and_op(one, taken, 0, 0, self._sum)
        window.Unlock(0)
        return int(taken[0])

    def progress(self) -> None:
        """Let MPI serve other ranks, on networks that need this rank's help; takes microseconds."""
        if self._window is not None:
            self._comm.Iprobe()

    def close(self) -> None:
        """Free the counter, after all ranks have come here."""
        if self._window is not None:
            self._window.Free()
            self._window = None


def _read(
    journal: Journal, cases: Sequence[Any], comm: Any
) -> tuple[dict[int, CaseResult], set[int]]:
    """Read what is done, each rank from some of the files; return its own, and the numbers of all.

    A case that several files hold belongs to the rank that has the first of them.
    """
    rank, size = place_in(comm)
    files = on_root(comm, journal.files)
    numbers = {case.key: number for number, case in enumerate(cases)} if files else {}

    def read() -> dict[int, CaseResult]:
        known = (one for path in files[rank::size] for one in journal.read(path))
        return {numbers[one.case]: one for one in known if one.case in numbers}

    mine = together(comm, read)
    held = [sorted(mine)] if size == 1 else comm.allgather(sorted(mine))
    before = {number for numbers in held[:rank] for number in numbers}
    first = {number: one for number, one in mine.items() if number not in before}
    return first, set().union(*held)


def part_name(part: tuple[int, int]) -> str:
    """Return the name of a part of a study, the k-th of n, in the folder of its cases."""
    which, parts = part
    return f"{which}-of-{parts}"
