"""Keeps what the fields of the load steps that a scene names are made from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from geometry import Control
from multiscale.couplings.coupling import Coupling
from multiscale.loading.load_step import LoadStep
from multiscale.observers.observer import StepObserver


class FieldRecorder(StepObserver):
    """Keeps the states that fields are written from.

    Args:
        coupling: What finds the load steps.

    Attributes:
        kept: States by number of the load step, see `Coupling.field_state`.
    """

    def __init__(self, coupling: Coupling) -> None:
        self._coupling = coupling
        self._wanted = coupling.scene.output.wants_fields
        self.kept: dict[int, Any] = {}

    def observe(self, step: LoadStep, before: LoadStep | None, *, last: bool) -> LoadStep:
        """Keep the state of a load step whose fields may be wanted."""
        if self._coupling.has_body and self._wanted(step.step, last=True):
            if not self._wanted(step.step, last=False):
                self.kept.clear()  # only those of the last load step are wanted
            self.kept[step.step] = self._coupling.field_state(step)
        return step

    def write(self, path: Path, steps: Sequence[LoadStep], *, finished: bool) -> None:
        """Write the fields as XDMF and VTX; see `Coupling.write_fields`.

        Args:
            path: File to write, ending in ``.xdmf``.
            steps: The load steps.
            finished: Whether none follows. Steps of an earlier call are then pressed to again.

        Note:
            Collective.
        """
        if finished:
            self._complete(steps)
        self._coupling.write_fields(path, self.kept, steps)

    def _complete(self, steps: Sequence[LoadStep]) -> None:
        """Press to load steps again whose fields are wanted, but were not kept by a resumed run."""
        missing = [
            step.step
            for step in steps
            if step.step not in self.kept and self._wanted(step.step, last=step is steps[-1])
        ]
        if not missing:
            return
        again, past = [step for step in steps if step.step in missing], self._coupling.past
        if past is not None and self._coupling.scene.micro.hardness is not None:
            # what earlier load steps left behind depends on all of them, from the first
            self._coupling.past = (None, None)
            again = [step for step in steps if step.step <= max(missing)]
        for step in again:
            self._coupling.press(Control(approach=step.approach_mm, tilt=step.tilt))
            if step.step in missing:
                self.observe(step, None, last=step is steps[-1])
        self._coupling.past = past
