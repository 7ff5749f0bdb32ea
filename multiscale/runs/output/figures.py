"""The files of figures, drawn here, by processes beside this one, or shared by the ranks."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import chain
from multiprocessing import get_context
from multiprocessing.connection import Connection
from threading import Lock, local
from typing import TYPE_CHECKING, Any, NamedTuple

from patchlaw.geometry import roughness
from patchlaw.multiscale.results.contacts import ContactScales, shown_contacts
from patchlaw.multiscale.results.run_curves import over_pressure, slides
from patchlaw.support import NotInstalled, cores, shared
from patchlaw.support.packages import by_matplotlib, load_matplotlib_without_help

if TYPE_CHECKING:  # processes that draw import this module
    from patchlaw.multiscale.laws.law_table import LawTable
    from patchlaw.multiscale.models.coupling import Coupling
    from patchlaw.multiscale.runs.scene_run import Run
    from patchlaw.multiscale.scene.scene import Scene

SURFACE_OF_ZONE, CONTACT_OF_STEP = OF_REPORT = "surface_of_zone_", "contact_of_step_"
"""Beginnings of the names of pictures that stand in the report alone, of the surfaces of further
regions and of contacts, which a slider chooses from; a number follows."""

_PRELOADED = [
    f"patchlaw.multiscale.results.figures.{name}"
    for name in ("drawing_server", "contact", "curves", "surface")
]
_PRELOADED += [f"PIL.{kind}ImagePlugin" for kind in ("Bmp", "Gif", "Jpeg", "Png", "Ppm")]
_PRELOADED += [
    "matplotlib.backends.backend_agg",
    "scipy.fft",
    "patchlaw.multiscale.runs.output.figures",
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
        figure = by_matplotlib(f"multiscale.results.{drawing.function}", *drawing.arguments)
        contents = by_matplotlib("multiscale.results.figures.style.encoded", figure, drawing.kinds)
    except NotInstalled as error:
        return Pictures({}, f"no figures are drawn: {error}")
    except Exception as error:  # of matplotlib, or of a program that it calls
        told = " ".join(f"{type(error).__name__}: {error}".split())
        return Pictures({}, f"figures are missing, as drawing them failed: {told[:300]}")
    return Pictures({f"{drawing.name}.{kind}": content for kind, content in contents.items()})


class FigureProcesses:
    """Processes that draw figures while this one computes, or waits for them.

    They are forks of a server that loads meanwhile what drawing needs, and end when this process
    does. Figures that they do not come to, as where memory runs out, are drawn here.

    Args:
        count: Largest number of processes.

    Raises:
        OSError: When none can be started.
        ValueError: When the system, as Windows, has no forks.
    """

    def __init__(self, count: int) -> None:
        self._context = get_context("forkserver")
        self._context.set_forkserver_preload(_PRELOADED)
        from multiprocessing.forkserver import ensure_running

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
    gc.freeze()
    with suppress(OSError, EOFError), _few_searches():
        while True:
            there.send(pictures_of(there.recv()))


@contextmanager
def _few_searches() -> Iterator[None]:
    """Search rarely for objects that only refer to each other, see `_MANY_OBJECTS`."""
    before = gc.get_threshold()
    gc.set_threshold(_MANY_OBJECTS)
    try:
        yield
    finally:
        gc.set_threshold(*before)


_MOST_PROCESSES = 3
"""Processes that draw; a run has five to nine figures."""
_LONG = ("block", "contact", "surface")
"""Figures that take longer than others."""


def surface_drawing(coupling: Coupling) -> Drawing:
    """Return the figure of a scene's surface, with its summits where the micro model uses them.

    Args:
        coupling: What was made of the scene.
    """
    output, spectrum = coupling.scene.output, coupling.scene.surface.spectrum
    surface = replace(coupling.parts.surface)  # without its interpolant, which is not drawn
    rough = roughness(coupling.parts.surface)
    about = surface, coupling.parts.summits, coupling.parts.patches, spectrum, rough
    return Drawing("surface", "figures.surface.surface_figure", about, file_kinds(output.figures))


def law_drawing(laws: LawTable, scene: Scene) -> Drawing:
    """Return the figure of the laws of a scene.

    Args:
        laws: The laws.
        scene: The scene.
    """
    kinds = file_kinds(scene.output.figures)
    return Drawing("laws", "figures.curves.law_figure", (laws,), kinds)


class RunFigures:
    """The figures of a run.

    Ranks share them at its end. Of a process on its own with a further core, other processes draw
    them: surface and laws while load steps are made.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone.
    """

    def __init__(self, scene: Scene, comm: Any) -> None:
        self._figures, self._comm = scene.output.figures, comm
        self._processes: FigureProcesses | None = None
        self._begun: dict[str, Future[Pictures]] = {}

    def __enter__(self) -> RunFigures:
        """Start the processes that draw, which load what they need while the run is set up."""
        if self._figures and self._comm is None and (count := cores()) > 1:
            with suppress(OSError, ValueError):  # none can be started, and figures are drawn here
                self._processes = FigureProcesses(min(count, _MOST_PROCESSES))
        if self._figures and self._processes is None:
            load_matplotlib_without_help()
        return self

    def __exit__(self, *error: object) -> None:
        """End the processes that draw."""
        if self._processes is not None:
            self._processes.close()

    def begin(self, run: Run) -> None:
        """Have those drawn beside the load steps that do not depend on them.

        Args:
            run: The run.
        """
        # larger ones take minutes beside their figures, and long to send
        if run.coupling.parts.surface.heights.size > 2**20:
            self.__exit__()
            self._processes = None
        if self._processes is not None:
            for drawing in self._before_load_steps(run):
                self._begun[drawing.name] = self._processes.draw(drawing)

    def drawn(self, run: Run) -> dict[str, bytes]:
        """Return the files of all figures by name; none without a load step, or where unwanted.

        Why figures are missing becomes a note of the run.

        Args:
            run: The run.

        Note:
            Collective.
        """
        if not self._figures or not run.steps:
            return {}
        with run.clock.phase("output"):
            drawings = [*self._after_load_steps(run), *self._before_load_steps(run)]
            drawings.sort(key=lambda one: one.name not in _LONG)  # long ones first
            if (processes := self._processes) is None:
                with _few_searches():
                    drawn = shared(
                        self._comm, len(drawings), lambda index: pictures_of(drawings[index])
                    )
            else:
                begun = [self._begun.get(one.name) or processes.draw(one) for one in drawings]
                drawn = [one.result() for one in begun]
        run.remark(filter(None, (one.problem for one in drawn)))
        return dict(chain.from_iterable(one.files.items() for one in drawn))

    def _before_load_steps(self, run: Run) -> Iterator[Drawing]:
        yield surface_drawing(run.coupling)
        parts = run.coupling.parts
        for zone, region in enumerate(parts.samples[1:] if run.scene.output.report else (), 1):
            about = replace(region.surfaces[0]), None, parts.patches
            yield Drawing(f"{SURFACE_OF_ZONE}{zone}", "figures.surface.surface_figure", about)
        if (laws := run.laws) is not None:
            yield law_drawing(laws, run.scene)

    def _after_load_steps(self, run: Run) -> Iterator[Drawing]:
        """Yield the figures of what was found.

        Note:
            Collective.
        """
        coupling, history = run.coupling, run.history()
        surface, of_samples = replace(coupling.parts.surface), coupling.parts.regions is not None
        face = coupling.model.facet_pressures() if of_samples and coupling.made_model else None
        figures: dict[str, tuple[str, Any]] = {
            "overview": ("contact.overview_figure", (surface, of_samples, history, face)),
            "curves": ("curves.history_figure", (history, run.scene.kind)),
        }
        if over_pressure(history):
            figures["over_pressure"] = "curves.over_pressure_figure", (history, run.scene.kind)
        if slides(history).any():
            figures["wear"] = "curves.wear_figure", (history, run.scene.kind)
        if not of_samples:
            figures["pressures"] = "contact.pressure_figure", (history,)
        if face is not None:
            figures["face"] = "contact.face_figure", (*face, history.steps[-1])
        if (contact := history.contact) is not None:
            figures["contact"] = "contact.contact_figure", (contact,)
            if contact.worn_depth_mm is not None:
                slid = next(one.slid_mm for one in history.steps if one.step == contact.step)
                made = replace(getattr(coupling.parts.micro, "surface", surface))
                figures["worn"] = "contact.worn_figure", (made, contact, slid)
            of_cells = getattr(contact.pressure_MPa, "shape", None) == surface.grid
            if self._figures in ("all", "svg") and of_cells and contact.force_N > 0.0:
                ratio = coupling.parts.materials.first.poisson_ratio
                figures["block"] = "surface.contact_block", (surface, contact, ratio)
        for one in run.observers:
            figures |= {name: (what, of) for name, what, of in one.figures(history)}
        for name, (function, arguments) in figures.items():
            yield Drawing(name, f"figures.{function}", arguments, file_kinds(self._figures))
        if run.scene.output.report:
            shown = shown_contacts(history.contact_records)
            scales = ContactScales.of(shown)
            for record in shown:
                name, of_report = f"{CONTACT_OF_STEP}{record.step}", (record, scales)
                yield Drawing(name, "figures.contact.contact_maps", of_report)
