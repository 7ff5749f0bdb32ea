"""Runs the cases of a sweep, shared among the ranks of a communicator and the parts of a job."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from geometry.collective import on_root, together
from geometry.errors import InputError, NotConverged
from multiscale.loading.load_step import LoadStep
from multiscale.results.history import COLUMNS
from multiscale.run import Run
from multiscale.scene.scene import Scene
from multiscale.sweeps.cases import Case, grouped, sweep_cases
from multiscale.sweeps.journal import CaseResult, Journal
from multiscale.sweeps.sweep_results import SweepResults

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

    Each rank runs cases of its own; the results do not depend on the number of ranks. Cases that
    differ in ``block.young_modulus`` alone, under given approaches, are solved once: the body is
    linearly elastic. A case that does not converge is recorded and does not end the sweep.

    Args:
        scene: The scene that all cases start from.
        vary: Values by dotted key, as ``{"surface.spectrum.seed": range(20)}``.
        comm: MPI communicator (mpi4py); None runs on this process alone.
        folder: Folder where cases that are done are stored, so that the next call goes on from
            them; None stores nothing.
        part: This call runs the k-th of n parts of the cases, as one job of many; from 1.
        observe: Called on its rank with every case that is done now.

    Returns:
        The results of all cases that are done, those of other parts too, the same on every rank.

    Raises:
        InputError: When a case's scene is wrong, or the folder holds cases of another scene.

    Note:
        Collective.
    """
    which, parts = part
    if not 1 <= which <= parts:
        raise InputError("is no part of a sweep", value=f"{which}/{parts}", allowed="1/n … n/n")
    rank, size = (0, 1) if comm is None else (comm.rank, comm.size)
    cases = together(comm, lambda: sweep_cases(scene, vary))
    stored = None if folder is None else Path(folder) / JOURNAL
    journal = Journal(stored, _identity(scene))
    done = on_root(comm, journal.read)
    own = grouped(cases)[which - 1 :: parts]
    ahead = [group for group in own if any(case.name not in done for case in group)]

    def work() -> dict[str, CaseResult]:
        found = {}
        with journal.appending(f"{which}-of-{parts}-rank-{rank}") as store:
            for case, result in _run_groups(ahead[rank::size], done):
                store(result)
                found[result.case] = result
                if observe is not None:
                    observe(case, result)
        return found

    mine = together(comm, work)
    for found in [mine] if comm is None else comm.allgather(mine):
        done |= found
    if parts > 1:
        done |= on_root(comm, journal.read)
    return SweepResults(cases=cases, results=[done.get(case.name) for case in cases])


def _run_groups(
    groups: Sequence[Sequence[Case]], done: Mapping[str, CaseResult]
) -> Iterator[tuple[Case, CaseResult]]:
    """Yield the results of groups of cases that are not done yet."""
    for group in groups:
        first = group[0]
        steps, notes, failure = _load_steps(first.scene)
        for case in group:
            if case.name not in done:
                ratio = _modulus(case.scene) / _modulus(first.scene)
                scaled = steps if ratio == 1.0 else [step.with_modulus(ratio) for step in steps]
                rows = [[_plain(column.of(step)) for column in COLUMNS] for step in scaled]
                yield case, CaseResult(case=case.name, rows=rows, notes=notes, failure=failure)


def _load_steps(scene: Scene) -> tuple[list[LoadStep], tuple[str, ...], str]:
    """Run a scene on this process; return its load steps, notes, and why it ended early."""
    run, failure = Run(scene), ""
    try:
        for _ in run.load_steps():
            pass
    except NotConverged as error:
        failure = str(error)
    history = run.history()
    run.close()
    return list(history.steps), history.notes, failure


def _identity(scene: Scene) -> str:
    """Return a short text that differs between scenes whose load steps may differ."""
    drawn = {"output": {"figures", "report", "fields"}}
    return hashlib.sha256(scene.model_dump_json(by_alias=True, exclude=drawn).encode()).hexdigest()


def _modulus(scene: Scene) -> float:
    """Return Young's modulus of the block; any number where the body is a mesh."""
    return scene.block.young_modulus if scene.block else 1.0


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value
