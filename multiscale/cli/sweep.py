"""The command ``patchlaw sweep``."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from geometry.collective import on_root
from geometry.errors import InputError, NotConverged
from multiscale.cli.execution import scene_and_folder
from multiscale.cli.words import SWEEP_ENDING
from multiscale.output import terminal
from multiscale.output.results import pictures_of, write_pictures
from multiscale.restart.results_folder import locked
from multiscale.storage import remove, write_csv
from multiscale.sweeps.cases import Case, values_from_text
from multiscale.sweeps.journal import CaseResult
from multiscale.sweeps.sweep import JOURNAL, sweep
from multiscale.sweeps.sweep_results import SweepResults

MOST_LINES = 20
"""Ensembles that are told in the terminal; the files hold all of them."""

FILES = ("cases.csv", "history.csv", "ensembles.csv", "sweep.png", "sweep.svg")
"""Files of the results of a sweep."""


def sweep_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Run a scene for many values of its keys; write all load steps, means and bands.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    scene, folder = scene_and_folder(choice, comm, ending=SWEEP_ENDING)
    vary = dict(values_from_text(text) for text in choice.vary)
    which, parts = choice.part or slurm_part()
    with locked(folder / JOURNAL / f"{which}-of-{parts}", comm):
        if choice.overwrite:
            on_root(comm, lambda: _remove_results(folder))
        with terminal.following(comm) as (begun, ended):

            def observe(case: Case, result: CaseResult) -> None:
                begun(f"case {case.number} is done")
                if result.failure:
                    ended(f"case {case.number}: {result.failure}")

            found = sweep(scene, vary, comm, folder=folder, part=(which, parts), observe=observe)
        files = on_root(comm, lambda: _write(folder, found, bool(scene.output.figures)))
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
    for path in [*(folder / JOURNAL).glob("*.jsonl"), *(folder / name for name in FILES)]:
        remove(path)


def _write(folder: Path, found: SweepResults, figures: bool) -> list[Path]:
    """Write the tables and the figure of the cases that are done."""
    tables = {
        "cases.csv": found.case_records(),
        "history.csv": found.records(),
        "ensembles.csv": _ensemble_records(found),
    }
    files = [
        write_csv(folder / name, list(rows[0]), [list(row.values()) for row in rows])
        for name, rows in tables.items()
        if rows
    ]
    if figures and tables["ensembles.csv"]:
        files += write_pictures(folder, pictures_of("sweep", found.plot()))
    return files


def _summary(found: SweepResults) -> Iterator[str]:
    """Yield a line on the last load step of each ensemble."""
    yield f"{len(found) - found.unfinished} of {len(found)} cases are done"
    for record in _last_steps(_ensemble_records(found))[:MOST_LINES]:
        values = "".join(f"{key} = {record[key]}, " for key in found.keys if key in record)
        force, approach = _spread(record, "force_N"), _spread(record, "approach_mm", 1e3)
        yield f"{values}at last: force {force} N, approach {approach} µm"


def _spread(record: dict[str, Any], name: str, scale: float = 1.0) -> str:
    """Return a mean and, where the cases of an ensemble differ, the band about it."""
    low, middle, high = (scale * record[f"{name}{end}"] for end in ("_low", "", "_high"))
    same = high - low <= 1e-6 * abs(middle)
    return f"{middle:.4g}" if same else f"{middle:.4g} (5 to 95 %: {low:.4g} … {high:.4g})"


def _last_steps(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    last = max((record["step"] for record in records), default=0)
    return [record for record in records if record["step"] == last]


def _ensemble_records(found: SweepResults) -> list[dict[str, Any]]:
    """Return means and bands; none before all cases are done, or where steps were halved."""
    try:
        return [] if found.unfinished else found.ensemble_records()
    except InputError:
        return []
