"""The command ``patchlaw compare``: its lines in the terminal, its files."""

from __future__ import annotations

import argparse
import os
import platform
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from multiscale.cli.execution import scene_and_folder
from multiscale.cli.words import COMPARE_ENDING
from multiscale.comparison import errors
from multiscale.comparison.compare import Launch, compare
from multiscale.comparison.comparison import Comparison
from multiscale.comparison.configuration import RunResult
from multiscale.comparison.launch import check_launchable
from multiscale.output import terminal
from multiscale.output.results import pictures_of, write_pictures
from multiscale.readable import duration, percent
from multiscale.readable import number as readable_number
from multiscale.restart.results_folder import locked
from multiscale.results.html_page import filled
from multiscale.scene.scene import Scene
from support.errors import InputError, NotConverged
from support.whole_files import write_csv, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESULTS = "configurations"
"""Folder of the results of all configurations, within the folder of the comparison."""


def compare_scene(
    choice: argparse.Namespace, options: list[str], comm: Any, launch: Launch | None = None
) -> None:
    """Run a scene in every sensible configuration; draw error against time.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
        launch: Runs one configuration; by default in a process of its own.
    """
    check_launchable(choice.ranks)
    if options:
        raise InputError("configurations take no PETSc options", key="--", value=" ".join(options))
    scene, folder = scene_and_folder(choice, comm, ending=COMPARE_ENDING)
    with locked(folder, comm):
        found = _followed(scene, choice, comm, folder / RESULTS, launch)
        for text in (*headline(found), *frontier_lines(found), *found.warnings):
            terminal.say(comm, text)
        terminal.show_files(comm, write_comparison(folder, found))
    if found.measure is None or (choice.against and found.against != choice.against):
        raise NotConverged(
            f"the comparison against {choice.against or 'anything'}",
            reason="MEASURE_NOT_REACHED",
            iterations=0,
            remedy="give more --budget; finished configurations are not run again",
        )


def _followed(
    scene: Scene, choice: argparse.Namespace, comm: Any, folder: Path, launch: Launch | None
) -> Comparison:
    """Run all configurations, and print a line on each."""
    with terminal.following(comm) as (begun, ended):

        def observe(result: RunResult, stored: bool) -> None:
            spent = f"{duration(result.seconds) if result.phases else '':>12}"
            status = result.status + ", from an earlier call" * stored
            why = f": {result.message}" if result.message else ""
            ended(f"{spent}  {result.name}: {status}{why}")

        try:
            return compare(
                scene,
                comm,
                against=choice.against,
                budget_s=choice.budget,
                folder=folder,
                ranks=choice.ranks,
                launch=launch,
                begin=lambda configuration: begun(configuration.name),
                observe=observe,
            )
        except KeyboardInterrupt:
            ended(f"interrupted: finished configurations are in {folder}; the same call goes on")
            raise


def write_comparison(folder: Path, comparison: Comparison) -> list[Path]:
    """Write ``compare.csv``, the figures and ``report.html``.

    Args:
        folder: Folder of the results; made when missing.
        comparison: The comparison.

    Returns:
        The files written.
    """
    columns, pictures = comparison.to_dict(), _pictures(comparison)
    files = [write_csv(folder / "compare.csv", list(columns), zip(*columns.values(), strict=True))]
    files += write_pictures(folder, pictures)
    return [*files, write_text(folder / "report.html", comparison_html(comparison, pictures))]


def _pictures(comparison: Comparison) -> dict[str, bytes]:
    """Return the files of the figures by name; matplotlib is loaded only here."""

    def figure(name: str) -> Figure:
        from multiscale.comparison.error_over_time import pareto_figure
        from multiscale.comparison.figures import curves_figure, maps_figure

        return {"pareto": pareto_figure, "curves": curves_figure, "pressures": maps_figure}[name](
            comparison
        )

    names = ["pareto"] * (comparison.measure is not None)
    names += ["curves", "pressures"] * any(row.steps for row in comparison.rows)
    drawn = [pictures_of(name, partial(figure, name)) for name in names]
    for problem in dict.fromkeys(filter(None, (one.problem for one in drawn))):
        terminal.say(None, problem)
    return {name: content for one in drawn for name, content in one.files.items()}


def comparison_html(comparison: Comparison, pictures: Mapping[str, bytes]) -> str:
    """Return the report: a complete HTML document that needs no network.

    Args:
        comparison: The comparison.
        pictures: Files of the figures by name, ``pareto.png``, ``curves.png``, ``pressures.png``.
    """
    threads = os.environ.get("OMP_NUM_THREADS", "all")
    return filled(
        "comparison/report.jinja",
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
    own, response = comparison.uncertainty, comparison.response
    bars = {
        f"of the {response}": getattr(own, f"{response}_max"),
        "of the contact area": own.area_max,
        "of the mean pressure in the distribution of pressures": own.distribution,
    }
    known = ", ".join(f"{percent(bar)} {part}" for part, bar in bars.items() if bar > 0)
    yield (
        f"They are compared with “{comparison.measure}”, whose own uncertainty is "
        f"{known or 'not known'}."
    )


def frontier_lines(comparison: Comparison) -> Iterator[str]:
    """Yield a line on each configuration of the frontier: its time and its error.

    Args:
        comparison: The comparison.
    """
    bar = getattr(comparison.uncertainty, f"{comparison.response}_max")
    for row in comparison.frontier():
        size = comparison.error(row)
        less = "no more than the uncertainty of the measure, " if size <= bar else ""
        yield f"{duration(row.seconds)}: error {less}{percent(size)}: {row.name}"
