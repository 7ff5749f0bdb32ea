"""Runs a scene: stage, laws, block, load steps, history."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from geometry.collective import on_root
from multiscale.coupling import AnalyticCoupling, Coupling, EmbeddedCoupling
from multiscale.history import History, LoadStep
from multiscale.law_files import LawTable
from multiscale.laws import ExtendedLaw
from multiscale.scene import Scene
from multiscale.stage import Stage, make_stage
from multiscale.tabulate import isolated_laws

LARGEST_SUMMIT_AREA = 0.1
"""Contact area fraction up to which asperity models are meant (they are 10 % off well before)."""

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Interface, PressedBlock


class Run:
    """One scene on its way from ingredients to history.

    All methods are collective over the communicator, and results are the same on every rank.

    Args:
        scene: What to run.
        comm: MPI communicator (mpi4py); None runs on this process alone.

    Attributes:
        stage: The scene's ingredients, made at once: surface, summits, patches, micro model.
        seconds: Wall time of each phase so far [s].
        table: The patch laws, once made.
        unknowns: Degrees of freedom of the block, once made.
        interface: The interface of the block, once made.
        coupling: What makes the load steps, once made.
        steps: The load steps accepted so far.
    """

    def __init__(self, scene: Scene, comm: Any = None) -> None:
        self.scene, self.comm = scene, comm
        self.seconds: dict[str, float] = {}
        self.steps: list[LoadStep] = []
        self.table: LawTable | None = None
        self.unknowns: int | None = None
        self.interface: Interface | None = None
        self.coupling: Coupling | None = None
        with self._phase("surface"):
            self.stage: Stage = on_root(comm, lambda: make_stage(scene))

    def make_laws(self) -> LawTable:
        """Tabulate the laws of all patches, once."""
        if self.table is None:
            with self._phase("laws"):
                coupling = self.scene.coupling
                self.table = isolated_laws(
                    self.stage.model,
                    self.stage.patches,
                    mean_heights=self.stage.mean_heights,
                    closure_ends=self.stage.closure_ends,
                    love=coupling.love,
                    tolerance=self.stage.table_tolerance,
                    comm=self.comm,
                )
        return self.table

    def load_steps(self) -> Iterator[LoadStep]:
        """Yield the load steps as they are accepted, making first what they need.

        Raises:
            NotConverged: When a step fails for good; `history` holds those before it.
        """
        self.coupling = self._coupling()
        with self._phase("load steps"):
            for step in self.coupling.load_steps(self.scene.approaches):
                self.steps.append(step)
                yield step

    def history(self) -> History:
        """Return the load steps accepted so far, with times and notes."""
        notes = []
        if self.stage.choice is not None:
            notes.append(f"micro model chosen: {self.stage.choice.sentence}")
        if self.table is not None:
            error = max(law.interpolation_error for law in self.table.laws)
            notes.append(
                f"interpolation error of the laws half-way between their rows: {error:.1e}"
            )
            imbalance = max((abs(step.imbalance) for step in self.steps), default=0.0)
            notes.append(f"force against the support's reaction: equal to {imbalance:.1e}")
        area = max((step.contact_area_fraction for step in self.steps), default=0.0)
        if self.stage.by_summits and area > LARGEST_SUMMIT_AREA:
            notes.append(
                f"contact area fraction {area:.2g}: contacts of separate summits do not stand for "
                "this surface any more; micro.model = 'half-space' does"
            )
        return History(
            steps=tuple(self.steps),
            patches=self.stage.patches,
            seconds=dict(self.seconds),
            notes=tuple(notes),
        )

    def _coupling(self) -> Coupling:
        stage, tilt = self.stage, self.scene.loading.tilt
        if not stage.embedded:
            return AnalyticCoupling(
                model=stage.model, patches=stage.patches, mean_heights=stage.mean_heights, tilt=tilt
            )
        table = self.make_laws()
        with self._phase("block"):
            pressed = self._press_block(table)
        return EmbeddedCoupling(pressed=pressed, table=table, tilt=tilt)

    def _press_block(self, table: LawTable) -> PressedBlock:
        """Mesh and assemble the block and put the laws on its interface."""
        from mpi4py import MPI

        from macro import Block, Interface, Material, PressedBlock, block_mesh

        section = self.scene.block
        mesh = block_mesh(self.stage.shape, self.comm or MPI.COMM_SELF)
        material = Material(
            young_modulus=section.young_modulus, poisson_ratio=section.poisson_ratio
        )
        block = Block(mesh, material, sides=section.sides)
        self.interface = interface = Interface(block, self.stage.patches)
        self.unknowns = block.dofs
        laws = [ExtendedLaw(law) for law in table.laws]
        return PressedBlock(block, interface, laws, mode=self.scene.coupling.interface)

    @contextmanager
    def _phase(self, name: str) -> Iterator[None]:
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
