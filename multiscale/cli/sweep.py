"""The command ``patchlaw sweep``."""

from __future__ import annotations

import argparse
import itertools
import math
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from multiscale.cli.execution import scene_and_folder
from multiscale.cli.words import SWEEP_ENDING
from multiscale.output import terminal
from multiscale.output.results import pictures_of, write_pictures
from multiscale.restart.results_folder import locked
from multiscale.sweeps.cases import Case, sweep_cases, values_from_text
from multiscale.sweeps.journal import CaseResult
from multiscale.sweeps.sweep import JOURNAL, part_name, sweep
from multiscale.sweeps.sweep_results import SweepResults
from support.collective import on_root
from support.errors import InputError, NotConverged
from support.whole_files import remove, write_csv

MOST_LINES = 20
"""Ensembles that are told in the terminal; the files hold all of them."""

FILES = ("cases.csv", "history.csv", "statistics.csv", "sweep.png", "sweep.svg")
"""Files of the results of a sweep."""


def sweep_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Run a scene for many values of its keys; write all load steps and their statistics.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    scene, folder = scene_and_folder(choice, comm, ending=SWEEP_ENDING)
    vary = dict(values_from_text(text) for text in choice.vary)
    which, parts = choice.part or slurm_part()
    with locked(folder / JOURNAL / part_name((which, parts)), comm):
        if choice.overwrite:
            on_root(comm, lambda: _remove_results(folder))
        cases = on_root(comm, lambda: len(sweep_cases(scene, vary)))
        ranks = parts * (1 if comm is None else comm.size)
        terminal.say(comm, f"{cases} cases on {ranks} rank{'s' * (ranks > 1)}")
        pace, last = terminal.Pace(math.ceil(cases / ranks)), time.monotonic()
        with terminal.following(comm) as (begun, ended):

            def observe(case: Case, result: CaseResult) -> None:
                nonlocal last
                spent, last = time.monotonic() - last, time.monotonic()
                begun(f"case {case.number} is done{pace.left(spent)}")
                if result.failure:
                    ended(f"case {case.number}: {result.failure}")

            found = sweep(scene, vary, comm, folder=folder, part=(which, parts), observe=observe)
        files = _write(folder, found, comm, figures=bool(scene.output.figures))
    for text in _summary(found):
        terminal.say(comm, text)
    terminal.show_files(comm, files)
    if found.unfinished:
        terminal.say(comm, f"{found.unfinished} of {len(found)} cases are left to other parts")
    if failures := found.failures:
        name, reason = next(iter(failures.items()))
        raise NotConverged(
            f"{len(failures)} of {len(found)} cases, the first with {name}: {reason}",
            reason="CASES_FAILED",
            iterations=0,
            remedy="cases.csv has the reason of each",
        )


def slurm_part() -> tuple[int, int]:
    """Return the part of the sweep that a task of a Slurm array runs; the whole outside of one."""
    names = ("SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_MIN", "SLURM_ARRAY_TASK_COUNT")
    if not all(name in os.environ for name in names):
        return 1, 1
    task, first, count = (int(os.environ[name]) for name in names)
    step = int(os.environ.get("SLURM_ARRAY_TASK_STEP", 1))
    return (task - first) // step + 1, count


def _remove_results(folder: Path) -> None:
    for path in [*(folder / JOURNAL).glob("*/*.cases"), *(folder / name for name in FILES)]:
        remove(path)


def _write(folder: Path, found: SweepResults, comm: Any, *, figures: bool) -> list[Path]:
    """Write the tables and the figure of the cases that are done; rank 0 writes for all."""
    files = [
        *_write_table(folder / "cases.csv", found.case_records(), comm),
        *_write_table(folder / "history.csv", found.records(), comm),
    ]
    statistics = _statistics_records(found)
    files += _write_table(folder / "statistics.csv", iter(statistics), comm)
    if figures and statistics:
        pictures = pictures_of("sweep", found.plot)
        if pictures.problem:
            terminal.say(comm, pictures.problem)
        files += on_root(comm, lambda: write_pictures(folder, pictures.files))
    return files


def _write_table(path: Path, records: Iterator[dict[str, Any]], comm: Any) -> list[Path]:
    """Write records as they come from all ranks; none make no file. All ranks fail together."""

    def write() -> list[Path]:
        first = next(records, None)
        if first is None or not (comm is None or comm.rank == 0):
            return []
        rows = (list(record.values()) for record in itertools.chain([first], records))
        return [write_csv(path, list(first), rows)]

    files: list[Path] = []
    failure: Exception | None = None
    try:
        files = write()
    except Exception as error:  # the other ranks still send what they have
        failure = error
    for _ in records:
        pass

    def outcome() -> list[Path]:
        if failure is not None:
            raise failure
        return files

    return on_root(comm, outcome)


def _summary(found: SweepResults) -> Iterator[str]:
    """Yield a line on the last load step of each ensemble."""
    yield f"{len(found) - found.unfinished} of {len(found)} cases are done"
    records = _statistics_records(found)
    last = max((record["step"] for record in records), default=0)
    chosen = {
        name: [one for one in records if one["step"] == last and one["column"] == name]
        for name in ("force_N", "approach_mm")
    }
    pairs = zip(chosen["force_N"], chosen["approach_mm"], strict=True)
    for force, approach in itertools.islice(pairs, MOST_LINES):
        values = "".join(f"{key} = {force[key]}, " for key in found.keys if key in force)
        yield (f"{values}at last: force {_spread(force)} N, approach {_spread(approach, 1e3)} µm")


def _spread(record: dict[str, Any], scale: float = 1.0) -> str:
    """Return a mean and, where the cases of an ensemble differ, the band about it."""
    low, middle, high = (scale * record[name] for name in ("low", "mean", "high"))
    same = high - low <= 1e-6 * abs(middle)
    return f"{middle:.4g}" if same else f"{middle:.4g} (5 to 95 %: {low:.4g} … {high:.4g})"


def _statistics_records(found: SweepResults) -> list[dict[str, Any]]:
    """Return the statistics; none before all cases are done, or where steps were halved."""
    try:
        return [] if found.unfinished else found.statistics_records()
    except InputError:
        return []
