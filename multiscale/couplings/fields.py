"""Fields of the block at chosen load steps: what they are made from, and how they are written.

Where the block was pressed as a mesh, its displacements are kept. Elsewhere a block with a flat top
is meshed after the load, and loaded by the contact pressures: by those of the cells or asperities,
summed over the facets of the mesh, or with laws by the mean pressures of the patches.

Theory: demos/theory.md, section 11.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry import Control, PatchGrid
from multiscale.couplings.body import embedding
from multiscale.couplings.contact import ContactCoupling
from multiscale.couplings.law_couplings import EmbeddedCoupling
from multiscale.couplings.reference import ReferenceCoupling
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import Coupling
from multiscale.setup.problem import ProblemSetup

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import LoadedFace

Array = NDArray[np.float64]


class FieldRecord:
    """What the fields of the load steps that a scene asks for are made from.

    Args:
        setup: The problem set up from the scene.
        comm: MPI communicator; None for this process alone.

    Attributes:
        kept: By number of the load step the state of a reference, this rank's displacements of a
            mesh under laws [mm], or else the pressures of the parts of the contact face [MPa].
    """

    def __init__(self, setup: ProblemSetup, comm: Any) -> None:
        self._setup, self._comm = setup, comm
        self.kept: dict[int, Any] = {}

    def keep(self, coupling: Coupling, step: LoadStep) -> None:
        """Keep what the fields of the load step just accepted are made from, if they are wanted.

        Args:
            coupling: What found it.
            step: The load step.

        Note:
            Collective.
        """
        wanted = self._setup.scene.output.wants_fields
        if not self._setup.has_block or not wanted(step.step, last=True):
            return
        if not wanted(step.step, last=False):
            self.kept.clear()  # only those of the last load step are wanted
        if isinstance(coupling, ReferenceCoupling):
            self.kept[step.step] = coupling.latest
        elif isinstance(coupling, EmbeddedCoupling):
            self.kept[step.step] = coupling.displacement
        elif isinstance(coupling, ContactCoupling):
            self.kept[step.step] = coupling.pressures_on(self._parts(coupling))
        else:
            self.kept[step.step] = step.patches.pressure_MPa

    def complete(self, coupling: Coupling, steps: Sequence[LoadStep]) -> None:
        """Press to load steps again whose fields are wanted, but were not kept by a resumed run.

        Args:
            coupling: What found them.
            steps: All load steps of a run that is finished.

        Note:
            Collective.
        """
        wanted = self._setup.scene.output.wants_fields
        for step in steps:
            if step.step not in self.kept and wanted(step.step, last=step is steps[-1]):
                coupling.press(Control(approach=step.approach_mm, tilt=step.tilt))
                self.keep(coupling, step)

    def write(self, path: Path, coupling: Coupling | None, steps: Sequence[LoadStep]) -> None:
        """Write the fields as XDMF and VTX, see `macro.write_fields`.

        Args:
            path: File to write, ending in ``.xdmf``.
            coupling: What found the load steps.
            steps: The load steps.

        Note:
            Collective.
        """
        import macro

        if isinstance(coupling, ReferenceCoupling):
            macro.write_rough_fields(path, coupling.finest, sorted(self.kept.items()))
            return
        face, fields = self.on_body(coupling, steps)
        macro.write_fields(path, face, fields)

    def on_body(
        self, coupling: Coupling | None, steps: Sequence[LoadStep]
    ) -> tuple[LoadedFace, Iterator[tuple[int, Array, Array]]]:
        """Return the flat body, meshed where it was not yet, and its fields of the load steps.

        Args:
            coupling: What found the load steps; not a reference.
            steps: The load steps.

        Returns:
            The parts of the contact face of the body, and by load step its number, this rank's
            displacements [mm] and the pressures of the parts [MPa].

        Note:
            Collective.
        """
        kept = sorted(self.kept.items())
        if isinstance(coupling, EmbeddedCoupling):
            pressures = {step.step: step.patches.pressure_MPa for step in steps}
            fields = ((number, u, pressures[number]) for number, u in kept)
            return coupling.face, fields
        face = replace(embedding(self._setup, self._comm), patches=self._parts(coupling))

        def solved() -> Iterator[tuple[int, Array, Array]]:
            for number, pressure in kept:
                found = face.body.solve(face.load(pressure))
                yield number, found.x.array[: face.body.owned_dofs].copy(), pressure

        return face, solved()

    def _parts(self, coupling: Coupling | None) -> PatchGrid:
        """Return the parts of the contact face: facets of the mesh where contacts are known."""
        if not isinstance(coupling, ContactCoupling):
            return self._setup.patches
        nx, ny, _ = self._setup.shape.cells
        return PatchGrid(grid=(nx, ny), lengths=self._setup.surface.lengths)
