"""The command compare: its lines in the terminal, its files."""

from __future__ import annotations

import argparse
import os
import platform
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from multiscale.cli.execution import scene_and_folder
from multiscale.cli.studies import show_study, write_study
from multiscale.cli.words import COMPARE_ENDING
from multiscale.console import following
from multiscale.figures.files import Drawing, file_kinds
from multiscale.output import terminal
from multiscale.output.report import filled
from multiscale.output.results_folder import locked
from multiscale.readable import duration, percent
from multiscale.readable import number as readable_number
from multiscale.studies import errors
from multiscale.studies.comparison import Comparison, compare
from multiscale.studies.configurations import Configuration
from multiscale.studies.running import CaseResult
from support.collective import on_root
from support.errors import InputError, NotConverged


def compare_scene(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Run a scene in every sensible configuration; draw error against time.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    if options:
        raise InputError("configurations take no PETSc options", key="--", value=" ".join(options))
    scene, folder = scene_and_folder(choice, comm, ending=COMPARE_ENDING)
    with locked(folder, comm):
        with following(comm) as (begun, ended):

            def observe(one: Configuration, result: CaseResult) -> None:
                phases = result.measured.get("phases", {})
                spent = f"{duration(sum(phases.values())) if phases else '':>12}"
                why = f": {result.failure}" if result.failure else ""
                ended(f"{spent}  {one.name}: {result.status}{why}")

            try:
                done = compare(
                    scene, comm, against=choice.against, budget_s=choice.budget, folder=folder,
                    begin=lambda one: begun(one.name), observe=observe,
                )  # fmt: skip
            except KeyboardInterrupt:
                ended(f"interrupted: what is finished is in {folder}; the same call goes on")
                raise
        files = on_root(comm, lambda: write_comparison(folder, done, scene.output.figures))
        for text in (*headline(done), *frontier_lines(done), *done.warnings):
            terminal.say(comm, text)
        show_study(choice, comm, files)
    if done.measure is None or (choice.against and done.against != choice.against):
        raise NotConverged(
            f"the comparison against {choice.against or 'anything'}",
            reason="MEASURE_NOT_REACHED",
            iterations=0,
            remedy="give more --budget; finished configurations are not run again",
        )


def write_comparison(
    folder: Path, comparison: Comparison, figures: bool | str = True
) -> list[Path]:
    """Write ``compare.csv``, the figure and ``report.html``.

    Args:
        folder: Folder of the results; made when missing.
        comparison: The comparison.
        figures: The scene's `output.figures`, "svg" for a figure in this form too.

    Returns:
        The files written.
    """
    drawing = None
    if comparison.measure is not None:
        what = "studies.figures.comparison_figure"
        drawing = Drawing("pareto", what, (comparison,), file_kinds(figures))
    tables = {"compare": comparison.records()}
    return write_study(
        folder, tables, drawing, "report", lambda drawn: comparison_html(comparison, drawn)
    )


def comparison_html(comparison: Comparison, pictures: Mapping[str, bytes]) -> str:
    """Return the report: a complete HTML document that needs no network.

    Args:
        comparison: The comparison.
        pictures: Files of the figure by name, ``pareto.png``.
    """
    threads = os.environ.get("OMP_NUM_THREADS", "all")
    return filled(
        "studies/report.jinja",
        title=f"patchlaw compare: {comparison.scene}",
        comparison=comparison,
        records=comparison.records(),
        numbers={row.name: number for number, row in enumerate(comparison.rows, 1)},
        frontier_names=[row.name for row in comparison.frontier()],
        headline=headline(comparison),
        frontier_lines=list(frontier_lines(comparison)),
        pictures=pictures,
        number=readable_number,
        percent=percent,
        definitions=(errors.__doc__ or "").strip(),
        machine=f"{platform.platform()}, {os.cpu_count()} cores, threads: {threads}",
    )


def headline(comparison: Comparison) -> Iterator[str]:
    """Yield sentences on the number of configurations that were run, and on the measure.

    Args:
        comparison: The comparison.
    """
    done = sum(row.status == "done" for row in comparison.rows)
    yield f"{done} of {len(comparison)} configurations were run to the end of the load."
    if comparison.measure is None:
        return
    bars = {
        f"{comparison.response}_max": f"of the {comparison.response}",
        "area_max": "of the contact area",
        "distribution": "of the mean pressure in the distribution of pressures",
    }
    own = comparison.uncertainty
    known = ", ".join(f"{percent(own[bar])} {of}" for bar, of in bars.items() if own[bar] > 0)
    yield (
        f"They are compared with “{comparison.measure}”, whose own uncertainty is "
        f"{known or 'not known'}."
    )


def frontier_lines(comparison: Comparison) -> Iterator[str]:
    """Yield a line on each configuration of the frontier: its time and its error.

    Args:
        comparison: The comparison.
    """
    bar = comparison.uncertainty[f"{comparison.response}_max"]
    for row in comparison.frontier():
        size = comparison.error(row)
        less = "no more than the uncertainty of the measure, " if size <= bar else ""
        yield f"{duration(row.seconds)}: error {less}{percent(size)}: {row.name}"
