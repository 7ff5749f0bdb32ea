"""The files of figures, drawn here or by processes beside this one."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from threading import Lock
from typing import Any, NamedTuple

from patchlaw.multiscale.figures import by_matplotlib
from patchlaw.support.errors import NotInstalled
from patchlaw.support.whole_files import write_bytes

_BROKEN_PIPE = [signal.SIGPIPE]
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


def load_without_help() -> None:
    """Load matplotlib without the help on its artists, which takes a third of the time to load.

    For processes in which nobody asks for help. Where matplotlib cannot be loaded, drawing says so.
    """
    if "matplotlib.artist" not in sys.modules:
        with suppress(Exception):
            vars(import_module("matplotlib.artist"))["kwdoc"] = lambda _: ""


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


class FigureProcess:
    """Processes that draw figures while this one computes, or waits for them.

    The first loads what drawing needs, and the others are its forks. All of them end when this
    process does, however that ends. Figures that they do not come to, as where memory runs out, are
    drawn here.

    Args:
        count: Number of processes.
    """

    def __init__(self, count: int = 1) -> None:
        ends = [Pipe() for _ in range(count)]
        handles, nowhere = [there.fileno() for _, there in ends], subprocess.DEVNULL
        call = f"from patchlaw.multiscale.figures.files import serve; serve({handles})"
        packages = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OMP_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", call], env=os.environ | packages, pass_fds=handles,
            stdin=nowhere, stdout=nowhere, stderr=nowhere, start_new_session=True, cwd=sys.prefix,
        )  # fmt: skip
        self._connections, self._free = [here for here, _ in ends], SimpleQueue[Connection]()
        for here, there in ends:
            there.close()
            self._free.put(here)
        self._beside, self._together = (_line(threads) for threads in (1, count))
        self._ended, self._here = False, Lock()

    def draw(self, drawing: Drawing, *, beside: bool = False) -> Future[Pictures]:
        """Let a process draw a figure.

        Args:
            drawing: The figure.
            beside: Whether this process computes meanwhile. Such figures are drawn one after
                another.
        """
        return (self._beside if beside else self._together).submit(self._drawn, drawing)

    def close(self) -> None:
        """End the processes; figures that are not drawn are wanted no longer."""
        self._ended = True
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        for line in (self._beside, self._together):
            line.shutdown(cancel_futures=True)
        self._process.wait()
        for connection in self._connections:
            connection.close()

    def _drawn(self, drawing: Drawing) -> Pictures:
        connection = self._free.get()
        try:
            connection.send(drawing)
            answer: Pictures = connection.recv()
        except (OSError, EOFError):
            with self._here:  # two threads must not draw at once
                answer = Pictures({}) if self._ended else pictures_of(drawing)
        finally:
            self._free.put(connection)
        return answer


def _line(threads: int) -> ThreadPoolExecutor:
    """Return threads that wait for the processes."""
    # PETSc ends this process when another one has closed its end, unless the signal is blocked
    block = signal.pthread_sigmask
    return ThreadPoolExecutor(threads, initializer=block, initargs=(signal.SIG_BLOCK, _BROKEN_PIPE))


def serve(handles: Sequence[int]) -> None:
    """Draw figures for the process at the other end of connections, until that ends.

    Args:
        handles: Numbers of the files that are these ends; each gets a process.
    """
    load_without_help()
    with suppress(Exception):  # it is told with the first figure
        for module in ("contact", "curves", "surface"):
            import_module(f"patchlaw.multiscale.figures.{module}")
    gc.set_threshold(_MANY_OBJECTS)
    gc.freeze()
    own, *others = handles
    for other in others:
        if os.fork() == 0:
            own = other
            break
    for handle in handles:  # a connection ends with the process that serves it
        if handle != own:
            os.close(handle)
    connection = Connection(own)
    with suppress(OSError, EOFError):
        while True:
            drawing = connection.recv()
            try:
                connection.send(pictures_of(drawing))
            except Exception as error:
                connection.send(_not_drawn(error))
