"""What the command line prints; only rank 0 speaks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from geometry.errors import PatchlawError
from multiscale.costs.prediction import Cost
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import LoadHistory
from multiscale.machine.nodes import peak_memory
from multiscale.output.report import curve_cells
from multiscale.planning import plan
from multiscale.results.history import History
from multiscale.setup.problem import ProblemSetup

_MOST_ROWS = 60  # load steps that are printed; files hold them all


def speaks(comm: Any) -> bool:
    """Tell whether this process talks to the terminal and writes files."""
    return comm is None or comm.rank == 0


def complain(comm: Any, error: PatchlawError) -> None:
    """Print one error message on the error stream, as one line whatever it quotes.

    Args:
        comm: MPI communicator, or None.
        error: What to say.
    """
    if speaks(comm):
        line = escape(" ".join(str(error).splitlines()))
        # Long lines stay whole: a message may be searched for, or cut and pasted.
        Console(stderr=True, soft_wrap=True).print(f"[bold red]patchlaw:[/] {line}")


def say(comm: Any, text: str) -> None:
    """Print one line.

    Args:
        comm: MPI communicator, or None.
        text: The line.
    """
    if speaks(comm):
        Console(soft_wrap=True, highlight=False).print(escape(text))


def show_pairs(comm: Any, pairs: Sequence[tuple[str, str]], warnings: Sequence[str] = ()) -> None:
    """Print topics with a sentence each, then warnings.

    Args:
        comm: MPI communicator, or None.
        pairs: Topics and sentences.
        warnings: Sentences that a user should not miss.
    """
    if not speaks(comm):
        return
    console = _wide_console()
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for topic, sentence in pairs:
        table.add_row(f"[bold]{escape(topic)}[/]", escape(sentence))
    console.print(table)
    for warning in warnings:
        console.print(f"[yellow]note:[/] {escape(warning)}")


def show_plan(
    comm: Any, setup: ProblemSetup, made: Cost | None = None, lacking: Sequence[str] = ()
) -> None:
    """Print what a run will do, and why.

    Args:
        comm: MPI communicator, or None.
        setup: The scene's ingredients.
        made: What it is predicted to take; None leaves it out.
        lacking: What a run would need more nodes for.
    """
    if speaks(comm):
        notes = [*plan.warnings(setup), *lacking]
        show_pairs(comm, list(plan.statements(setup, made)), notes)


def show_times(comm: Any, seconds: Mapping[str, float]) -> None:
    """Print what a run took.

    Args:
        comm: MPI communicator, or None.
        seconds: Wall time of the phases [s].
    """
    if speaks(comm):
        phases = ", ".join(f"{phase} {spent:.2f} s" for phase, spent in seconds.items())
        memory = f"memory {peak_memory() / 1e6:.0f} MB"
        _wide_console().print(f"took: {phases}; {memory}", markup=False)


@contextmanager
def progress(
    comm: Any, load_history: LoadHistory, done: int = 0
) -> Iterator[Callable[[LoadStep], None]]:
    """Follow load steps: by a bar, or under ``mpirun`` by a line each, fit for a log file.

    Args:
        comm: MPI communicator, or None.
        load_history: The load steps to come.
        done: How many of them were accepted before.

    Yields:
        The function to call with every load step.
    """
    steps = None if load_history.force_change else load_history.count  # some may be halved
    if comm is not None:
        of = "" if steps is None else f"/{steps}"
        yield lambda step: say(comm, f"load step {step.step}{of}: {_in_short(step)}")
        return
    columns = (
        TextColumn("[bold]load steps"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns) as bar:
        task = bar.add_task("preparing laws and block", total=steps, completed=done)
        yield lambda step: bar.update(task, advance=1, description=_in_short(step))


def _in_short(step: LoadStep) -> str:
    return f"{1e3 * step.approach_mm:.3g} µm, {step.force_N:.4g} N"


@contextmanager
def following(comm: Any) -> Iterator[tuple[Callable[[str], None], Callable[[str], None]]]:
    """Follow work of many parts: what is under way, where there is a terminal, and what is done.

    Args:
        comm: MPI communicator, or None.

    Yields:
        The functions to call with what begins, and with a line on what has ended.
    """
    console = Console(soft_wrap=True, highlight=False)
    if not speaks(comm):
        yield _nothing, _nothing
        return
    with console.status("") as status:
        yield (
            lambda text: status.update(escape(text)),
            lambda text: console.print(escape(text)),
        )


def _nothing(text: str) -> None:
    """Say nothing."""


def show_history(comm: Any, history: History) -> None:
    """Print the force–approach table and what the run says of itself.

    Args:
        comm: MPI communicator, or None.
        history: The load steps.
    """
    if not speaks(comm):
        return
    console = _wide_console(100 if history.reference is None else 116)
    header, rows = curve_cells(history)
    table = Table(box=None, padding=(0, 2, 0, 0))
    for name in header:
        table.add_column(escape(name.replace(" [", "\n[")), justify="right")
    half = _MOST_ROWS // 2
    if len(rows) > _MOST_ROWS:
        rows[half:-half] = [("…", f"{len(rows) - _MOST_ROWS} more", *[""] * (len(header) - 2))]
    for row in rows:
        table.add_row(*row)
    console.print(table)
    for note in history.notes:
        console.print(f"note: {escape(note)}")


def _wide_console(least: int = 100) -> Console:
    """Return a console of at least so many columns, which is what tables need in a log file."""
    console = Console(highlight=False)
    console.width = max(console.width, least)
    return console


def show_files(comm: Any, files: Sequence[Path]) -> None:
    """Print where results are.

    Args:
        comm: MPI communicator, or None.
        files: The files written, all in one folder.
    """
    if speaks(comm) and files:
        folder = files[0].parent
        names = ", ".join(path.name for path in files)
        Console(soft_wrap=True, highlight=False).print(f"results in {escape(str(folder))}: {names}")
