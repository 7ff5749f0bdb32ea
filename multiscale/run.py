"""Runs a scene: stage, laws, block, load steps, history."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from io import BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.collective import on_root
from geometry.errors import NotConverged
from micro import HalfSpaceModel, MicroModel
from multiscale.couplings.assembly import assemble, make_table
from multiscale.couplings.blocks import (
    SLOPES,
    OnBody,
    contact_model,
    final_field,
    load_together,
    on_body,
)
from multiscale.couplings.load_steps import EmbeddedCoupling
from multiscale.couplings.newton_choice import newton_choice
from multiscale.couplings.reference import ReferenceCoupling, recorded, reference_notes
from multiscale.laws.files import LawTable, read_laws, write_laws
from multiscale.laws.refinement import missed_notes
from multiscale.laws.repair import repair_notes
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import Coupling, LoadPosition, LoadStepper, Restorable
from multiscale.machine.mpi_job import large_object_comm
from multiscale.machine.nodes import cluster_nodes
from multiscale.measured_errors import checked, error_notes, error_probe
from multiscale.resolution.auto_keys import resolved_keys
from multiscale.resolution.problem_setup import make_setup
from multiscale.results.history import History
from multiscale.results.validity import range_notes
from multiscale.scene.scene import Scene
from multiscale.setup.problem import ProblemSetup
from multiscale.storage.serialisation import Arrays, digest

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Interface


class Resumed(NamedTuple):
    """Where a run went on.

    Attributes:
        after: The last load step accepted before.
        state: What the coupling's next load step starts from.
    """

    after: int
    state: Arrays


class Run:
    """One scene on its way from ingredients to history.

    All methods are collective over the communicator, and results are the same on every rank.

    Args:
        scene: What to run.
        comm: MPI communicator (mpi4py); None runs on this process alone.
        settled: What the scene's open keys became when the run began; see `resolved_keys`.

    Attributes:
        given: The scene as it was given.
        setup: The scene's ingredients, made at once: surface, summits, patches, micro model.
        scene: The scene, what it left open settled.
        seconds: Wall time of each phase so far [s].
        table: The patch laws, once made.
        interface: The interface of the block that is pressed itself, once made.
        coupling: What makes the load steps, once made.
        steps: The load steps accepted so far.
        position: Where the load programme has come to with them.
    """

    def __init__(
        self, scene: Scene, comm: Any = None, settled: Mapping[str, Any] | None = None
    ) -> None:
        self.given, self.comm = scene, comm
        self.steps: list[LoadStep] = []
        self.position = LoadPosition()
        self._resumed: Resumed | None = None
        self._laws: bytes | None = None
        self._on_body: OnBody | None = None
        self._unchecked: list[str] = []
        self.table: LawTable | None = None
        self.interface: Interface | None = None
        self.coupling: Coupling | None = None
        load_together(scene, comm)
        nodes = cluster_nodes(comm)
        self.setup: ProblemSetup = on_root(
            large_object_comm(comm), lambda: make_setup(scene, settled, nodes)
        )
        self.scene = self.setup.scene
        self.seconds = dict(self.setup.seconds)

    def make_body(self) -> OnBody | None:
        """Make what puts the half-space model on its body, once; None for other micro models."""
        if self._on_body is None and isinstance(self.setup.micro, HalfSpaceModel):
            with self.phase("block"):
                alone = not self.setup.has_block
                self._on_body = on_body(self.setup, self.comm, half_space=alone)
        return self._on_body

    def make_model(self) -> MicroModel:
        """Make the micro model that contacts are solved with, on the body unless isolated."""
        model = self.setup.micro
        if isinstance(model, HalfSpaceModel) and self.scene.coupling.kind != "isolated":
            body = self.make_body()
            assert body is not None
            return body(model, SLOPES if self.setup.finite_slopes else 0)
        with self.phase("block"):
            return contact_model(self.setup, self.comm)

    def make_laws(self) -> LawTable:
        """Tabulate the laws of all patches, once."""
        if self.table is None:
            model = self.make_model()
            with self.phase("laws"):
                self.table = make_table(self.setup, model, self.comm)
        return self.table

    def make_coupling(self) -> Coupling:
        """Make what finds the load steps, once, and what it needs."""
        if self.coupling is None:
            made: LawTable | MicroModel | None = None
            if self.setup.micro is not None:
                made = self.make_laws() if self.setup.uses_laws else self.make_model()
            with self.phase("block"):
                coupling, self.interface = assemble(self.setup, made, self.comm)
                if self._resumed and self._resumed.state and isinstance(coupling, Restorable):
                    coupling.restore(self._resumed.state)
                self.coupling = coupling
        return self.coupling

    def load_steps(self) -> Iterator[LoadStep]:
        """Yield the load steps as they are accepted, making first what they need.

        Raises:
            NotConverged: When a step fails for good; `history` holds those before it.
        """
        drive = LoadStepper(self.make_coupling(), self.scene.loading.load_history, self.position)
        with self.phase("load steps"):
            for step in drive:
                self.position = drive.position
                self.steps.append(self._checked(step))
                yield self.steps[-1]

    def _checked(self, step: LoadStep) -> LoadStep:
        """Return a load step with its errors, where they are to be measured."""
        check = self.scene.output.check
        if check == "none" or (check == "last" and not self.finished):
            return step
        body = self.make_body()
        if body is None:
            return step
        with self.phase("check"):
            probe = error_probe(self.setup, body)
            try:
                return checked(step, probe, self.scene.loading.load_history, self.comm)
            except NotConverged as error:
                self._unchecked.append(f"errors of load step {step.step} not measured: {error}")
                return step

    @property
    def finished(self) -> bool:
        """Whether the load programme has come to its end."""
        ends = self.position.targets == self.scene.loading.load_history.count
        return ends and not self.position.ahead

    @cached_property
    def settled(self) -> dict[str, Any]:
        """What the scene's open keys became."""
        return resolved_keys(self.setup, self.given)

    def state(self) -> Arrays:
        """Return what the coupling's next load step starts from.

        Note:
            Collective.
        """
        if isinstance(self.coupling, Restorable):
            return self.coupling.state()
        return self._resumed.state if self._resumed else {}

    def resume(
        self, steps: Sequence[LoadStep], position: LoadPosition, state: Arrays, laws: bytes
    ) -> None:
        """Go on after load steps of the same scene; call it before anything is made.

        Args:
            steps: The load steps accepted so far.
            position: Where the load programme came to with them.
            state: What `state` returned then.
            laws: What `law_bytes` was then.
        """
        self._resumed = Resumed(len(steps), state)
        self.steps, self.position = list(steps), position
        if laws:
            self.table = read_laws(BytesIO(laws))

    @cached_property
    def heights(self) -> str:
        """SHA-256 of the surface's heights."""
        return digest({"heights": self.setup.surface.heights})

    @property
    def law_bytes(self) -> bytes:
        """The law file's bytes; empty as long as there are no laws."""
        if self.table is None:
            return b""
        if self._laws is None:
            content = BytesIO()
            write_laws(content, self.table)
            self._laws = content.getvalue()
        return self._laws

    def history(self) -> History:
        """Return the load steps accepted so far, with times and notes."""
        notes = []
        if self.setup.choice is not None:
            notes.append(f"micro model chosen: {self.setup.choice.sentence}")
        if self.table is not None:
            errors = [law.interpolation_error for law in self.table.laws]
            notes.append(
                f"interpolation error of the laws between their rows: {self.table.force_error:.1e} "
                f"of the force, {max(errors):.1e} of a patch's pressure or the mean, if more"
            )
            notes += missed_notes(self.table, self.setup.table_tolerance)
            notes += repair_notes(self.table.laws)
            planned, taken = newton_choice(self.setup), newton_choice(self.setup, self.table)
            if taken.condensed != planned.condensed:
                notes.append(f"Newton condensed to the patches, not full: {taken.why}")
        imbalances = [abs(step.imbalance) for step in self.steps if step.imbalance is not None]
        if imbalances:
            notes.append(f"force against the support's reaction: equal to {max(imbalances):.1e}")
        notes += range_notes(self.steps, self.table)
        notes += [*self._unchecked, *error_notes(self.steps, self.given.accuracy)]
        if self._resumed:
            after = self._resumed.after
            notes.append(f"resumed after load step {after}; times of phases are those since then")
        record, steps = None, tuple(self.steps)
        if isinstance(self.coupling, ReferenceCoupling):
            record = recorded(self.setup, self.coupling, self.steps)
            steps = record.with_errors(steps)
            notes += reference_notes(record, self.coupling, self.steps, self.setup)
        return History(
            steps=steps,
            patches=self.setup.patches,
            seconds=dict(self.seconds),
            notes=tuple(notes),
            reference=record,
        )

    @property
    def unknowns(self) -> int | None:
        """Degrees of freedom of the block that is pressed, where one is."""
        if isinstance(self.coupling, ReferenceCoupling):
            return self.coupling.unknowns[-1]
        return None if self.interface is None else self.interface.block.dofs

    def last_field(self) -> tuple[Interface, NDArray[np.float64]]:
        """Return the meshed block and its displacements at the last load step, this rank's part.

        Where the mesh was not pressed itself, it is loaded by the patches' mean pressures.
        """
        if isinstance(self.coupling, EmbeddedCoupling) and self.interface is not None:
            return self.interface, self.coupling.displacement
        with self.phase("field"):
            return final_field(self.setup, self.steps[-1].patches.pressure_MPa, self.comm)

    def close(self) -> None:
        """Free the blocks; what was accepted stays, fields are gone.

        PETSc keeps what Python drops until it is asked on the block's own communicator, so that a
        program that makes many runs would grow by a block with each.

        Note:
            Collective.
        """
        blocks = [] if self.interface is None else [self.interface.block]
        if isinstance(self.coupling, ReferenceCoupling):
            blocks = self.coupling.blocks
        if not blocks:
            return
        from macro.compat import collect_garbage

        comms = [block.stiffness.comm.duplicate() for block in blocks]  # outlive their blocks
        self.interface = self.coupling = None
        blocks.clear()
        gc.collect()  # blocks and what presses them know each other
        for comm in comms:
            collect_garbage(comm)
            comm.destroy()

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Take the wall time of a phase, that of phases within it left out.

        Args:
            name: Its name in `seconds`.
        """
        start, others = time.perf_counter(), sum(self.seconds.values())
        try:
            yield
        finally:
            within = sum(self.seconds.values()) - others
            spent = time.perf_counter() - start - within
            self.seconds[name] = self.seconds.get(name, 0.0) + spent


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
        NotConverged: When a load step fails for good.

    Note:
        Collective.
    """
    whole = Run(scene, comm)
    for step in whole.load_steps():
        if observe is not None:
            observe(step)
    found = whole.history()
    whole.close()
    return found
