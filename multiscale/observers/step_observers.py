"""What sees the load steps of a run: contacts, stiffness, energies, errors, and states of fields.

An observer is what is read off load steps: it returns columns of them, says what a report says of
them, and has its figures. A run makes those that its scene asks for; they see the columns of those
before them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

from patchlaw.multiscale.loading.energy import energy_notes, work_of, yielding_notes
from patchlaw.multiscale.loading.load_step import LoadStep, with_exact_zeros
from patchlaw.multiscale.models.couplings import describe
from patchlaw.multiscale.models.couplings.coupling import Coupling
from patchlaw.multiscale.models.measured_errors.errors import error_notes
from patchlaw.multiscale.readable import Detail, quantity
from patchlaw.multiscale.results.contacts import ContactRecord
from patchlaw.multiscale.results.history import History
from patchlaw.support.errors import InputError, NotConverged, PatchlawError

T = TypeVar("T")
Columns = Mapping[str, Any]
"""Values of a load step's columns, or of its other fields, by name."""

_NO_GAP_LEFT = (
    "in full contact of a period, or shortly before, other grids have no gap left at its approach"
)
_AFTER_UNLOADING = (
    "errors of load steps after unloading are not measured: the plastic depth there is that of the "
    "load steps before"
)


class StepObserver:
    """Sees every load step as it is accepted, and returns columns of it; this one none.

    Args:
        coupling: What finds the load steps.
    """

    def __init__(self, coupling: Coupling) -> None:
        self._coupling = coupling
        self._failures: dict[str, None] = {}

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return columns of a load step.

        Args:
            step: The load step just accepted, counted from first touch.
            past: All load steps before it.
            last: Whether no other follows.

        Note:
            Collective.
        """
        return {}

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of what the observer saw.

        Args:
            steps: All load steps.
        """
        yield from self._failures

    def results(self, step: LoadStep) -> Iterator[tuple[str, str]]:
        """Yield what a report lists of the last load step beside its columns: name and value.

        Args:
            step: The load step.
        """
        return iter(())

    def figures(self, history: History) -> Iterator[tuple[str, str, tuple[Any, ...]]]:
        """Yield figures: file, function in `multiscale.results.figures`, and its arguments.

        Args:
            history: All load steps.
        """
        return iter(())

    @property
    def fluid(self) -> Any:
        """The `multiscale.observers.law_leaks.FluidMap` of the last load step; None without."""
        return None

    def write_files(self, folder: Path) -> None:
        """Write files beside those of the fields; collective.

        Args:
            folder: Where they go.
        """

    def release(self) -> None:
        """Let go of what holds bodies in memory."""

    _unsolved: tuple[type[PatchlawError], ...] = (NotConverged,)
    """Errors of a problem without a solution."""

    def _tried(self, what: str, solve: Callable[[], T]) -> T | None:
        """Return what is solved for; None where there is no solution, which is noted."""
        try:
            return solve()
        except self._unsolved as error:
            self._failures[f"{what}: {error}"] = None
            return None

    def _plastic_past(self, step: LoadStep, past: Sequence[LoadStep]) -> bool:
        """Tell whether the plastic depth is not that of rising loads, which checks solve for."""
        if not self._coupling.scene.hardness_key:
            return False
        return step.force_N < (1.0 - 1e-6) * max((one.force_N for one in past), default=0.0)


class EnergyObserver(StepObserver):
    """Adds the work of the plane since the start to load steps; says what yields and is stored."""

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return the work of the plane."""
        return {"work_mJ": work_of(step, past[-1] if past else None)}

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what yields or would, and the energies at the last load step."""
        parts, said = self._coupling.parts, describe.hardnesses(self._coupling.parts)
        # peaks of samples are those of means
        if said or parts.regions is None:
            yield from yielding_notes(steps, parts.scene.micro.hardness, said)
        yield from energy_notes(steps, conservative=not self._coupling.friction_is_coupled)


class StiffnessObserver(StepObserver):
    """Adds the stiffnesses to load steps, where it is known, and says of which way."""

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return the stiffnesses."""
        stiffness = self._coupling.model.stiffness()
        columns: dict[str, Any] = {
            "linear_iterations": step.linear_iterations + stiffness.iterations
        }
        if (own := stiffness.interface) is not None:
            columns["interface_stiffness_N_per_mm"] = own
            columns["interface_stiffness_MPa_per_mm"] = own / self._coupling.parts.area
            columns["interface_stiffness_error_N_per_mm"] = stiffness.interface_error or None
        if (whole := stiffness.approach) is not None:
            columns["approach_stiffness_N_per_mm"] = whole
            columns["approach_stiffness_error_N_per_mm"] = stiffness.approach_error
        return columns

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield which stiffnesses are those of further loading, and which those of unloading."""
        known = [one for one in steps if one.plastic_depth_mm and one.interface_stiffness_N_per_mm]
        back = [one.step for one in known if not one.approach_stiffness_error_N_per_mm]
        if len(known) > len(back):
            yield (
                f"stiffness at {len(known) - len(back)} of {len(steps)} load steps, at which cells "
                "yield: the slope of the force as the load goes on"
            )
        if back:
            yield (
                f"stiffness at {len(back)} of {len(steps)} load steps, the last of them load step "
                f"{back[-1]}: the slope of unloading, and of loading again up to the largest load "
                "so far, along which no cell yields further"
            )


class ContactRecorder(StepObserver):
    """Records contacts as the scene's ``output.contact`` says.

    Args:
        coupling: What finds the load steps.

    Attributes:
        records: The contacts so far, counted from first touch, the same on every rank.
    """

    def __init__(self, coupling: Coupling) -> None:
        super().__init__(coupling)
        asked = coupling.scene.output.contact
        self._asked = "none" if coupling.traits.has_laws and asked == "auto" else asked
        self.records: list[ContactRecord] = []
        self._state: Any = None
        self._seen, self._unloading = 0, False

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Record the contact of a load step if it is requested."""
        self._state, self._seen = self._coupling.model.latest, step.step
        self._unloading = step.is_unloading(past[-1] if past else None)
        return self._recorded(step) if last or self._asked == "all" else {}

    def finish(self, step: LoadStep) -> Columns:
        """Record the contact of the last load step of a run that ended early."""
        return self._recorded(step)

    def _recorded(self, step: LoadStep) -> Columns:
        """Return the largest pressure of a contact behind laws; every contact is recorded once."""
        known = bool(self.records) and self.records[-1].step == step.step
        if self._asked == "none" or known:
            return {}
        if self._seen != step.step and not self._coupling.traits.has_laws:
            return {}  # a step of an earlier call, whose state is gone
        columns: Columns = {}
        number, solve = step.step, partial(self._coupling.contact, step, self._state)
        contact = self._tried(f"contact of load step {number} not found", solve)
        if contact is not None:
            columns, detail = contact
            lengths = self._coupling.parts.surface.lengths
            record = ContactRecord.of(detail, step, lengths, unloading=self._unloading)
            self.records.append(record)
        self.release()
        return columns

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of contacts that laws stand for, and of those not found."""
        yield from super().notes(steps)
        if self.records and self._coupling.traits.has_laws:
            last = self.records[-1]
            yield Detail(
                f"contact of load step {last.step}: the contact problem behind the laws, solved "
                f"under the plane of the step, with a force of {quantity(last.force_N, 'N', 5)}"
            )

    def release(self) -> None:
        """Let go of the contact, whose blocks stay in memory as long as it is held."""
        self._state = None


class ErrorCheck(StepObserver):
    """Adds measured errors to load steps, as the scene's ``output.check`` says."""

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return the errors, where they are to be measured."""
        coupling, check = self._coupling, self._coupling.scene.output.check
        if not (coupling.about.measures_errors and (check == "all" or (check == "last" and last))):
            return {}
        normal = not self._plastic_past(step, past)
        if not normal:
            self._failures[_AFTER_UNLOADING] = None
            if coupling.scene.friction is None:
                return {}
        with coupling.clock.phase("check"):
            solve = partial(coupling.measured_errors, step, past, normal=normal)
            what = f"errors of load step {step.step} not measured"
            try:
                found = self._tried(what, solve)
                return with_exact_zeros(step, found) if found else {}
            except InputError as error:
                reason = _NO_GAP_LEFT if coupling.scene.surface.periodic else error
                self._failures[f"{what}: {reason}"] = None
                return {}

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield why errors were not measured, and those that were."""
        yield from super().notes(steps)
        yield from error_notes(list(steps))
        if steps:
            yield from self._coupling.about.error_notes(steps)


class FieldRecorder(StepObserver):
    """Keeps the states that fields are written from.

    Args:
        coupling: What finds the load steps.

    Attributes:
        kept: States by number of the load step, see `Model.field_state`.
        records: What makes them again in a resumed run, likewise; see `Model.field_record`.
    """

    def __init__(self, coupling: Coupling) -> None:
        super().__init__(coupling)
        self._wanted = coupling.scene.output.wants_fields
        self.kept: dict[int, Any] = {}
        self.records: dict[int, Any] = {}

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Keep the state of a load step whose fields may be wanted."""
        if self._coupling.traits.has_body and self._wanted(step.step, last=True):
            if not self._wanted(step.step, last=False):
                self.kept.clear()  # only those of the last load step are wanted
                self.records.clear()
            model = self._coupling.model
            state = model.field_state(step, self._coupling.field_parts)
            self.kept[step.step], self.records[step.step] = state, model.field_record(state)
        return {}

    def write(self, path: Path, steps: Sequence[LoadStep], *, finished: bool) -> None:
        """Write the fields as XDMF and VTX.

        Args:
            path: File to write, ending in ``.xdmf``.
            steps: The load steps.
            finished: Whether none follows. States of an earlier call are then made again.

        Note:
            Collective.
        """
        with self._coupling.clock.phase("field"):
            for step in steps if finished else ():
                if step.step in self.records and step.step not in self.kept:
                    record, parts = self.records[step.step], self._coupling.field_parts
                    again = self._coupling.model.field_state_again(record, step, parts)
                    self.kept[step.step] = again
            model, coupling = self._coupling.model, self._coupling
            if model.on_mesh:
                model.write_fields(path, self.kept)
            else:
                from patchlaw.macro.fields import write_solved

                face = coupling.bodies.contact_face()
                write_solved(path, face, coupling.field_parts, self.kept)


def _places(coupling: Coupling) -> Iterator[str]:
    """Yield module and class of the observers of the sections of a scene; others are not loaded."""
    scene = coupling.scene
    if scene.conductance is not None:
        yield "conductance.ConductanceObserver"
    if scene.leak is not None:
        own = "law_leaks.PatchLeakObserver" if coupling.traits.has_laws else "leak.GapLeakObserver"
        yield "law_leaks.FaceLeakObserver" if scene.leak.between_edges else own
    if scene.friction is not None:
        yield "friction.FrictionObserver"


class Observers:
    """What a scene wants read off its load steps: observers, in the order in which they see them.

    Args:
        coupling: What finds the load steps.

    Attributes:
        fields: The states that the fields of chosen load steps are written from.
        contacts: The contacts recorded so far.

    Raises:
        InputError: When the scene does not allow one of them.

    Note:
        Collective.
    """

    def __init__(self, coupling: Coupling) -> None:
        self._coupling = coupling
        self.fields, self.contacts = FieldRecorder(coupling), ContactRecorder(coupling)
        self._all = [self.fields, *_beside(coupling), self.contacts]

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> LoadStep:
        """Return a load step with the columns of all of them; collective.

        Args:
            step: The load step just accepted, counted from first touch.
            past: All load steps before it.
            last: Whether no other follows.
        """
        with self._coupling.clock.phase("contact"):
            for one in self._all:
                step = replace(step, **one.observe(step, past, last=last))
        return step

    def finish(self, step: LoadStep) -> LoadStep:
        """Return the last load step of a run that ended early, with its contact; collective.

        Args:
            step: The load step that turned out to be the last.
        """
        with self._coupling.clock.phase("contact"):
            return replace(step, **self.contacts.finish(step))

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of what they saw."""
        return chain.from_iterable(one.notes(steps) for one in self._all)

    def results(self, step: LoadStep) -> Iterator[tuple[str, str]]:
        """Yield what a report lists of the last load step beside its columns: name and value."""
        return chain.from_iterable(one.results(step) for one in self._all)

    def figures(self, history: History) -> Iterator[tuple[str, str, tuple[Any, ...]]]:
        """Yield figures: file, function in `multiscale.results.figures`, and its arguments."""
        return chain.from_iterable(one.figures(history) for one in self._all)

    @property
    def fluid(self) -> Any:
        """The `multiscale.observers.law_leaks.FluidMap` of the last load step; None without."""
        return next(filter(None, (one.fluid for one in self._all)), None)

    def write_files(self, folder: Path) -> None:
        """Write files beside those of the fields; collective."""
        for one in self._all:
            one.write_files(folder)

    def release(self) -> None:
        """Let go of what holds bodies in memory."""
        for one in self._all:
            one.release()


def _beside(coupling: Coupling) -> Iterator[StepObserver]:
    """Yield the observers beside those that keep fields and contacts."""
    if coupling.scene.output.contact != "none":
        yield StiffnessObserver(coupling)
    yield from (_loaded(place, coupling) for place in _places(coupling))  # others are not loaded
    yield EnergyObserver(coupling)
    yield ErrorCheck(coupling)
    if coupling.scene.vibration is not None:  # which takes the errors of load steps
        yield _loaded("vibration.VibrationObserver", coupling)


def _loaded(place: str, coupling: Coupling) -> StepObserver:
    module, _, name = place.partition(".")
    observers = import_module(f"patchlaw.multiscale.observers.{module}")
    made: StepObserver = getattr(observers, name)(coupling)
    return made
