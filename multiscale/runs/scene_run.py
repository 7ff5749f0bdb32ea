"""Runs a scene: its coupling, load steps, what is read off them, the history."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from io import BytesIO
from itertools import chain
from typing import TYPE_CHECKING, Any

from patchlaw.multiscale.bodies.reader import BodyReader
from patchlaw.multiscale.console import run_progress
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.machine import Clock, cluster_nodes
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.models.problem import Position, Problem
from patchlaw.multiscale.models.setup import make_setup
from patchlaw.multiscale.observers.step_observers import (
    ContactRecorder,
    EnergyObserver,
    ErrorCheck,
    FieldRecorder,
    StepObserver,
    StiffnessObserver,
)
from patchlaw.multiscale.results.accuracy import verdict
from patchlaw.multiscale.results.contacts import ContactRecord
from patchlaw.multiscale.results.history import History
from patchlaw.multiscale.runs.resolving import chosen_keys, resolve
from patchlaw.multiscale.scene.scene import Scene, identity
from patchlaw.support import Comm, NotConverged, checked, on_root
from patchlaw.support.packages import optional_packages
from patchlaw.support.readable import ProgressObserver, unobserved

if TYPE_CHECKING:  # only laws take it
    from patchlaw.multiscale.laws.law_table import LawTable


LAYOUT = 4
"""Counts what states of models hold: higher, whenever the same version reads others than before."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Checkpoint:
    """A run between two load steps. Nothing in it depends on the number of ranks.

    Attributes:
        layout: The `LAYOUT` that it was written in.
        identity: All that the numbers of the run depend on, see `multiscale.scene.scene`.
        resolved: Values of the keys that the accuracy of the scene left open, by dotted key.
        laws: Bytes of the law file; empty without laws.
        steps: The accepted load steps.
        position: Where the load history has come to.
        state: What the coupling's next load step starts from, see `Coupling.state`.
        told: What errors of these load steps told, see `Coupling.told`.
        contacts: The contacts recorded so far, which count from first touch.
        fields: What makes the states of fields so far again, as numbers of load steps and records.
    """

    layout: int
    identity: dict[str, Any]
    resolved: dict[str, Any]
    laws: bytes
    steps: tuple[LoadStep, ...] = ()
    position: Position
    state: Any
    told: tuple[Any, ...] = ()
    contacts: tuple[ContactRecord, ...] = ()
    fields: tuple[tuple[int, Any], ...] = ()


class Observers(list[StepObserver]):
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
        self._clock = coupling.clock
        self.fields, self.contacts = FieldRecorder(coupling), ContactRecorder(coupling)
        super().__init__([self.fields, *_beside(coupling), self.contacts])

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> LoadStep:
        """Return a load step with the columns of all of them; collective.

        Args:
            step: The load step just accepted, counted from first touch.
            past: All load steps before it.
            last: Whether no other follows.
        """
        with self._clock.phase("contact"):
            for one in self:
                if columns := one.observe(step, past, last=last):
                    step = replace(step, **columns)
        return step


def _beside(coupling: Coupling) -> Iterator[StepObserver]:
    """Yield the observers beside those that keep fields and contacts; others are not loaded."""
    scene, has_laws = coupling.scene, coupling.scene.by_laws
    if scene.output.contact != "none":
        yield StiffnessObserver(coupling)
    if scene.conductance is not None:
        from patchlaw.multiscale.observers.interface import ConductanceObserver

        yield ConductanceObserver(coupling)
    if scene.leak is not None and (has_laws or scene.leak.between_edges):
        from patchlaw.multiscale.observers.leak import FaceLeakObserver, PatchLeakObserver

        by_laws = FaceLeakObserver if scene.leak.between_edges else PatchLeakObserver
        yield by_laws(coupling)
    elif scene.leak is not None:
        from patchlaw.multiscale.observers.leak import GapLeakObserver

        yield GapLeakObserver(coupling)
    if scene.friction is not None:
        from patchlaw.multiscale.observers.interface import FrictionObserver

        yield FrictionObserver(coupling)
    yield EnergyObserver(coupling)
    yield ErrorCheck(coupling)
    if scene.vibration is not None:  # which takes the errors of load steps
        from patchlaw.multiscale.observers.vibration import VibrationObserver

        yield VibrationObserver(coupling)


class Run:
    """One scene, from its coupling to its history.

    All methods are collective over the communicator, and results are the same on every rank.

    Args:
        scene: What to run.
        comm: MPI communicator (mpi4py); None runs on this process alone.
        stated: The scene with what it leaves open as it was when the run began; by default
            `resolve` chooses it.
        observe: Told what the run is at.

    Attributes:
        clock: Measures the phases of the run, and reports them to an observer.
        given: The scene as the user wrote it.
        identity: All that its numbers depend on, see `multiscale.scene.scene`.
        coupling: The coupling made from the scene, which solves the load steps.
        scene: The scene with values for what its accuracy leaves open.
        steps: The load steps accepted so far, counted from first touch.
        position: Position in the load history after them.
        observers: What is read off load steps; each is passed to them.
    """

    @checked
    def __init__(
        self,
        scene: Scene,
        comm: Comm | None = None,
        stated: Scene | None = None,
        observe: ProgressObserver | None = None,
    ) -> None:
        self.clock = Clock()
        self.clock.observe = observe or unobserved
        self.given, self.comm = scene, comm
        self.steps: list[LoadStep] = []
        self.position = Position()
        self._notes: list[str] = []
        self.identity: dict[str, Any] = on_root(comm, lambda: identity(scene))
        nodes, read = cluster_nodes(comm), BodyReader()
        with self.clock.phase("choice") if scene.accuracy and not stated else nullcontext():
            tell = self.clock.tell
            self.scene = stated or resolve(scene, comm, nodes=nodes, read=read, observe=tell)
        self.coupling: Coupling = make_setup(self.scene, comm, nodes=nodes, read=read)
        self.clock.add(self.coupling.parts.seconds)
        self.coupling.clock = self.clock
        self.observers = Observers(self.coupling)

    def make_laws(self) -> LawTable:
        """Tabulate the laws of all patches, once; see `Coupling.make_laws`."""
        return self.coupling.make_laws()

    def load_steps(self) -> Iterator[LoadStep]:
        """Yield the load steps as they are accepted, after making what they need.

        Raises:
            NotConverged: When a step fails for good; `history` holds those before it.
        """
        coupling = self.coupling
        problem = Problem(
            coupling.model,
            coupling.parts.path,
            self.position,
            force_change=self.scene.loading.force_change,
            zero=coupling.parts.zero,
            file=self.given.file,
        )
        with self.clock.phase("load steps"):
            for step in problem.steps():
                self.position = problem.position
                step = self.observers.observe(step, self.steps, last=self.finished)
                self.steps.append(step)
                yield step.counted_from(self.coupling.parts.zero)

    def finish(self) -> None:
        """Notify observers that no load step follows, also where the run ended early."""
        if self.steps:
            with self.clock.phase("contact"):
                columns = self.observers.contacts.recorded(self.steps[-1])
            self.steps[-1] = replace(self.steps[-1], **columns)

    @property
    def contacts(self) -> tuple[ContactRecord, ...]:
        """Contacts of the load steps so far whose contact the scene asks for."""
        return self.history().contact_records

    @property
    def fluid(self) -> Any:
        """The `multiscale.observers.leak.FluidMap` of the last load step; None without."""
        return next(filter(None, (one.fluid for one in self.observers)), None)

    @property
    def finished(self) -> bool:
        """Whether the load history has come to its end."""
        return self.position.is_at_end(self.coupling.parts.path)

    @property
    def resolved(self) -> dict[str, Any]:
        """Values of the keys that the accuracy of the scene left open, by dotted key."""
        return chosen_keys(self.given, self.scene)

    def checkpoint(self, state: Any) -> Checkpoint:
        """Return all that is needed to go on from the latest load step.

        Args:
            state: What `Coupling.state` returned.
        """
        laws = b""
        if self.coupling.table is not None:
            from patchlaw.multiscale.laws.law_table import law_bytes

            laws = law_bytes(self.coupling.table)
        return Checkpoint(
            layout=LAYOUT,
            identity=self.identity,
            resolved=self.resolved,
            laws=laws,
            steps=tuple(self.steps),
            position=self.position,
            state=state,
            told=tuple(self.coupling.told),
            contacts=tuple(self.observers.contacts.records),
            fields=tuple(self.observers.fields.records.items()),
        )

    def resume(self, kept: Checkpoint) -> None:
        """Continue after load steps of the same scene; call it before anything is made.

        Args:
            kept: The run after these load steps.
        """
        self.steps, self.position = list(kept.steps), kept.position
        self.coupling.start, self.coupling.told = kept.state, list(kept.told)
        if kept.laws:
            from patchlaw.multiscale.laws.law_table import read_laws

            self.coupling.table = read_laws(BytesIO(kept.laws))
        self.observers.contacts.records = list(kept.contacts)
        self.observers.fields.records = dict(kept.fields)
        self._notes += [
            f"resumed after load step {len(kept.steps)}; phase times are those since then"
        ]

    @property
    def laws(self) -> LawTable | None:
        """The patch laws as they are shown, counted from the zero of the load; None without any."""
        zero, table = self.coupling.parts.zero, self.coupling.table
        if table is None or not zero:
            return table
        return table.counted_from(self.scene.loading.zero, zero)

    def history(self) -> History:
        """Return the load steps accepted so far, counted from the zero, with times and notes."""
        coupling = self.coupling
        steps, record = coupling.with_mesh_errors(self.steps)
        accuracy = verdict(steps, self.given.accuracy, coupling.about.unmeasured())
        notes = [] if accuracy is None else [accuracy.sentence]
        notes += coupling.about.notes(self.steps)
        notes += self._notes
        notes += chain.from_iterable(one.notes(self.steps) for one in self.observers)
        history = History(
            steps=steps,
            patches=coupling.parts.regions or coupling.parts.patches,
            seconds=self.clock.times,
            notes=tuple(notes),
            accuracy=accuracy,
            reference=record,
            contact_records=tuple(self.observers.contacts.records),
        )
        return history.counted_from(coupling.parts.zero)

    def remark(self, notes: Iterable[str]) -> None:
        """Add notes to the history, each once."""
        self._notes += [note for note in dict.fromkeys(notes) if note not in self._notes]

    def close(self) -> None:
        """Free the bodies. Accepted load steps stay, fields are gone.

        Note:
            Collective.
        """
        for one in self.observers:
            one.release()
        self.coupling.release()


@optional_packages()
@checked
def run(
    scene: Scene,
    comm: Comm | None = None,
    *,
    observe: Callable[[LoadStep], None] | None = None,
    progress: bool = False,
) -> History:
    """Run a scene from surface to history; nothing is written.

    Args:
        scene: What to run.
        comm: MPI communicator (mpi4py); None runs on this process alone.
        observe: Called with every accepted load step.
        progress: Whether the progress is shown, in the terminal or below a notebook's cell.

    Returns:
        The history, the same on every rank.

    Raises:
        InputError: When the scene cannot be made.
        NotConverged: When a load step fails for good; its ``history`` has those before it.
        NotInstalled: When the scene needs a package that is missing.

    Note:
        Collective.
    """
    with run_progress(comm, scene.loading) if progress else nullcontext((None, None)) as shown:
        advance, at = shown
        whole = Run(scene, comm, observe=at)
        try:
            for step in whole.load_steps():
                for tell in filter(None, (advance, observe)):
                    tell(step)
            return whole.history()
        except NotConverged as error:
            whole.finish()
            error.history = whole.history()
            raise
        finally:
            whole.close()
