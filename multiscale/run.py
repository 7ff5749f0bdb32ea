"""Runs a scene: stage, laws, block, load steps, history."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import on_root
from multiscale.assemble import assemble, make_table
from multiscale.blocks import final_field, load_together
from multiscale.coupling import EmbeddedCoupling
from multiscale.forecast import Forecast, forecast
from multiscale.history import History, LoadStep
from multiscale.law_files import LawTable
from multiscale.loading import Coupling, load_steps
from multiscale.scene import Scene
from multiscale.stage import Stage, make_stage
from multiscale.validity import range_notes

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Interface


class Run:
    """One scene on its way from ingredients to history.

    All methods are collective over the communicator, and results are the same on every rank.

    Args:
        scene: What to run.
        comm: MPI communicator (mpi4py); None runs on this process alone.

    Attributes:
        stage: The scene's ingredients, made at once: surface, summits, patches, micro model.
        scene: The scene, what it left open settled.
        seconds: Wall time of each phase so far [s].
        table: The patch laws, once made.
        interface: The interface of the block that is pressed itself, once made.
        coupling: What makes the load steps, once made.
        steps: The load steps accepted so far.
    """

    def __init__(self, scene: Scene, comm: Any = None) -> None:
        self.comm = comm
        self.steps: list[LoadStep] = []
        self.table: LawTable | None = None
        self.interface: Interface | None = None
        self.coupling: Coupling | None = None
        load_together(scene, comm)
        self.stage: Stage = on_root(comm, lambda: make_stage(scene))
        self.scene = self.stage.scene
        self.seconds = dict(self.stage.seconds)

    def make_laws(self) -> LawTable:
        """Tabulate the laws of all patches, once."""
        if self.table is None:
            with self.phase("laws"):
                self.table = make_table(self.stage, self.comm)
        return self.table

    def load_steps(self) -> Iterator[LoadStep]:
        """Yield the load steps as they are accepted, making first what they need.

        Raises:
            NotConverged: When a step fails for good; `history` holds those before it.
        """
        table = self.make_laws() if self.stage.by_laws else None
        with self.phase("block"):
            self.coupling, self.interface = assemble(self.stage, table, self.comm)
        with self.phase("load steps"):
            for step in load_steps(self.coupling, self.scene.loading.programme):
                self.steps.append(step)
                yield step

    def history(self) -> History:
        """Return the load steps accepted so far, with times and notes."""
        notes = []
        if self.stage.choice is not None:
            notes.append(f"micro model chosen: {self.stage.choice.sentence}")
        if self.table is not None:
            errors = [law.interpolation_error for law in self.table.laws]
            notes.append(
                f"interpolation error of the laws between their rows: {self.table.force_error:.1e} "
                f"of the force, {max(errors):.1e} of a patch's pressure or the mean, if more"
            )
        imbalances = [abs(step.imbalance) for step in self.steps if step.imbalance is not None]
        if imbalances:
            notes.append(f"force against the support's reaction: equal to {max(imbalances):.1e}")
        notes += range_notes(self.steps, self.table)
        return History(
            steps=tuple(self.steps),
            patches=self.stage.patches,
            seconds=dict(self.seconds),
            notes=tuple(notes),
        )

    @cached_property
    def forecast(self) -> Forecast:
        """What this run was predicted to take and to err by; to be asked for before it starts.

        Not collective: every rank that asks measures its own core.
        """
        with self.phase("plan"):
            return forecast(self.stage)

    @property
    def unknowns(self) -> int | None:
        """Degrees of freedom of the block that is pressed, where one is."""
        return None if self.interface is None else self.interface.block.dofs

    def last_field(self) -> tuple[Interface, NDArray[np.float64]]:
        """Return the meshed block and its displacements at the last load step, this rank's part.

        Where the mesh was not pressed itself, it is loaded by the patches' mean pressures.
        """
        if isinstance(self.coupling, EmbeddedCoupling) and self.interface is not None:
            return self.interface, self.coupling.displacement
        with self.phase("field"):
            return final_field(self.stage, self.steps[-1].patches.pressure_MPa, self.comm)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Take the wall time of a phase.

        Args:
            name: Its name in `seconds`.
        """
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = time.perf_counter() - start


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
    return whole.history()
