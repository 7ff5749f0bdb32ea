"""Runs a scene: problem setup, laws, coupling, load steps, history."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

from geometry import NotConverged
from micro import HalfSpaceModel, MicroModel
from multiscale.contact_recorder import ContactRecorder
from multiscale.couplings import assembly
from multiscale.couplings.contact import OnBody, contact_model, on_body
from multiscale.couplings.fields import FieldRecord
from multiscale.couplings.law_couplings import EmbeddedCoupling
from multiscale.laws.law_file import law_bytes, read_laws
from multiscale.laws.law_table import LawTable
from multiscale.loading.energy import with_work
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import Coupling, LoadPosition, LoadStepper, Restorable
from multiscale.machine import cluster_nodes
from multiscale.measured_errors import checked, error_notes, unmeasured
from multiscale.planning.auto_keys import resolved_sections
from multiscale.planning.set_up import set_up
from multiscale.readable import Observer
from multiscale.readable import number as readable_number
from multiscale.results.accuracy_verdict import verdict
from multiscale.results.contact_record import ContactRecord
from multiscale.results.history import History
from multiscale.results.yielding_notes import energy_notes, yielding_notes
from multiscale.scene.identity import identity
from multiscale.scene.scene import Scene
from multiscale.setup.problem import ProblemSetup
from support.checked_store import fingerprint
from support.collective import on_root
from support.packages import optional_packages

_AFTER_UNLOADING = (
    "errors of load steps after unloading are not measured: the plastic depth there is that of the "
    "load steps before"
)


class Run:
    """One scene, from its problem setup to its history.

    All methods are collective over the communicator, and results are the same on every rank.

    Args:
        scene: What to run.
        comm: MPI communicator (mpi4py); None runs on this process alone.
        resolved: Values of the scene's auto keys when the run began; see `resolved_sections`.

    Attributes:
        observe: Called with what the run is at, once it is set.
        given: The scene as the user wrote it.
        identity: All that its numbers depend on, see `multiscale.scene.identity`.
        setup: The problem set up from it: surface, summits, patches, micro model.
        scene: The scene with values for its auto keys.
        seconds: Wall time of each phase so far [s].
        table: The patch laws, once made, counted from first touch.
        coupling: What finds the load steps, once made.
        steps: The load steps accepted so far, counted from first touch.
        fields: The states that the fields of chosen load steps are written from.
        position: Position in the load history after them.
    """

    def __init__(
        self, scene: Scene, comm: Any = None, resolved: Mapping[str, Any] | None = None
    ) -> None:
        self._began = time.perf_counter()
        self.given, self.comm = scene, comm
        self.observe: Observer | None = None
        self.steps: list[LoadStep] = []
        self.position = LoadPosition()
        self.table: LawTable | None = None
        self.coupling: Coupling | None = None
        self._start: Any = None
        self._notes: list[str] = []
        self._on_body: OnBody | None = None
        self.identity: dict[str, Any] = on_root(comm, lambda: identity(scene))
        assembly.load_finite_elements(scene, comm)
        nodes = cluster_nodes(comm)
        self.setup: ProblemSetup = set_up(scene, comm, resolved=resolved, nodes=nodes)
        self.scene, self.seconds = self.setup.scene, dict(self.setup.seconds)
        self.fields = FieldRecord(self.setup, comm)
        self._recorder = ContactRecorder(self.setup, comm)
        self._until = time.perf_counter()

    def make_body(self) -> OnBody | None:
        """Make what puts the half-space model on its body, once; None for other micro models."""
        on_cells = isinstance(self.setup.micro, HalfSpaceModel) and not self.setup.samples
        if self._on_body is None and on_cells:
            with self.phase("block"):
                self._on_body = on_body(self.setup, self.comm)
        return self._on_body

    def make_model(self) -> MicroModel:
        """Make the micro model that contacts are solved with, on the body unless isolated."""
        body = None if self.scene.kind == "isolated" else self.make_body()
        with self.phase("block"):
            return contact_model(self.setup, self.comm, body)

    def _model_on_body(self) -> MicroModel:
        """Return the micro model on the body, of isolated laws too where it is half-space."""
        return contact_model(self.setup, self.comm, self.make_body())

    def make_laws(self) -> LawTable:
        """Tabulate the laws of all patches, once."""
        if self.table is None:
            model = None if self.setup.samples else self.make_model()
            with self.phase("laws"):
                self.table = assembly.make_table(self.setup, model, self.comm, self.observe)
        return self.table

    def make_coupling(self) -> Coupling:
        """Make what finds the load steps, once, and what it needs."""
        if self.coupling is None:
            with self.phase("block"):
                made: LawTable | MicroModel | None = None
                if self.setup.micro is not None:
                    made = self.make_laws() if self.setup.uses_laws else self.make_model()
                coupling = assembly.assemble(self.setup, made, self.comm)
                if self._start is not None and isinstance(coupling, Restorable):
                    coupling.restore(self._start)
                self.coupling = coupling
        return self.coupling

    def load_steps(self) -> Iterator[LoadStep]:
        """Yield the load steps as they are accepted, after making what they need.

        Raises:
            NotConverged: When a step fails for good; `history` holds those before it.
        """
        coupling = self.make_coupling()
        stepper = LoadStepper(coupling, self.setup.load_history, self.position)
        with self.phase("load steps"):
            for step in stepper:
                self.position = stepper.position
                self._take_longer_laws(coupling)
                self.fields.keep(coupling, step)
                with self.phase("contact"):
                    step = self._recorder.with_stiffness(step, coupling)
                    step = with_work(step, self.steps[-1] if self.steps else None)
                    if self.scene.conductance is not None:
                        from multiscale.conductances import conducting  # others do without

                        step = conducting(step, coupling, self.setup)
                self.steps.append(self._checked(step))
                self.make_contact(last=self.finished)
                yield self.steps[-1].counted_from(self.setup.zero)

    def _take_longer_laws(self, coupling: Coupling) -> None:
        """Take the laws of the coupling, which a load step may have extended."""
        if isinstance(coupling, EmbeddedCoupling) and coupling.table is not self.table:
            self.table = coupling.table
            end = readable_number(self.table.largest_pressure)
            self.remark([f"the laws were extended to {end} MPa, which a load step needed"])

    def make_contact(self, *, last: bool = True) -> None:
        """Record the contact of the last load step if the scene asks for it, once.

        Args:
            last: Whether no load step follows.

        Note:
            Collective.
        """
        if not self.steps:
            return
        with self.phase("contact"):
            try:
                made = self._recorder.record(self.steps[-1], self._model_on_body, last=last)
                self.steps[-1] = made
            except NotConverged as error:
                step = self.steps[-1].step
                self._notes.append(f"contact of load step {step} not found: {error}")

    @property
    def contacts(self) -> tuple[ContactRecord, ...]:
        """Contacts of the load steps so far whose contact the scene asks for."""
        return tuple(self._recorder.records)

    def _checked(self, step: LoadStep) -> LoadStep:
        """Return a load step with its errors, where they are to be measured."""
        check = self.scene.output.check
        wanted = check == "all" or (check == "last" and self.finished)
        if wanted and self._has_unloaded():
            if _AFTER_UNLOADING not in self._notes:
                self._notes.append(_AFTER_UNLOADING)
            return step
        if not wanted or (body := self.make_body()) is None:
            return step
        with self.phase("check"):
            try:
                return checked(step, self.setup, body, self.comm)
            except NotConverged as error:
                self._notes.append(f"errors of load step {step.step} not measured: {error}")
                return step

    def _has_unloaded(self) -> bool:
        """Tell whether the plastic depth at the last load step is not that of rising loads."""
        history = self.setup.load_history
        return self.scene.micro.hardness is not None and self.position.is_below_past(history)

    @property
    def times(self) -> dict[str, float]:
        """Wall time of each phase that ended, and of all else until then as ``other`` [s]."""
        rest = self._until - self._began - sum(self.seconds.values())
        return {**self.seconds, "other": max(rest, 0.0)}

    @property
    def finished(self) -> bool:
        """Whether the load history has come to its end."""
        return self.position.is_at_end(self.setup.load_history)

    @cached_property
    def resolved(self) -> dict[str, Any]:
        """Values of the scene's auto keys."""
        return resolved_sections(self.setup, self.given)

    def state(self) -> Any:
        """Return what the coupling's next load step starts from.

        Note:
            Collective.
        """
        return self.coupling.state() if isinstance(self.coupling, Restorable) else self._start

    def resume(
        self,
        steps: Sequence[LoadStep],
        position: LoadPosition,
        state: Any,
        laws: bytes,
        contacts: Sequence[ContactRecord] = (),
    ) -> None:
        """Continue after load steps of the same scene; call it before anything is made.

        Args:
            steps: The load steps accepted so far.
            position: Position in the load history after them.
            state: What `state` returned then.
            laws: What `law_bytes` was then.
            contacts: What `contacts` was then.
        """
        self.steps, self.position, self._start = list(steps), position, state
        self._recorder.resume(contacts)
        self._notes += [f"resumed after load step {len(steps)}; phase times are those since then"]
        if laws:
            self.table = read_laws(BytesIO(laws))

    @cached_property
    def heights(self) -> str:
        """SHA-256 of the surface's heights, or of those of all samples."""
        samples = [one.heights for region in self.setup.samples for one in region.surfaces]
        return fingerprint([self.setup.surface.heights, *samples])

    @property
    def laws(self) -> LawTable | None:
        """The patch laws as they are shown, counted from the zero of the load; None without any."""
        zero = self.setup.zero
        if self.table is None or not zero:
            return self.table
        return self.table.counted_from(self.scene.loading.zero, zero)

    @property
    def law_bytes(self) -> bytes:
        """The law file's bytes; empty as long as there are no laws."""
        return b"" if self.table is None else law_bytes(self.table)

    def history(self) -> History:
        """Return the load steps accepted so far, counted from the zero, with times and notes."""
        steps, record, mesh_notes = assembly.with_mesh_errors(self.coupling, self.steps)
        notes = [*assembly.approximation_notes(self.setup, self.table, self.steps), *self._notes]
        notes += self._recorder.notes
        hardness = self.scene.micro.hardness
        if hardness is not None or not self.setup.samples:  # whose peaks are those of means
            notes += yielding_notes(self.steps, hardness)
        notes += energy_notes(self.steps)
        if self.scene.conductance is not None:
            from multiscale.conductances import conductance_notes  # other scenes do without

            notes += conductance_notes(
                self.steps, self.scene.conductance, with_laws=self.setup.uses_laws
            )
        by_force = self.setup.load_history.quantity == "force"
        accuracy = verdict(steps, self.given.accuracy, unmeasured(self.setup), by_force=by_force)
        kept = [] if accuracy is None else [accuracy.sentence]
        zero = self.setup.zero
        return History(
            steps=tuple(step.counted_from(zero) for step in steps),
            patches=self.setup.regions or self.setup.patches,
            seconds=self.times,
            notes=(*kept, *notes, *error_notes(self.steps), *mesh_notes),
            accuracy=accuracy,
            reference=None if record is None else record.counted_from(zero),
            contact_records=self.contacts,
        )

    def remark(self, notes: Iterable[str]) -> None:
        """Add notes to the history, each once."""
        self._notes += [note for note in dict.fromkeys(notes) if note not in self._notes]

    @property
    def unknowns(self) -> int | None:
        """Degrees of freedom of the mesh that load steps are solved on, where there is one."""
        return assembly.unknowns(self.coupling)

    def write_fields(self, path: Path) -> None:
        """Write the fields of the load steps that the scene names, see `FieldRecord.write`.

        Those that an earlier run has found are pressed to again once the run is finished.

        Args:
            path: File to write, ending in ``.xdmf``.
        """
        if self.finished:
            self.fields.complete(self.make_coupling(), self.steps)
        with self.phase("field"):
            self.fields.write(path, self.coupling, self.steps)

    def close(self) -> None:
        """Free the blocks. Accepted load steps stay, fields are gone.

        Note:
            Collective.
        """
        meshed, self.coupling = assembly.meshed_blocks(self.coupling), None
        self._recorder.release()
        self.setup.bodies.release()
        assembly.free_blocks(meshed)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Measure the wall time of a phase, without that of phases within it.

        Args:
            name: Its name in `seconds`.
        """
        if self.observe is not None:
            self.observe(name, 0, 0)
        start = time.perf_counter() - sum(self.seconds.values())
        try:
            yield
        finally:
            self._until = time.perf_counter()
            spent = self._until - sum(self.seconds.values()) - start
            self.seconds[name] = self.seconds.get(name, 0.0) + spent


@optional_packages()
def run(
    scene: Scene, comm: Any = None, *, observe: Callable[[LoadStep], None] | None = None
) -> History:
    """Run a scene from surface to history; nothing is written.

    Args:
        scene: What to run.
        comm: MPI communicator (mpi4py); None runs on this process alone.
        observe: Called with every accepted load step.

    Returns:
        The history, the same on every rank.

    Raises:
        InputError: When the scene cannot be made.
        NotConverged: When a load step fails for good; its ``history`` has those before it.
        NotInstalled: When the scene needs a package that is missing.

    Note:
        Collective.
    """
    whole = Run(scene, comm)
    try:
        for step in whole.load_steps():
            if observe is not None:
                observe(step)
        return whole.history()
    except NotConverged as error:
        error.history = whole.history()
        raise
    finally:
        whole.close()
