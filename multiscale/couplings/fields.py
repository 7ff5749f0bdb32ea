"""Fields of the block at chosen load steps: what they are made from, and how they are written.

Where the block was pressed as a mesh, its displacements are kept. Elsewhere a block with a flat top
is meshed after the load, and loaded by the contact pressures: by those of the cells or asperities,
summed over the facets of the mesh, or with laws by the mean pressures of the patches.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry import Control, PatchGrid
from multiscale.couplings.contact import ContactCoupling
from multiscale.couplings.law_couplings import EmbeddedCoupling
from multiscale.couplings.patch_compliance import embedding
from multiscale.couplings.reference import ReferenceCoupling
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import Coupling
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.surface_and_block import FIELD_CELLS

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import FacePair, LoadedFace
    from macro.fields import Pressures

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
            moved = coupling.displacement
            at_points = self._setup.samples
            self.kept[step.step] = (moved, coupling.point_pressures) if at_points else moved
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
        missing = [
            step.step
            for step in steps
            if step.step not in self.kept and wanted(step.step, last=step is steps[-1])
        ]
        again = [step for step in steps if step.step in missing]
        past = None
        if self._setup.scene.micro.hardness is not None and isinstance(coupling, ContactCoupling):
            # what earlier load steps left behind is found by all of them, from the first
            past, coupling.past = coupling.past, (None, None)
            again = [step for step in steps if step.step <= max(missing, default=0)]
        for step in again:
            coupling.press(Control(approach=step.approach_mm, tilt=step.tilt))
            if step.step in missing:
                self.keep(coupling, step)
        if past is not None and isinstance(coupling, ContactCoupling):
            coupling.past = past

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
        counter = self._setup.bodies.counter
        if counter is not None:
            face, fields = self.on_body(coupling, steps, counter=True)
            macro.write_fields(path.with_name(f"counter_{path.name}"), face, fields)

    def on_body(
        self, coupling: Coupling | None, steps: Sequence[LoadStep], *, counter: bool = False
    ) -> tuple[LoadedFace, Iterator[tuple[int, Array, Pressures]]]:
        """Return a flat body, meshed where it was not yet, and its fields of the load steps.

        Args:
            coupling: What found the load steps; not a reference.
            steps: The load steps.
            counter: Whether it is the counter-body, of two bodies on meshes.

        Returns:
            The parts of the contact face of the body, and by load step its number, this rank's
            displacements [mm] and the pressures of the parts [MPa].

        Note:
            Collective.
        """
        kept = sorted(self.kept.items())
        if isinstance(coupling, EmbeddedCoupling):
            if self._setup.samples:
                return _one(coupling.face, counter), self._of_samples(coupling, kept, counter)
            pressures = {step.step: step.patches.pressure_MPa for step in steps}
            moved = ((k, _half(coupling.face, u, counter), pressures[k]) for k, u in kept)
            return _one(coupling.face, counter), moved
        whole = _one(embedding(self._setup, self._comm), counter)
        face = replace(whole, patches=self._parts(coupling))

        def solved() -> Iterator[tuple[int, Array, Pressures]]:
            for number, pressure in kept:
                found = face.body.solve(face.load(pressure))
                yield number, found.x.array[: face.body.owned_dofs].copy(), pressure

        return face, solved()

    def _of_samples(
        self, coupling: EmbeddedCoupling, kept: Sequence[tuple[int, Any]], counter: bool
    ) -> Iterator[tuple[int, Array, Pressures]]:
        """Yield the fields under laws of samples; the first body alone has the pressures."""
        from macro import AtPoints

        for number, (displacement, pressure) in kept:
            shown = None if counter else AtPoints(pressure)
            yield number, _half(coupling.face, displacement, counter), shown

    def _parts(self, coupling: Coupling | None) -> PatchGrid:
        """Return the parts of the contact face: facets of the mesh where contacts are known."""
        if not isinstance(coupling, ContactCoupling):
            return self._setup.patches
        if self._setup.block_shape is None:
            x, y = map(min, self._setup.surface.grid, FIELD_CELLS[:2])
            return PatchGrid(grid=(x, y), lengths=self._setup.surface.lengths)
        nx, ny, _ = self._setup.shape.cells
        return PatchGrid(grid=(nx, ny), lengths=self._setup.surface.lengths)


def _one(face: LoadedFace | FacePair, counter: bool) -> LoadedFace:
    """Return the face of one of two bodies, or that of the only one."""
    from macro import FacePair

    if isinstance(face, FacePair):
        return face.second if counter else face.first
    return face


def _half(face: LoadedFace | FacePair, displacement: Array, counter: bool) -> Array:
    """Return the displacements of one of two bodies, or those of the only one."""
    from macro import FacePair

    if isinstance(face, FacePair):
        return face.body.split(displacement)[counter]
    return displacement
