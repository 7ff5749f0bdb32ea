"""How long the phases of a run take, and the progress of long tasks.

Progress is shown in terminals, under ``mpirun`` and in notebooks.
"""

from __future__ import annotations

import html
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from math import ceil
from typing import Any

from patchlaw.multiscale.console import console_of, escape, speaks
from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.readable import Observer, duration, quantity
from patchlaw.support.parallel import place_in

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
        yield (
            lambda text: status.update(escape(text)),
            lambda text: lines.print(escape(text)),
        )


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
