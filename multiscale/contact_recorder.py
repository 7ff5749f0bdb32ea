"""Records the contact of the load steps that a scene asks for, and their interfacial stiffness."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from geometry import Control
from micro import MicroModel
from multiscale.couplings.contact import ContactCoupling
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import Coupling, HasContact, HasStiffness
from multiscale.readable import Detail, quantity
from multiscale.results.contact_record import ContactRecord
from multiscale.setup.problem import ProblemSetup


class ContactRecorder:
    """Records contacts as the scene's ``output.contact`` says.

    Args:
        setup: The problem set up from the scene.
        comm: MPI communicator; None for this process alone.

    Attributes:
        records: The contacts so far, the same on every rank.
    """

    def __init__(self, setup: ProblemSetup, comm: Any) -> None:
        self._setup, self._comm = setup, comm
        self._asked = setup.scene.output.contact
        self.records: list[ContactRecord] = []
        self._latest: tuple[HasContact, Any, int] | None = None

    def resume(self, records: Sequence[ContactRecord]) -> None:
        """Continue after contacts that were recorded before."""
        self.records = list(records)

    def with_stiffness(self, step: LoadStep, coupling: Coupling) -> LoadStep:
        """Return a load step with its interfacial stiffness, where that is known.

        Args:
            step: A load step just accepted.
            coupling: What found it; its contact is kept for `record`.

        Note:
            Collective.
        """
        if self._asked == "none":
            return step
        if isinstance(coupling, HasContact):
            self._latest = coupling, coupling.latest, step.step
        if not isinstance(coupling, HasStiffness):
            return step
        found = coupling.stiffness()
        return replace(
            step,
            stiffness_N_per_mm=found.value,
            stiffness_error_N_per_mm=None if found.value is None else found.error,
            linear_iterations=step.linear_iterations + found.iterations,
        )

    def record(
        self, step: LoadStep, make_model: Callable[[], MicroModel], *, last: bool
    ) -> LoadStep:
        """Record the contact of a load step if it is requested and not yet recorded.

        With laws the contact problem that they stand for is solved under the step's plane.

        Args:
            step: The load step accepted last.
            make_model: Makes the micro model on the body; called where laws stand for the contact.
            last: Whether no other follows.

        Returns:
            The load step, with the largest pressure of the contact.

        Raises:
            NotConverged: When the contact problem cannot be solved.

        Note:
            Collective.
        """
        laws = self._setup.uses_laws
        asked = "none" if laws and self._asked == "auto" else self._asked
        known = bool(self.records) and self.records[-1].step == step.step
        if asked == "none" or known or not (last or asked == "all"):
            return step
        if laws:
            step = self._solved(step, make_model())
        if self._latest is not None and self._latest[2] == step.step:
            coupling, latest, _ = self._latest
            lengths, shown = self._setup.surface.lengths, step.counted_from(self._setup.zero)
            self.records.append(ContactRecord.of(coupling.detail(latest), shown, lengths))
            self.release()
        return step

    def release(self) -> None:
        """Let go of the coupling, whose blocks stay in memory as long as it is held."""
        self._latest = None

    @property
    def notes(self) -> list[str]:
        """What a report says of contacts that laws stand for."""
        if not (self._setup.uses_laws and self.records):
            return []
        last = self.records[-1]
        force = quantity(last.force_N, "N", 5)
        return [
            Detail(
                f"contact of load step {last.step}: the contact problem behind the laws, solved "
                f"under the plane of the step, with a force of {force}"
            )
        ]

    def _solved(self, step: LoadStep, model: MicroModel) -> LoadStep:
        """Solve the contact problem under the plane of a load step of laws."""
        setup = self._setup
        coupling = ContactCoupling(model, setup.patches, setup.mean_heights, self._comm)
        found = coupling.press(Control(approach=step.approach_mm, tilt=step.tilt))
        self._latest = coupling, coupling.latest, step.step
        return replace(step, peak_pressure_MPa=found.peak_pressure_MPa)
