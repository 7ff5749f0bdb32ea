"""The commands on several runs but compare: sweep and diff, and the files that studies write."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from multiscale.cli.execution import scene_and_folder
from multiscale.cli.words import DIFF_ENDING, SWEEP_ENDING
from multiscale.console import case_progress
from multiscale.figures.files import (
    Drawing,
    Pictures,
    file_kinds,
    pictures_of,
    write_pictures,
)
from multiscale.output import terminal
from multiscale.output.report import filled
from multiscale.output.results import write_records
from multiscale.output.results_folder import locked
from multiscale.studies.cases import sweep_cases, values_from_text
from multiscale.studies.difference import Difference, difference
from multiscale.studies.running import JOURNAL, part_name
from multiscale.studies.sweep import Statistics, SweepResults, sweep
from support.collective import on_root, place_in
from support.errors import InputError, NotConverged
from support.whole_files import remove, write_text

_OF_SWEEPS = ("cases.csv", "history.csv", "statistics.csv", "sweep.png", "sweep.svg")
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
        files = on_root(comm, lambda: _write_sweep(folder, done, scene.output.figures))
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
    for path in [*(folder / JOURNAL).glob("*/*.cases"), *(folder / name for name in _OF_SWEEPS)]:
        remove(path)


def _write_sweep(folder: Path, done: SweepResults, figures: bool | str) -> list[Path]:
    """Write the tables and the figure of the cases that are done."""
    statistics = done.statistics_records() if _statistics(done) else []
    tables = {
        "cases": done.case_records(),
        "history": done.records(),
        "statistics": statistics,
    }
    drawing = Drawing("sweep", "studies.figures.sweep_figure", (done,), file_kinds(figures))
    return write_study(folder, tables, drawing if figures and statistics else None)


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


def diff_results(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Set the results of two runs beside each other; write curves, ratios and a page.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    if options:
        raise InputError("nothing is solved here", key="--", value=" ".join(options))
    both = on_root(comm, lambda: difference(choice.first, choice.second, at=choice.at))
    joined = "-".join(name.replace("/", "-") for name in both.names)
    folder = choice.out or Path("results") / f"{joined}{DIFF_ENDING}"
    with locked(folder, comm):
        files = on_root(comm, lambda: _write_difference(folder, both))
    terminal.show_table(comm, both.table())
    if len(both.loads) > 1:
        terminal.say(comm, f"ratios, {both.names[1]} over {both.names[0]}:")
        terminal.show_table(comm, both.load_table(most=12))
    for note in both.notes:
        terminal.say(comm, f"note: {note}")
    show_study(choice, comm, files)


def _write_difference(folder: Path, both: Difference) -> list[Path]:
    """Write ``diff.csv``, ``diff.png`` and ``diff.html``."""
    drawing = Drawing("diff", "studies.figures.difference_figure", (both,))
    title = f"patchlaw diff: {both.names[0]}, {both.names[1]}"

    def page(pictures: Mapping[str, bytes]) -> str:
        return filled("studies/difference.jinja", title=title, both=both, pictures=pictures)

    return write_study(folder, {"diff": both.records()}, drawing, "diff", page)


def write_study(
    folder: Path,
    tables: Mapping[str, Iterable[Mapping[str, Any]]],
    drawing: Drawing | None,
    name: str = "",
    page: Callable[[Mapping[str, bytes]], str] | None = None,
) -> list[Path]:
    """Write tables, a figure, and a page that shows it.

    Args:
        folder: Folder of the results; made when missing.
        tables: Rows of the tables by name.
        drawing: The figure; None for none.
        name: Name of the page.
        page: Makes the page from the files of the figure; None for no page.

    Returns:
        The files written.
    """
    files = [write_records(folder / f"{table}.csv", iter(of)) for table, of in tables.items()]
    drawn = Pictures({}) if drawing is None else pictures_of(drawing)
    if drawn.problem:
        terminal.say(None, drawn.problem)
    files += write_pictures(folder, drawn)
    if page is not None:
        files.append(write_text(folder / f"{name}.html", page(drawn.files)))
    return [path for path in files if path is not None]


def show_study(choice: argparse.Namespace, comm: Any, files: list[Path]) -> None:
    """Print where results are, and open the page where that is asked for.

    Args:
        choice: Parsed words of the command line.
        comm: MPI communicator, or None.
        files: The files written.
    """
    terminal.show_files(comm, files)
    if choice.open:
        terminal.open_page(comm, files)
