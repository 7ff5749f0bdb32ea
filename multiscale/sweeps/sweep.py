"""Runs the cases of a sweep, shared among the ranks of a communicator and the parts of a job."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from multiscale.loading.load_step import LoadStep
from multiscale.results.history import COLUMNS
from multiscale.run import Run
from multiscale.scene.identity import identity
from multiscale.scene.scene import Scene
from multiscale.sweeps.cases import Case, SweepCases, sweep_cases
from multiscale.sweeps.journal import CaseResult, Journal
from multiscale.sweeps.sweep_results import SweepResults
from multiscale.sweeps.tasks import TaskCounter
from support.collective import on_root, together
from support.errors import InputError, NotConverged

JOURNAL = "cases"
"""Folder of the cases that are done, within the folder of a sweep."""


def sweep(
    scene: Scene,
    vary: Mapping[str, Iterable[Any]],
    comm: Any = None,
    *,
    folder: str | Path | None = None,
    part: tuple[int, int] = (1, 1),
    observe: Callable[[Case, CaseResult], None] | None = None,
) -> SweepResults:
    """Run a scene for all combinations of values of its keys.

    Each rank takes the next case as soon as it is free. No case starts from another one, so that
    the results do not depend on the number of ranks, to the last bit. Cases that differ in
    ``block.young_modulus`` alone, under given approaches, are solved once: the body is linearly
    elastic. A case that does not converge is recorded and does not end the sweep.

    Args:
        scene: The scene that all cases start from.
        vary: Values by dotted key, as ``{"surface.spectrum.seed": range(20)}``.
        comm: MPI communicator (mpi4py); None runs on this process alone.
        folder: Folder where cases that are done are stored, in one file for each rank, so that the
            next call goes on from them, on any number of ranks; None stores nothing.
        part: This call runs the k-th of n parts of the cases, as one job of many; from 1.
        observe: Called on its rank with every case that is done now.

    Returns:
        The results of all cases that are done, those of other parts too. They stay on the ranks
        that have found or read them.

    Raises:
        InputError: When a case's scene is wrong, or the folder holds cases of another scene.

    Note:
        Collective.
    """
    which, parts = part
    if not 1 <= which <= parts:
        raise InputError("is no part of a sweep", value=f"{which}/{parts}", allowed="1/n … n/n")
    rank, size = (0, 1) if comm is None else (comm.rank, comm.size)
    cases = together(comm, lambda: _checked_cases(scene, vary, rank, size))
    base = on_root(comm, lambda: identity(scene))
    journal = Journal(None if folder is None else Path(folder) / JOURNAL, base)
    mine, done = _read(journal, cases, comm)
    own = cases.groups()[which - 1 :: parts]
    ahead = [group for group in own if not done.issuperset(group)]
    counter = TaskCounter(comm, len(ahead))

    def work() -> None:
        with journal.appending(part_name(part), f"rank-{rank}") as store:
            for task in counter:
                group = [cases[number] for number in ahead[task]]
                for case, found in _run_group(group, done, counter.progress):
                    result = replace(found, files=cases.files(case))
                    store(result)
                    mine[case.number] = result
                    if observe is not None:
                        observe(case, result)

    try:
        together(comm, work)
    except Exception:  # on all ranks alike; a signal ends one of them, and `close` would wait
        counter.close()
        raise
    counter.close()
    if parts > 1:
        known = done | _of_all(comm, mine)
        others, _ = _read(journal, cases, comm)
        mine |= {number: result for number, result in others.items() if number not in known}
    return SweepResults(cases=cases, mine=mine, comm=comm)


def _checked_cases(
    scene: Scene, vary: Mapping[str, Iterable[Any]], rank: int, size: int
) -> SweepCases:
    """Return the cases; each rank makes the scenes of some, so that wrong ones are found."""
    cases = sweep_cases(scene, vary)
    for number in range(rank, len(cases), size):
        _ = cases[number].scene
    return cases


def _read(journal: Journal, cases: SweepCases, comm: Any) -> tuple[dict[int, CaseResult], set[int]]:
    """Read what is done, each rank from some of the files; return its own, and the numbers of all.

    A case that several files hold belongs to the rank that has the first of them.
    """
    rank, size = (0, 1) if comm is None else (comm.rank, comm.size)
    files = on_root(comm, journal.files)

    def read() -> dict[int, CaseResult]:
        found: dict[int, CaseResult] = {}
        for result in journal.read(files[rank::size]):
            number = cases.number_of(result.case)
            if number is None:
                continue
            now = cases.files(cases[number])
            for key in now:
                if now[key] != result.files.get(key):
                    raise InputError(
                        f"has another content than when case {number} was computed; begin anew "
                        "with --overwrite or in another folder", key=key,
                        value=str(cases[number].scene.files()[key]),
                    )  # fmt: skip
            found.setdefault(number, result)
        return found

    mine = together(comm, read)
    if size == 1:
        return mine, set(mine)
    held: list[list[int]] = comm.allgather(sorted(mine))
    before = {number for numbers in held[:rank] for number in numbers}
    first = {number: one for number, one in mine.items() if number not in before}
    return first, set().union(*held)


def _of_all(comm: Any, mine: Mapping[int, CaseResult]) -> set[int]:
    """Return the numbers of the cases that any rank holds."""
    held = [list(mine)] if comm is None else comm.allgather(list(mine))
    return {number for numbers in held for number in numbers}


def _run_group(
    group: Sequence[Case], done: set[int], progress: Callable[[], None]
) -> Iterator[tuple[Case, CaseResult]]:
    """Yield the results of those cases of a group that are not done yet."""
    scene = group[0].scene
    steps, notes, failure = _load_steps(scene, progress)
    for case in group:
        if case.number not in done:
            ratio = _modulus(case.scene) / _modulus(scene) if len(group) > 1 else 1.0
            scaled = steps if ratio == 1.0 else [step.with_modulus(ratio) for step in steps]
            rows = [[_plain(column.of(step)) for column in COLUMNS] for step in scaled]
            yield case, CaseResult(case=case.name, rows=rows, notes=notes, failure=failure)


def _load_steps(
    scene: Scene, progress: Callable[[], None]
) -> tuple[list[LoadStep], tuple[str, ...], str]:
    """Run a scene on this process; return its load steps, notes, and why it ended early."""
    run, failure = Run(scene), ""
    try:
        for _ in run.load_steps():
            progress()
    except NotConverged as error:
        failure = str(error)
    history = run.history()
    run.close()
    return list(history.steps), history.notes, failure


def part_name(part: tuple[int, int]) -> str:
    """Return the name of a part of a sweep, the k-th of n, in the folder of its cases."""
    which, parts = part
    return f"{which}-of-{parts}"


def _modulus(scene: Scene) -> float:
    """Return Young's modulus of the block; any number where the body is a mesh."""
    return scene.block.young_modulus if scene.block else 1.0


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value
