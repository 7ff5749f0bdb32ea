"""The figures of a run, drawn by other processes or shared by the ranks.

Each is drawn once, for its file and for the report.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from typing import Any

from patchlaw.geometry.statistics import roughness
from patchlaw.multiscale.couplings.coupling import Coupling
from patchlaw.multiscale.output.figures import (
    Drawing,
    FigureProcesses,
    Pictures,
    file_kinds,
    pictures_of,
)
from patchlaw.multiscale.output.report import CONTACT_OF_STEP, shown_contacts
from patchlaw.multiscale.results.contacts import ContactRecord, ContactScales
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene_run import Run
from patchlaw.support.parallel import cores, shared

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


def _contacts_of_steps(contacts: Sequence[ContactRecord]) -> Iterator[Drawing]:
    """Yield figures of several contacts, which have the same colour scales, for the report."""
    shown = shown_contacts(contacts)
    scales = ContactScales.of(shown)
    for record in shown:
        name = f"{CONTACT_OF_STEP}{record.step}"
        yield Drawing(name, "figures.contact.contact_maps", (record, scales))


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
            with suppress(OSError):  # none can be started, and figures are drawn here
                self._processes = FigureProcesses(min(count, _MOST_PROCESSES))
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

    def drawn(self, run: Run) -> list[Pictures]:
        """Return the files of all figures; none of a run without load steps, or that wants none.

        Args:
            run: The run.

        Note:
            Collective.
        """
        if not self._figures or not run.steps:
            return []
        with run.clock.phase("output"):
            drawings = [*self._after_load_steps(run), *self._before_load_steps(run)]
            drawings.sort(key=lambda one: one.name not in _LONG)  # long ones first
            if (processes := self._processes) is None:
                comm = self._comm
                return shared(comm, len(drawings), lambda index: pictures_of(drawings[index]))
            begun = [self._begun.get(one.name) or processes.draw(one) for one in drawings]
            return [one.result() for one in begun]

    def _before_load_steps(self, run: Run) -> Iterator[Drawing]:
        yield surface_drawing(run.coupling)
        if (laws := run.laws) is not None:
            kinds = file_kinds(self._figures)
            yield Drawing("laws", "figures.curves.law_figure", (laws,), kinds)

    def _after_load_steps(self, run: Run) -> Iterator[Drawing]:
        """Yield the figures of what was found.

        Note:
            Collective.
        """
        coupling, history = run.coupling, run.history()
        surface, of_samples = replace(coupling.parts.surface), coupling.parts.regions is not None
        face = coupling.solver.face_pressures() if of_samples and coupling.made_solver else None
        figures: dict[str, tuple[str, Any]] = {
            "overview": ("contact.overview_figure", (surface, of_samples, history, face)),
            "curves": ("curves.history_figure", (history, run.scene.kind)),
        }
        if not of_samples:
            figures["pressures"] = "contact.pressure_figure", (history,)
        if face is not None:
            figures["face"] = "contact.face_figure", (face, history.steps[-1])
        if run.contacts:
            contact = run.contacts[-1]
            figures["contact"] = "contact.contact_figure", (contact,)
            of_cells = getattr(contact.pressure_MPa, "shape", None) == surface.grid
            if self._figures in ("all", "svg") and of_cells and contact.force_N > 0.0:
                ratio = coupling.parts.materials.first.poisson_ratio
                figures["block"] = "block.contact_block", (surface, contact, ratio)
        for name, function, of in run.observers.figures(history):
            figures[name] = function, of
        for name, (function, arguments) in figures.items():
            yield Drawing(name, f"figures.{function}", arguments, file_kinds(self._figures))
        if run.scene.output.report:
            yield from _contacts_of_steps(run.contacts)
