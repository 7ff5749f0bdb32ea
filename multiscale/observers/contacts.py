"""Records the contact of the load steps that a scene asks for, and their interfacial stiffness."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from geometry import NotConverged
from multiscale.couplings.coupling import Coupling
from multiscale.loading.load_step import LoadStep
from multiscale.observers.observer import StepObserver
from multiscale.results.contact_record import ContactRecord


class StiffnessObserver(StepObserver):
    """Adds the interfacial stiffness to load steps, where it is known.

    Args:
        coupling: What finds the load steps.
    """

    def __init__(self, coupling: Coupling) -> None:
        self._coupling = coupling

    def observe(self, step: LoadStep, before: LoadStep | None, *, last: bool) -> LoadStep:
        """Return the load step with its interfacial stiffness."""
        stiffness = self._coupling.stiffness()
        return replace(
            step,
            stiffness_N_per_mm=stiffness.value,
            stiffness_error_N_per_mm=None if stiffness.value is None else stiffness.error,
            linear_iterations=step.linear_iterations + stiffness.iterations,
        )


class ContactRecorder(StepObserver):
    """Records contacts as the scene's ``output.contact`` says.

    Args:
        coupling: What finds the load steps.

    Attributes:
        records: The contacts so far, the same on every rank.
    """

    def __init__(self, coupling: Coupling) -> None:
        self._coupling, self._asked = coupling, coupling.scene.output.contact
        if coupling.has_laws and self._asked == "auto":
            self._asked = "none"
        self.records: list[ContactRecord] = []
        self._state: Any = None
        self._seen = 0
        self._failures: list[str] = []

    def observe(self, step: LoadStep, before: LoadStep | None, *, last: bool) -> LoadStep:
        """Record the contact of a load step if it is requested."""
        self._state, self._seen = self._coupling.contact_state(), step.step
        return self._recorded(step) if last or self._asked == "all" else step

    def finish(self, step: LoadStep) -> LoadStep:
        """Record the contact of the last load step of a run that ended early."""
        return self._recorded(step)

    def _recorded(self, step: LoadStep) -> LoadStep:
        """Return the load step with the largest pressure of its contact, which is recorded once."""
        known = bool(self.records) and self.records[-1].step == step.step
        if self._asked == "none" or known:
            return step
        if self._seen != step.step and not self._coupling.has_laws:
            return step  # a step of an earlier call, whose state is gone
        try:
            contact = self._coupling.contact(step, self._state)
        except NotConverged as error:
            self._failures.append(f"contact of load step {step.step} not found: {error}")
            return step
        if contact is not None:
            step, detail = contact
            shown = step.counted_from(self._coupling.zero)
            lengths = self._coupling.surface.lengths
            self.records.append(ContactRecord.of(detail, shown, lengths))
        self.release()
        return step

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of contacts that laws stand for, and of those not found."""
        yield from self._failures
        if self.records:
            last = self.records[-1]
            yield from filter(None, [self._coupling.contact_note(last.step, last.force_N)])

    def release(self) -> None:
        """Let go of the contact, whose blocks stay in memory as long as it is held."""
        self._state = None
