"""The command ``patchlaw diff``: its lines in the terminal, its files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from multiscale.cli.words import DIFF_ENDING
from multiscale.figures.files import Drawing, pictures_of, write_pictures
from multiscale.output import terminal
from multiscale.output.results import write_records
from multiscale.restart.results_folder import locked
from multiscale.results.html_page import filled
from multiscale.studies.difference import Difference, difference
from support.collective import on_root
from support.errors import InputError
from support.whole_files import write_text


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
        files = on_root(comm, lambda: _write(folder, both))
    terminal.show_table(comm, both.table())
    if len(both.loads) > 1:
        terminal.say(comm, f"ratios, {both.names[1]} over {both.names[0]}:")
        terminal.show_table(comm, both.load_table(most=12))
    for note in both.notes:
        terminal.say(comm, f"note: {note}")
    terminal.show_files(comm, files)
    if choice.open:
        terminal.open_page(comm, files)


def _write(folder: Path, both: Difference) -> list[Path]:
    """Write ``diff.csv``, ``diff.png`` and ``diff.html``."""
    records = write_records(folder / "diff.csv", both.records())
    what = "studies.difference_figure.difference_figure"
    drawn = pictures_of(Drawing("diff", what, (both,)))
    if drawn.problem:
        terminal.say(None, drawn.problem)
    title = f"patchlaw diff: {both.names[0]}, {both.names[1]}"
    page = filled("studies/difference.jinja", title=title, both=both, pictures=drawn.files)
    files = [records, *write_pictures(folder, drawn), write_text(folder / "diff.html", page)]
    return [path for path in files if path is not None]
