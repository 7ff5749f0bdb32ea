"""The command ``patchlaw sweep``."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from multiscale.cli.execution import scene_and_folder
from multiscale.cli.words import SWEEP_ENDING
from multiscale.figures.files import Drawing, file_kinds, write_figure
from multiscale.output import terminal
from multiscale.output.results import write_records
from multiscale.progress import case_progress
from multiscale.restart.results_folder import locked
from multiscale.studies.cases import sweep_cases, values_from_text
from multiscale.studies.running import JOURNAL, part_name
from multiscale.studies.sweep import Statistics, SweepResults, sweep
from support.collective import on_root, place_in
from support.errors import InputError, NotConverged
from support.whole_files import remove

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
        ranks = parts * place_in(comm)[1]
        terminal.say(comm, f"{cases} cases on {ranks} rank{'s' * (ranks > 1)}")
        with case_progress(comm, cases, parts) as observe:
            done = sweep(scene, vary, comm, folder=folder, part=(which, parts), observe=observe)
        files = on_root(comm, lambda: _write(folder, done, scene.output.figures))
    for text in _summary(done):
        terminal.say(comm, text)
    terminal.show_files(comm, files)
    if done.unfinished:
        terminal.say(comm, f"{done.unfinished} of {len(done)} cases are left to other parts")
    if failures := done.failures:
        name, reason = next(iter(failures.items()))
        raise NotConverged(
            f"{len(failures)} of {len(done)} cases, the first with {name}: {reason}",
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


def _write(folder: Path, done: SweepResults, figures: bool | str) -> list[Path]:
    """Write the tables and the figure of the cases that are done."""
    statistics = done.statistics_records() if _statistics(done) else []
    files = [
        write_records(folder / f"{name}.csv", records)
        for name, records in (
            ("cases", done.case_records()),
            ("history", done.records()),
            ("statistics", iter(statistics)),
        )
    ]
    if figures and statistics:
        drawing = Drawing("sweep", "studies.figures.sweep_figure", (done,), file_kinds(figures))
        files += write_figure(folder, drawing, partial(terminal.say, None))
    return [path for path in files if path is not None]


def _summary(done: SweepResults) -> Iterator[str]:
    """Yield a line on the last load step of each ensemble."""
    yield f"{len(done) - done.unfinished} of {len(done)} cases are done"
    for values, part in _statistics(done)[:20]:  # the files hold all of them
        said = "".join(f"{key} = {value}, " for key, value in values.items())
        force, approach = _spread(part, "force_N"), _spread(part, "approach_mm", 1e3)
        yield f"{said}at last: force {force} N, approach {approach} µm"


def _spread(part: Statistics, column: str, scale: float = 1.0) -> str:
    """Return a mean and, where the cases of an ensemble differ, the band about it."""
    low, middle, high = (scale * part.of(column, name)[-1] for name in ("low", "mean", "high"))
    same = high - low <= 1e-6 * abs(middle)
    return f"{middle:.4g}" if same else f"{middle:.4g} (5 to 95 %: {low:.4g} … {high:.4g})"


def _statistics(done: SweepResults) -> list[tuple[dict[str, Any], Statistics]]:
    """Return the statistics of ensembles; none before all are done, or where steps were halved."""
    try:
        return [] if done.unfinished else [one for one in done.statistics if len(one[1].values)]
    except InputError:
        return []
