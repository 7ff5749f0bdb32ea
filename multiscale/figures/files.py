"""The files of figures, drawn here or by a process beside this one while that computes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

from multiscale.figures import by_matplotlib
from support.errors import NotInstalled
from support.whole_files import write_bytes


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
    return Pictures({f"{drawing.name}.{kind}": content for kind, content in contents.items()})


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
    """A process that draws figures while this one computes.

    It loads what drawing needs when it is made, and ends when this process does, however that ends.
    Figures that it does not come to, as where memory runs out, are drawn here.
    """

    def __init__(self) -> None:
        self._connection, there = Pipe()
        handle, nowhere = there.fileno(), subprocess.DEVNULL
        call = f"from multiscale.figures.files import serve; serve({handle})"
        packages = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OMP_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", call], env=os.environ | packages, pass_fds=[handle],
            stdin=nowhere, stdout=nowhere, stderr=nowhere, start_new_session=True,
        )  # fmt: skip
        there.close()
        # PETSc ends this process when another one has closed its end, unless the signal is blocked
        block = signal.pthread_sigmask
        self._line = ThreadPoolExecutor(
            1, initializer=block, initargs=(signal.SIG_BLOCK, [signal.SIGPIPE])
        )
        self._ended = False

    def draw(self, drawing: Drawing) -> Future[Pictures]:
        """Let the process draw a figure after those before it.

        Args:
            drawing: The figure.
        """
        return self._line.submit(self._drawn, drawing)

    def close(self) -> None:
        """End the process; figures that are not drawn are wanted no longer."""
        self._ended = True
        self._process.kill()
        self._line.shutdown(cancel_futures=True)
        self._process.wait()
        self._connection.close()

    def _drawn(self, drawing: Drawing) -> Pictures:
        try:
            self._connection.send(drawing)
            answer = self._connection.recv()
        except (OSError, EOFError):
            answer = Pictures({}) if self._ended else pictures_of(drawing)
        if isinstance(answer, str):
            raise RuntimeError(answer)
        return answer


def serve(handle: int) -> None:
    """Draw figures for the process at the other end of a connection, until that ends.

    Args:
        handle: Number of the file that is this end.
    """
    connection = Connection(handle)
    with suppress(Exception):  # it is told with the first figure
        for module in ("contact", "curves", "surface"):
            import_module(f"multiscale.figures.{module}")
    with suppress(OSError, EOFError):
        while True:
            drawing = connection.recv()
            try:
                connection.send(pictures_of(drawing))
            except Exception:
                connection.send(traceback.format_exc())
