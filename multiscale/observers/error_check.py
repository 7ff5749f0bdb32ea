"""Measures the errors of the load steps that a scene asks for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from geometry import NotConverged
from multiscale.couplings.coupling import Coupling
from multiscale.loading.load_step import LoadStep
from multiscale.observers.observer import StepObserver

_AFTER_UNLOADING = (
    "errors of load steps after unloading are not measured: the plastic depth there is that of the "
    "load steps before"
)


class ErrorCheck(StepObserver):
    """Adds measured errors to load steps, as the scene's ``output.check`` says.

    Args:
        coupling: What finds the load steps.
        has_unloaded: Tells whether the load was larger before.
    """

    def __init__(self, coupling: Coupling, has_unloaded: Callable[[], bool]) -> None:
        self._coupling, self._has_unloaded = coupling, has_unloaded
        self._check = coupling.scene.output.check
        self._notes: dict[str, None] = {}

    def observe(self, step: LoadStep, before: LoadStep | None, *, last: bool) -> LoadStep:
        """Return the load step with its errors, where they are to be measured."""
        asked = self._check == "all" or (self._check == "last" and last)
        if not asked or self._coupling.cells is None:
            return step
        # the plastic depth is then not that of rising loads, which the check solves for
        if self._coupling.scene.micro.hardness is not None and self._has_unloaded():
            self._notes[_AFTER_UNLOADING] = None
            return step
        with self._coupling.clock.phase("check"):
            try:
                return self._coupling.checked(step) or step
            except NotConverged as error:
                self._notes[f"errors of load step {step.step} not measured: {error}"] = None
                return step

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield why errors were not measured."""
        yield from self._notes
