"""What commands print: lines, tables, progress, and how long phases of a run take.

Only rank 0 prints. Progress is shown in terminals, under ``mpirun`` and in notebooks.
"""

from __future__ import annotations

import html
import os
import sys
import time
import webbrowser
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from patchlaw.multiscale.machine import cores_statement, peak_memory
from patchlaw.multiscale.readable import Caution, Observer, duration, quantity
from patchlaw.support.displayed import printable
from patchlaw.support.errors import PatchlawError
from patchlaw.support.parallel import place_in

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable

    from patchlaw.multiscale.loading.load_history import LoadHistory
    from patchlaw.multiscale.loading.load_step import LoadStep


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
    table = _table(("", ""), (), text_columns=2)
    for topic, sentence in pairs:
        table.add_row(f"[bold]{escape(topic)}[/]", escape(sentence))
    console.print(table)
    for warning in warnings:
        console.print(f"[yellow]note:[/] {escape(warning)}")


def show_plan(comm: Any, coupling: Any, memory: str = "", shortages: Sequence[str] = ()) -> None:
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


Show = Callable[[str], None]
"""Shows a text."""


class Clock:
    """Measures the wall time of phases from now on, each without that of phases within it.

    Attributes:
        seconds: Wall time of each phase that ended [s].
        observe: Told what the run is at; None without anybody to tell.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.observe: Observer | None = None
        self._began = self._until = time.perf_counter()

    def add(self, seconds: Mapping[str, float]) -> None:
        """Add phases that were measured elsewhere and end now.

        Args:
            seconds: Their wall times by name [s].
        """
        self.seconds |= seconds
        self._until = time.perf_counter()

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Measure the wall time of a phase.

        Args:
            name: Its name in `seconds`.
        """
        if self.observe is not None:
            self.observe(name, 0, 0)
        start = time.perf_counter() - sum(self.seconds.values())
        try:
            yield
        finally:
            self._until = time.perf_counter()
            spent = self._until - sum(self.seconds.values()) - start
            self.seconds[name] = self.seconds.get(name, 0.0) + spent

    @property
    def times(self) -> dict[str, float]:
        """Wall time of each phase that ended, and of all else until then as ``other`` [s]."""
        rest = self._until - self._began - sum(self.seconds.values())
        return {**self.seconds, "other": max(rest, 0.0)}


def counting(show: Show) -> Observer:
    """Return an observer of a run that shows what it is at, as a text.

    Args:
        show: Takes the text.
    """
    return lambda what, done, most: show(f"{what}: {done} of at most {most}" if most else what)


class Pace:
    """The pace of a task, which tells how long the rest of it will take.

    Args:
        parts: Its parts, such as load steps; 0 where their number is not known.
    """

    def __init__(self, parts: int) -> None:
        self._parts, self._done, self._spent = parts, 0, 0.0

    def left(self, spent: float) -> str:
        """Count a part that is done, and say how long the rest will take, where that is known.

        Args:
            spent: Time that the part took [s].
        """
        self._done, self._spent = self._done + 1, self._spent + spent
        rest = self._parts - self._done
        return f"; about {duration(rest * self._spent / self._done)} left" if rest > 0 else ""


@contextmanager
def following(comm: Any) -> Iterator[tuple[Show, Show]]:
    """Show which part of a long task is under way, and print a line on every part that is done.

    In a notebook the part under way is one line that changes, and what it said last stays.

    Args:
        comm: MPI communicator, or None.

    Yields:
        The functions to call with the part that begins, and with a line on the part that ended.
    """
    if speaks(comm) and _in_notebook():
        yield _notebook_line(), print
        return
    lines = console_of(comm)
    if comm is not None:  # mpirun passes a terminal on that takes no moving lines
        yield lambda text: None, lambda text: lines.print(escape(text))
        return
    with lines.status("") as status:
        yield (lambda text: status.update(escape(text)), lambda text: lines.print(escape(text)))


@contextmanager
def run_progress(
    comm: Any, load_history: LoadHistory, done: int = 0
) -> Iterator[tuple[Callable[[LoadStep], None], Observer]]:
    """Show the progress of a run: what it is at, or under ``mpirun`` a line for each load step.

    Args:
        comm: MPI communicator, or None.
        load_history: The load steps to come.
        done: Number of load steps that were accepted before.

    Yields:
        The functions to call with every load step, and with what the run is at before and beside.
    """
    # Halved load steps make the total unknown.
    steps = None if load_history.force_change else load_history.count
    pace, total = Pace(0 if steps is None else steps - done), "" if steps is None else f"/{steps}"
    with following(comm) as (begun, ended):
        show = begun if comm is None else ended

        def advance(step: LoadStep) -> None:
            reached = f"{quantity(step.approach_mm, 'mm', 3)}, {quantity(step.force_N, 'N')}"
            show(f"load step {step.step}{total}: {reached}{pace.left(step.wall_s)}")

        yield advance, counting(begun) if comm is None else _tenths(ended)


@contextmanager
def case_progress(comm: Any, cases: int, parts: int = 1) -> Iterator[Callable[[Any, Any], None]]:
    """Show the progress of a sweep: which case is done, and a line for every one that failed.

    Args:
        comm: MPI communicator, or None.
        cases: Number of cases of all parts.
        parts: Number of parts that run at the same time.

    Yields:
        The function to call with every case that is done on this rank, and its result.
    """
    pace, last = Pace(ceil(cases / (parts * place_in(comm)[1]))), time.monotonic()
    with following(comm) as (begun, ended):

        def observe(case: Any, result: Any) -> None:
            nonlocal last
            spent, last = time.monotonic() - last, time.monotonic()
            begun(f"case {case.number} is done{pace.left(spent)}")
            if result.failure:
                ended(f"case {case.number}: {result.failure}")

        yield observe


def _tenths(show: Show) -> Observer:
    """Return an observer that shows a line when a tenth more of something is done."""
    shown: dict[str, int] = {}

    def observe(what: str, done: int, most: int) -> None:
        tenth = 10 * done // most if most else 0
        if most and tenth > shown.get(what, 0):
            shown[what] = tenth
            show(f"{what}: {done} of at most {most}")

    return observe


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
