"""Lines and tables that commands print; only rank 0 does."""

from __future__ import annotations

import os
import sys
import webbrowser
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any

from patchlaw.multiscale.machine import cores_statement, peak_memory
from patchlaw.multiscale.readable import Caution, duration
from patchlaw.support.displayed import printable
from patchlaw.support.errors import PatchlawError

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable

TABLE_WIDTH = 100
"""Characters of a line that tables take at least, in a log file too."""

_QUIET: ContextVar[bool] = ContextVar("quiet", default=False)


@contextmanager
def quietly(quiet: bool) -> Iterator[None]:
    """Print nothing but errors and cautions, which go to the error stream.

    Args:
        quiet: Whether it is so; otherwise nothing changes.
    """
    token = _QUIET.set(quiet)
    try:
        yield
    finally:
        _QUIET.reset(token)


def speaks(comm: Any) -> bool:
    """Tell whether this process prints and writes files.

    Args:
        comm: MPI communicator, or None.
    """
    return comm is None or comm.rank == 0


def console_of(comm: Any, *, least_width: int = 0, stderr: bool = False) -> Console:
    """Return a console that is silent on all ranks but the first.

    Lines for tables are cut at the width of the terminal; all others stay whole, so that they can
    be searched and copied.

    Args:
        comm: MPI communicator, or None.
        least_width: Least width of tables; 0 for a console without tables.
        stderr: Whether it prints to the error stream.
    """
    from rich.console import Console  # its import takes time that many processes do without

    console = Console(
        stderr=stderr,
        soft_wrap=not least_width,
        highlight=False,
        quiet=not speaks(comm) or (_QUIET.get() and not stderr),
        color_system=None if os.environ.get("NO_COLOR") else "auto",  # nor bold letters without
    )
    # without any width, as of COLUMNS=0, nothing would be printed
    console.width = max(console.width, least_width, 1)
    return console


def escape(text: str) -> str:
    """Return a text that a console of rich shows as it is, with control characters as escapes.

    Args:
        text: The text.
    """
    from rich.markup import escape as escape_markup

    return escape_markup(printable(text))


def complain(comm: Any, error: PatchlawError) -> None:
    """Print one error message on the error stream, as one line whatever it quotes.

    Args:
        comm: MPI communicator, or None.
        error: The error.
    """
    line = " ".join(str(error).splitlines())
    try:
        console_of(comm, stderr=True).print(f"[bold red]patchlaw:[/] {escape(line)}")
    except ModuleNotFoundError:  # the error can be that packages are missing, rich among them
        if speaks(comm):
            print(f"patchlaw: {printable(line)}", file=sys.stderr)


def say(comm: Any, text: str) -> None:
    """Print one line.

    Args:
        comm: MPI communicator, or None.
        text: The line.
    """
    console_of(comm).print(escape(text))


def show_pairs(comm: Any, pairs: Sequence[tuple[str, str]], warnings: Sequence[str] = ()) -> None:
    """Print topics with a sentence each, then warnings.

    Args:
        comm: MPI communicator, or None.
        pairs: Topics and sentences.
        warnings: Sentences that a user should not miss.
    """
    console = console_of(comm, least_width=TABLE_WIDTH)
    table = _rich_table(show_header=False)
    for topic, sentence in pairs:
        table.add_row(f"[bold]{escape(topic)}[/]", escape(sentence))
    console.print(table)
    for warning in warnings:
        console.print(f"[yellow]note:[/] {escape(warning)}")


def show_plan(
    comm: Any,
    coupling: Any,
    memory: str = "",
    shortages: Sequence[str] = (),
) -> None:
    """Print what a run will do, and why.

    Args:
        comm: MPI communicator, or None.
        coupling: The `multiscale.couplings.coupling.Coupling` of the scene.
        memory: The memory that it takes, in words.
        shortages: Sentences on the memory that these nodes lack.

    Note:
        Collective.
    """
    cores = cores_statement(comm)
    if speaks(comm):
        warnings = [*coupling.about.warnings(), *shortages]
        show_pairs(comm, [*coupling.about.statements(memory), ("cores", cores)], warnings)


def show_times(comm: Any, seconds: Mapping[str, float]) -> None:
    """Print wall times and memory of a run.

    Args:
        comm: MPI communicator, or None.
        seconds: Wall time of the phases [s].
    """
    total = duration(sum(seconds.values()))
    phases = ", ".join(f"{phase} {duration(spent)}" for phase, spent in seconds.items())
    text = f"took {total}: {phases}; memory {peak_memory() / 1e6:.0f} MB"
    console_of(comm, least_width=TABLE_WIDTH).print(text, markup=False)


def show_history(comm: Any, history: Any) -> None:
    """Print the force–approach table and the notes of the run; quietly, its cautions alone.

    Args:
        comm: MPI communicator, or None.
        history: The `multiscale.results.history.History`.
    """
    if not speaks(comm):
        return
    header, rows = history.table(most=60)
    # A reference has one more column.
    console = console_of(comm, least_width=TABLE_WIDTH + 16 * (history.reference is not None))
    console.print(_table([name.replace(" [", "\n[") for name in header], rows))
    if _QUIET.get():
        console = console_of(comm, stderr=True)
    for note in history.notes:
        if _QUIET.get() and not isinstance(note, Caution):
            continue
        label = "[bold yellow]caution:[/]" if isinstance(note, Caution) else "note:"
        console.print(f"{label} {escape(note)}")


def show_table(comm: Any, table: tuple[Sequence[str], Sequence[Sequence[str]]]) -> None:
    """Print a table whose first column is text.

    Args:
        comm: MPI communicator, or None.
        table: Its headings and rows.
    """
    console_of(comm, least_width=TABLE_WIDTH).print(_table(*table, text_columns=1))


def _table(
    header: Sequence[str], rows: Sequence[Sequence[str]], text_columns: int = 0
) -> RichTable:
    table = _rich_table()
    for index, name in enumerate(header):
        table.add_column(escape(name), justify="left" if index < text_columns else "right")
    for row in rows:
        table.add_row(*map(escape, row))
    return table


def _rich_table(**options: Any) -> RichTable:
    from rich.table import Table

    return Table(box=None, padding=(0, 2, 0, 0), **options)


def show_files(comm: Any, files: Sequence[Path]) -> None:
    """Print where results are.

    Args:
        comm: MPI communicator, or None.
        files: The files written, all in one folder.
    """
    if files:
        pictures = {path.stem for path in files if path.suffix == ".png"}
        beside = {path for path in files if path.suffix == ".svg" and path.stem in pictures}
        names = ", ".join(path.name for path in files if path not in beside)
        also = "; pictures also as .svg" if beside else ""
        say(comm, f"results in {files[0].parent}: {names}{also}")


def open_page(comm: Any, files: Sequence[Path]) -> None:
    """Show the page among files in the user's browser, or say why not.

    Args:
        comm: MPI communicator, or None.
        files: The files written.
    """
    if not speaks(comm):
        return
    page = next((path for path in files if path.suffix == ".html"), None)
    if page is None:
        say(comm, "note: no report was written that could be opened")
    elif not webbrowser.open(page.resolve().as_uri()):
        say(comm, f"note: no browser was found to open {page} with")
