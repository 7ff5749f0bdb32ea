"""The files of figures, drawn here or by processes beside this one."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.forkserver import ensure_running
from pathlib import Path
from threading import Lock, local
from typing import Any, NamedTuple

from patchlaw.multiscale.figures import by_matplotlib
from patchlaw.support.errors import NotInstalled
from patchlaw.support.files import write_bytes

_PRELOADED = [
    f"patchlaw.multiscale.figures.{name}"
    for name in ("drawing_server", "contact", "curves", "surface")
]
_PRELOADED += [f"PIL.{kind}ImagePlugin" for kind in ("Bmp", "Gif", "Jpeg", "Png", "Ppm")]
_PRELOADED += [
    "matplotlib.backends.backend_agg",
    "scipy.fft",
    "patchlaw.multiscale.results.history",
]
"""Modules that every drawing needs, with those that they load late."""
_ENVIRONMENT = {"PYTHONSAFEPATH": "1", "OMP_NUM_THREADS": "1"}
"""Environment of the server: without the first it imports what lies in the user's folder, without
the second its threads are in the way of those that compute."""
_MANY_OBJECTS = 100_000
"""Objects made between two searches for those that only refer to each other. A figure makes some
200,000; with Python's 700 the searches take 6 % of the time."""


class Drawing(NamedTuple):
    """A figure that is to be drawn.

    Attributes:
        name: Name of its files without an ending.
        function: Module and name of the function that draws it, within `multiscale`.
        arguments: What the function takes.
        kinds: Kinds of its files, see `file_kinds`.
    """

    name: str
    function: str
    arguments: tuple[Any, ...]
    kinds: Sequence[str] = ("png",)


class Pictures(NamedTuple):
    """The files of figures.

    Attributes:
        files: Their contents by name.
        problem: Why there are none; empty where there are.
    """

    files: dict[str, bytes]
    problem: str = ""

    def without(self, beginning: str) -> Pictures:
        """Return the files whose names do not begin as those do that only a report shows.

        Args:
            beginning: The beginning of their names.
        """
        kept = {name: one for name, one in self.files.items() if not name.startswith(beginning)}
        return Pictures(kept, self.problem)


def file_kinds(figures: bool | str) -> tuple[str, ...]:
    """Return the kinds of files that a scene's `output.figures` asks for."""
    return ("png", "svg") if figures == "svg" else ("png",)


def pictures_of(drawing: Drawing) -> Pictures:
    """Return the files of a figure.

    Results do not depend on figures: without matplotlib, or with one that fails, there are none.

    Args:
        drawing: The figure.
    """
    try:
        figure = by_matplotlib(drawing.function, *drawing.arguments)
        contents = by_matplotlib("figures.style.encoded", figure, drawing.kinds)
    except NotInstalled as error:
        return Pictures({}, f"no figures are drawn: {error}")
    except Exception as error:  # of matplotlib, or of a program that it calls
        return _not_drawn(error)
    return Pictures({f"{drawing.name}.{kind}": content for kind, content in contents.items()})


def _not_drawn(error: Exception) -> Pictures:
    """Return what is left of figures whose drawing raised an error."""
    told = " ".join(f"{type(error).__name__}: {error}".split())
    return Pictures({}, f"figures are missing, as drawing them failed: {told[:300]}")


def write_pictures(folder: Path, drawn: Pictures) -> list[Path]:
    """Write the files of figures.

    Args:
        folder: Folder of the results; made when missing.
        drawn: The figures.

    Returns:
        The files written.
    """
    return [write_bytes(folder / name, content) for name, content in drawn.files.items()]


def write_figure(folder: Path, drawing: Drawing, tell: Callable[[str], None]) -> list[Path]:
    """Draw a figure and write its files, or tell why there are none.

    Args:
        folder: Folder of the results; made when missing.
        drawing: The figure.
        tell: Takes a sentence.

    Returns:
        The files written.
    """
    drawn = pictures_of(drawing)
    if drawn.problem:
        tell(drawn.problem)
    return write_pictures(folder, drawn)


class FigureProcesses:
    """Processes that draw figures while this one computes, or waits for them.

    They are forks of a server that loads meanwhile what drawing needs, and end when this process
    does. Figures that they do not come to, as where memory runs out, are drawn here.

    Args:
        count: Largest number of processes.

    Raises:
        OSError: When none can be started.
    """

    def __init__(self, count: int) -> None:
        self._context = get_context("forkserver")
        self._context.set_forkserver_preload(_PRELOADED)
        stated = {name: os.environ.get(name) for name in _ENVIRONMENT}
        os.environ.update(_ENVIRONMENT)
        try:
            ensure_running()
        finally:  # programs that are started later have the user's environment
            for name, value in stated.items():
                os.environ.pop(name)
                if value is not None:
                    os.environ[name] = value
        self._threads = ThreadPoolExecutor(count, "figures", self._begin)
        self._own, self._here = local(), Lock()

    def draw(self, drawing: Drawing) -> Future[Pictures]:
        """Let a process draw a figure.

        Args:
            drawing: The figure.
        """
        return self._threads.submit(self._drawn, drawing)

    def close(self) -> None:
        """Draw no more figures."""
        self._threads.shutdown(wait=False, cancel_futures=True)

    def _begin(self) -> None:
        """Start the process of a thread."""
        # PETSc ends this process when another one has closed its end, unless the signal is blocked
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGPIPE])
        self._own.connection, there = self._context.Pipe()
        with there, suppress(OSError, EOFError):
            self._context.Process(target=_serve, args=(there,), daemon=True).start()

    def _drawn(self, drawing: Drawing) -> Pictures:
        try:
            self._own.connection.send(drawing)
            drawn: Pictures = self._own.connection.recv()
        except (OSError, EOFError):
            with self._here:  # two threads must not draw at once
                return pictures_of(drawing)
        return drawn


def _serve(there: Connection) -> None:
    """Draw figures for the process at the other end of a connection, until that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # for the process that computes
    gc.set_threshold(_MANY_OBJECTS)
    gc.freeze()
    with suppress(OSError, EOFError):
        while True:
            there.send(pictures_of(there.recv()))
