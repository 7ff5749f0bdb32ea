"""The figures of a run: which there are, and when each can be drawn."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future

from multiscale.couplings.coupling import Coupling
from multiscale.figures.files import Drawing, FigureProcess, Pictures, file_kinds, pictures_of
from multiscale.run import Run
from support.collective import shared
from support.cores import cores

NAMES = ("overview", "surface", "curves", "pressures", "contact", "laws", "block", "face")
"""Names of all figures of a run."""

_MOST_CELLS = 2**20
"""Heights that are sent to another process, 8 MB; larger runs take minutes beside their figures."""


def surface_drawing(coupling: Coupling) -> Drawing:
    """Return the figure of a scene's surface, with its summits where the micro model uses them.

    Args:
        coupling: What was made of the scene.
    """
    output, spectrum = coupling.scene.output, coupling.scene.surface.spectrum
    about = coupling.surface, coupling.summits, coupling.patches, spectrum
    return Drawing("surface", "figures.surface.surface_figure", about, file_kinds(output.figures))


class RunFigures:
    """The figures of a run.

    Ranks share them at its end. Of a process on its own with a further core, another process draws
    them: surface and laws while load steps are made.

    Args:
        run: The run.
    """

    def __init__(self, run: Run) -> None:
        self._run, self._figures = run, run.scene.output.figures
        self._process: FigureProcess | None = None
        self._begun: dict[str, Future[Pictures]] = {}

    def __enter__(self) -> RunFigures:
        """Return the figures."""
        return self

    def __exit__(self, *error: object) -> None:
        """End the process that draws."""
        if self._process is not None:
            self._process.close()

    def begin(self) -> None:
        """Have those drawn beside the load steps that do not depend on them."""
        few = self._run.coupling.surface.heights.size <= _MOST_CELLS
        if self._figures and self._run.comm is None and cores() > 1 and few:
            self._process = FigureProcess()
            for drawing in self._before_load_steps():
                self._begun[drawing.name] = self._process.draw(drawing)

    def drawn(self) -> list[Pictures]:
        """Return the files of all figures; none of a run without load steps, or that wants none.

        Note:
            Collective.
        """
        if not self._figures or not self._run.steps:
            return []
        drawings = [*self._after_load_steps(), *self._before_load_steps()]
        if self._process is None:
            comm = self._run.comm
            return shared(comm, len(drawings), lambda index: pictures_of(drawings[index]))
        for drawing in drawings:
            self._begun[drawing.name] = self._begun.get(drawing.name) or self._process.draw(drawing)
        return [self._begun[drawing.name].result() for drawing in drawings]

    def _before_load_steps(self) -> Iterator[Drawing]:
        yield surface_drawing(self._run.coupling)
        if (laws := self._run.laws) is not None:
            kinds = file_kinds(self._figures)
            yield Drawing("laws", "figures.curves.law_figure", (laws,), kinds)

    def _after_load_steps(self) -> Iterator[Drawing]:
        """Yield the figures of what was found.

        Note:
            Collective.
        """
        run, coupling, history = self._run, self._run.coupling, self._run.history()
        surface, of_samples, face = (
            coupling.surface,
            coupling.regions is not None,
            (coupling.face_pressures()),
        )
        kinds = file_kinds(self._figures)
        about = surface, of_samples, history, face
        yield Drawing("overview", "figures.contact.overview_figure", about, kinds)
        yield Drawing("curves", "figures.curves.history_figure", (history, run.scene.kind), kinds)
        if not of_samples:
            yield Drawing("pressures", "figures.contact.pressure_figure", (history,), kinds)
        if face is not None:
            about = face, history.steps[-1]
            yield Drawing("face", "figures.contact.face_figure", about, kinds)
        if run.contacts:
            contact = run.contacts[-1]
            yield Drawing("contact", "figures.contact.contact_figure", (contact,), kinds)
            of_cells = getattr(contact.pressure_MPa, "shape", None) == surface.grid
            if self._figures in ("all", "svg") and of_cells:
                about = surface, contact, coupling.materials.first.poisson_ratio
                yield Drawing("block", "figures.block.contact_block", about, kinds)
