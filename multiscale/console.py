"""What commands print: lines, tables and progress.

Only rank 0 prints. Progress is one line that changes in terminals and notebooks, and elsewhere, as
in logs and under ``mpirun``, a line for each phase and load step.
"""

from __future__ import annotations

import html
import os
import sys
import time
import webbrowser
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from itertools import count
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from patchlaw.multiscale.machine import cores_statement, peak_memory
from patchlaw.support import PatchlawError, place_in
from patchlaw.support.readable import WHOLE, Caution, duration, printable, quantity

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable

    from patchlaw.multiscale.loading.load_history import LoadHistory
    from patchlaw.multiscale.loading.load_step import LoadStep


TABLE_WIDTH = 100
"""Characters of a line that tables take at least, in a log file too."""

_QUIET: ContextVar[bool] = ContextVar("quiet", default=False)
_PROGRESS: ContextVar[str | None] = ContextVar("progress", default=None)


@contextmanager
def printing(*, quiet: bool, progress: str | None) -> Iterator[None]:
    """Choose what is printed within.

    Args:
        quiet: Whether nothing is but errors and cautions, which go to the error stream.
        progress: How progress is shown, as a ``"bar"``, in ``"lines"`` or ``"none"``; None as it
            suits what is printed to.
    """
    tokens = _QUIET.set(quiet), _PROGRESS.set(progress)
    try:
        yield
    finally:
        _QUIET.reset(tokens[0])
        _PROGRESS.reset(tokens[1])


def speaks(comm: Any) -> bool:
    """Tell whether this process prints and writes files.

    Args:
        comm: MPI communicator, or None.
    """
    return comm is None or comm.rank == 0


def _prints(comm: Any) -> bool:
    """Tell whether this process prints what is no error; those that do not load no rich."""
    return speaks(comm) and not _QUIET.get()


def console_of(
    comm: Any, *, least_width: int = 0, stderr: bool = False, moving: bool = False
) -> Console:
    """Return a console that is silent on all ranks but the first.

    Lines for tables are cut at the width of the terminal; all others stay whole, so that they can
    be searched and copied.

    Args:
        comm: MPI communicator, or None.
        least_width: Least width of tables; 0 for a console without tables.
        stderr: Whether it prints to the error stream.
        moving: Whether it shows lines that change even where it prints to no terminal.
    """
    from rich.console import Console  # its import takes time that many processes do without

    detected = None if comm is None else False  # Open MPI has a terminal for it, even in a log
    console = Console(
        stderr=stderr,
        soft_wrap=not least_width,
        highlight=False,
        emoji=False,  # names of files may hold what stands for one
        quiet=not speaks(comm),
        force_terminal=moving or detected,
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
    if _prints(comm):
        console_of(comm).print(escape(text))


def show_pairs(comm: Any, pairs: Sequence[tuple[str, str]], warnings: Sequence[str] = ()) -> None:
    """Print topics with a sentence each, then warnings.

    Args:
        comm: MPI communicator, or None.
        pairs: Topics and sentences.
        warnings: Sentences that a user should not miss.
    """
    if not _prints(comm):
        return
    console = console_of(comm, least_width=TABLE_WIDTH)
    table = _table(("", ""), (), text_columns=2)
    for topic, sentence in pairs:
        table.add_row(f"[bold]{escape(topic)}[/]", escape(sentence))
    console.print(table)
    for warning in warnings:
        console.print(f"{_label(warning)} {escape(warning)}")


def show_plan(comm: Any, coupling: Any, memory: str = "", shortages: Sequence[str] = ()) -> None:
    """Print what a run will do, and why.

    Args:
        comm: MPI communicator, or None.
        coupling: The `multiscale.models.coupling.Coupling` of the scene.
        memory: The memory that it takes, in words.
        shortages: Sentences on the memory that these nodes lack.

    Note:
        Collective.
    """
    cores = cores_statement(comm)
    if _prints(comm):
        warnings = [*coupling.about.warnings(), *shortages]
        show_pairs(comm, [*coupling.about.statements(memory), ("cores", cores)], warnings)


def show_times(comm: Any, seconds: Mapping[str, float]) -> None:
    """Print wall times and memory of a run.

    Args:
        comm: MPI communicator, or None.
        seconds: Wall time of the phases [s].
    """
    if not _prints(comm):
        return
    total = duration(sum(seconds.values()))
    phases = ", ".join(f"{phase} {duration(spent)}" for phase, spent in seconds.items())
    memory = f"; memory {most / 1e6:.0f} MB" if (most := peak_memory()) else ""
    text = f"took {total}: {phases}{memory}"
    console_of(comm, least_width=TABLE_WIDTH).print(text, markup=False)


def show_history(comm: Any, history: Any) -> None:
    """Print the force–approach table and the notes of the run; quietly, its cautions alone.

    Args:
        comm: MPI communicator, or None.
        history: The `multiscale.results.history.History`.
    """
    if _prints(comm):
        header, rows = history.table(most=60)
        console = console_of(comm, least_width=TABLE_WIDTH)
        # a log takes lines of any length; a reference has one more column
        more = 16 * (history.reference is not None) if console.is_terminal else TABLE_WIDTH
        console.width = max(console.width, TABLE_WIDTH + more)
        console.print(_table([name.replace(" [", "\n[") for name in header], rows))
    show_notes(comm, history.notes)


def show_notes(comm: Any, notes: Iterable[str]) -> None:
    """Print notes; quietly, cautions alone, on the error stream.

    Args:
        comm: MPI communicator, or None.
        notes: The notes.
    """
    if not speaks(comm):
        return
    prints = _prints(comm)
    console = console_of(comm, stderr=not prints)
    for note in notes:
        if prints or isinstance(note, Caution):
            console.print(f"{_label(note)} {escape(note)}")


def _label(note: str) -> str:
    """Return what a note begins with."""
    return "[bold yellow]caution:[/]" if isinstance(note, Caution) else "[yellow]note:[/]"


def show_table(comm: Any, table: tuple[Sequence[str], Sequence[Sequence[str]]]) -> None:
    """Print a table whose first column is text.

    Args:
        comm: MPI communicator, or None.
        table: Its headings and rows.
    """
    if _prints(comm):
        console_of(comm, least_width=TABLE_WIDTH).print(_table(*table, text_columns=1))


def _table(
    header: Sequence[str], rows: Sequence[Sequence[str]], text_columns: int = 0
) -> RichTable:
    """Return a table without a frame; where no heading says anything, without a header."""
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0), show_header=any(header))
    for index, name in enumerate(header):
        table.add_column(escape(name), justify="left" if index < text_columns else "right")
    for row in rows:
        table.add_row(*map(escape, row))
    return table


def show_files(comm: Any, files: Sequence[Path]) -> None:
    """Print where results are.

    Args:
        comm: MPI communicator, or None.
        files: The files written, all in one folder.
    """
    if files and _prints(comm):
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


Show = Callable[[str], None]
"""Shows a text."""
_SHORT = 5.0
"""Time that is left [s] from which on parts of what is measured beside a load step are told."""


class Progress:
    """A `ProgressObserver` that says what a run is at, and how long what is left will take.

    Args:
        show: Takes the text.
        seldom: Whether it is called when a tenth more of something is done, not for every part.
    """

    def __init__(self, show: Show, *, seldom: bool = False) -> None:
        self._show, self._seldom = show, seldom
        self._began: dict[str, tuple[float, int]] = {}
        self._counted: dict[str, int] = {}
        self._tenths: dict[str, int] = {}
        self._latest, self._rest = "", 0.0

    def __call__(self, what: str, done: int = 0, most: int = 0) -> None:
        """Show what the run is at; see `ProgressObserver`."""
        left, tenth = self.left(what, done, most), 10 * done // most if most else 0
        part = f"{done} %" if most is WHOLE else f"{done} of at most {most}"
        if not most and what not in ("contact", self._latest):  # a short one in every load step
            self._latest = what
            self._show(what)
        elif most and not (self._seldom and tenth == self._tenths.get(what, 0)):
            self._tenths[what] = tenth
            if most is not WHOLE or self._rest >= _SHORT:
                self._show(f"{what}: {part}{left}")

    def left(self, what: str, done: int, most: int) -> str:
        """Say how long the rest will take, at the pace since this was first called for it.

        What has fewer parts done than before is another count, which begins again.

        Args:
            what: Name of what is counted.
            done: Parts that are done.
            most: All parts; 0 where their number is not known.
        """
        now = time.monotonic()
        if not done or done < self._counted.get(what, 0) or what not in self._began:
            self._began[what] = now, done
        self._counted[what] = done
        began, first = self._began[what]
        self._rest = 0.0
        if not first < done < most:
            return ""
        self._rest = (most - done) * (now - began) / (done - first)
        return f"; about {duration(self._rest)} left"


@contextmanager
def following(comm: Any) -> Iterator[tuple[Progress, Show]]:
    """Show which part of a long task is under way, and print a line on every part that is done.

    In a notebook the part under way is one line that changes, and what it said last stays.

    Args:
        comm: MPI communicator, or None.

    Yields:
        What is told of the part under way, and the function to call with a line on what ended.
    """
    way = _PROGRESS.get()
    if speaks(comm) and way is None and _in_notebook():
        yield Progress(_notebook_line()), print
        return
    stay = partial(say, comm)
    if way == "none" or not _prints(comm):
        yield Progress(lambda text: None), stay
        return
    lines = console_of(comm, moving=way == "bar")
    if way == "bar" or (way is None and comm is None and lines.is_terminal):
        with lines.status("set-up") as status:
            yield (
                Progress(lambda text: status.update(escape(text))),
                lambda text: lines.print(escape(text)),
            )
    else:  # mpirun passes a terminal on that takes no moving lines
        yield Progress(lambda text: stay(f"{time.strftime('%H:%M:%S')} {text}"), seldom=True), stay


@contextmanager
def run_progress(
    comm: Any, load_history: LoadHistory, done: int = 0
) -> Iterator[tuple[Callable[[LoadStep], None], Progress]]:
    """Show the progress of a run: what it is at, and its load steps.

    Args:
        comm: MPI communicator, or None.
        load_history: The load steps to come.
        done: Number of load steps that were accepted before.

    Yields:
        The functions to call with every load step, and with what the run is at before and beside.
    """
    # Halved load steps make the total unknown.
    steps = None if load_history.force_change else load_history.count
    total = "" if steps is None else f"/{steps}"
    with following(comm) as (at, _):

        def advance(step: LoadStep) -> None:
            reached = f"{quantity(step.approach_mm, 'mm', 3)}, {quantity(step.force_N, 'N')}"
            left = at.left("load steps", step.step - done, (steps or 0) - done)
            at(f"load step {step.step}{total}: {reached}{left}")

        yield advance, at


@contextmanager
def case_progress(comm: Any, cases: int, parts: int = 1) -> Iterator[Callable[[Any, Any], None]]:
    """Show the progress of a sweep: the cases that are done, and a line for every one that failed.

    Args:
        comm: MPI communicator, or None.
        cases: Number of cases of all parts.
        parts: Number of parts that run at the same time.

    Yields:
        The function to call with every case that is done on this rank, and its result.
    """
    own, done = ceil(cases / (parts * place_in(comm)[1])), count(1)
    with following(comm) as (at, ended):
        at("cases", 0, own)

        def observe(case: Any, result: Any) -> None:
            at("cases", min(next(done), own), own)
            if result.failure:
                ended(f"case {case.number}: {result.failure}")

        yield observe


def _in_notebook() -> bool:
    """Tell whether this process is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and hasattr(ipython.get_ipython(), "kernel")


def _notebook_line() -> Show:
    """Return what changes the text of a line below the notebook's cell."""
    from IPython.display import display

    def content(text: str) -> dict[str, str]:
        return {"text/plain": text, "text/html": f"<div>{html.escape(text)}</div>"}

    handle = display(content(""), raw=True, display_id=True)
    return lambda text: handle.update(content(text), raw=True)
