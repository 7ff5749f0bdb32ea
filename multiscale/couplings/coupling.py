"""What stands between a scene and its load steps: one class for each coupling has this as its base.

A coupling is made from its scene on one process, sent to the others, and put on the bodies there.
Everything that a scene is used for asks the coupling: what a run would do, a load step, its error,
its fields, what a run goes on from. None of it asks which coupling it is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from geometry import (
    Control,
    InputError,
    Surface,
)
from geometry.contact_state import ContactState
from micro.model import Stiffness
from multiscale.bodies.bodies import Bodies
from multiscale.bodies.scene_body import SceneBody
from multiscale.couplings import describe
from multiscale.couplings.scene_parts import SceneParts
from multiscale.couplings.work import Work
from multiscale.inputs.block import FIELD_CELLS, Cells, block_cells
from multiscale.inputs.body_facts import BodyFacts
from multiscale.inputs.memory import (
    block_requests,
    body_request,
    check_memory,
    patch_requests,
    surface_requests,
)
from multiscale.laws.law_table import LawTable
from multiscale.loading.clock import Clock
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import step_count
from multiscale.machine import ClusterNodes, MemoryRequest
from multiscale.readable import Detail, percent
from multiscale.results.history import range_notes
from multiscale.results.reference_record import ReferenceRecord
from multiscale.scene.scene import Scene

Array = NDArray[np.float64]
Facts = tuple[BodyFacts | None, BodyFacts | None]
"""What is known of the meshes of a body and of its counter-body."""


@dataclass(kw_only=True, eq=False)
class Coupling(SceneParts, ABC):
    """A scene on its way to load steps.

    The attributes up to `seconds` are made from the scene alone; they do not change.

    Attributes:
        comm: MPI communicator; None for this process alone.
        clock: Measures the phases of the run.
        table: The patch laws, once made, counted from first touch; None without laws.
    """

    comm: Any = field(default=None, init=False)
    clock: Clock = field(default_factory=Clock, init=False)
    table: LawTable | None = field(default=None, init=False)
    _past: Any = field(default=None, init=False)
    _meshes: tuple[SceneBody | None, SceneBody | None] = field(default=(None, None), init=False)

    def __getstate__(self) -> dict[str, Any]:
        """Return what is made from the scene alone; bodies and solvers are not sent."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.init}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state)  # type: ignore[misc]

    # --- from the scene

    @classmethod
    @abstractmethod
    def from_scene(
        cls,
        scene: Scene,
        facts: Facts,
        nodes: ClusterNodes,
        *,
        like: Coupling | None = None,
        cells: tuple[int, int] | None = None,
    ) -> Self:
        """Make the coupling of a scene on one process, without finite elements.

        Args:
            scene: The scene, without auto values.
            facts: What is known of its bodies' meshes.
            nodes: The nodes of the run.
            like: A coupling with the same surface, which is taken from it.
            cells: Cells of the half-space of contact problems; None when they are the surface's.

        Raises:
            InputError: When something cannot be made or does not fit; names file, key and value.
            NotConverged: When a contact problem cannot be solved.
        """

    def attach(self, comm: Any, meshes: tuple[SceneBody | None, SceneBody | None]) -> None:
        """Put the coupling on its bodies, on every rank.

        Args:
            comm: MPI communicator; None for this process alone.
            meshes: The body and the counter-body where these are meshes.

        Raises:
            InputError: When the surface does not lie on them.

        Note:
            Collective.
        """
        self.comm, self._meshes = comm, meshes

    @classmethod
    def cells_unstated(cls, scene: Scene) -> Cells:
        """Return the cells of a block that a scene states none for.

        Args:
            scene: The scene.
        """
        return FIELD_CELLS

    @classmethod
    def meshes_block(cls, scene: Scene) -> bool:
        """Tell whether a flat block is meshed: under laws, or for fields after the load."""
        return scene.on_mesh or (cls.has_body and bool(scene.output.fields))

    @classmethod
    def patch_limits(cls, scene: Scene, surface: Surface) -> dict[str, Sequence[int]]:
        """Return what limits the numbers of patches along x and y, each with these limits.

        Args:
            scene: The scene.
            surface: Its surface.
        """
        limits: dict[str, Sequence[int]] = {"heights of the surface": surface.grid}
        if scene.block is not None and cls.meshes_block(scene):
            cells = block_cells(scene, cls.cells_unstated(scene))
            limits["cells of the interface (block.cells)"] = cells[:2]
        return limits

    @classmethod
    def requests(cls, scene: Scene) -> Iterator[MemoryRequest]:
        """Yield the memory that a scene needs, key by key, as far as its file tells.

        Args:
            scene: The scene.
        """
        yield from surface_requests(scene)
        if scene.block is not None and cls.meshes_block(scene):
            yield from block_requests(scene, block_cells(scene, cls.cells_unstated(scene)))
        yield from patch_requests(scene)

    @classmethod
    def check_memory(cls, scene: Scene, nodes: ClusterNodes) -> None:
        """Refuse a scene that does not fit into the memory of the nodes."""
        check_memory(scene, nodes, cls.requests(scene))

    # --- what is known before the run

    @cached_property
    def bodies(self) -> Bodies:
        """The bodies under the contact, on every rank."""
        first, counter = self._meshes
        return Bodies(
            scene=self.scene,
            comm=self.comm,
            facts=(self.body, self.counter),
            materials=self.materials,
            lengths=self.surface.lengths,
            patches=self.patches,
            regions=self.regions is not None,
            first=first,
            counter=counter,
        )

    @property
    def cells(self) -> tuple[int, int] | None:
        """Cells of the half-space of contact problems; None where these have no cells."""
        return None

    @property
    @abstractmethod
    def label(self) -> str:
        """The coupling, and the cells, meshes or micro model that it works on, in few words."""

    def statements(self, cost: Iterable[tuple[str, str]] = ()) -> Iterator[tuple[str, str]]:
        """Yield pairs of topic and sentence that say what will be done and why.

        Args:
            cost: What it costs, see `multiscale.couplings.work.cost_statements`.
        """
        yield "inputs", f"{describe.materials(self)}; a surface of {describe.dimensions(self)}"
        yield "surface", describe.surface(self)
        yield "contact", self.contact_statement()
        if self.scene.counter_surface is not None:
            yield "two rough sides", describe.two_sides(self)
        yield "micro model", self.model_statement()
        yield "coupling", self.coupling_statement()
        yield from self.body_statements()
        yield from self.law_statements()
        yield "load", self.load_statement()
        if self.decision is not None:
            yield "choice", self.decision.sentence
        yield from cost
        yield "error", self.error_statement()

    @abstractmethod
    def contact_statement(self) -> str:
        """Say what is in contact."""

    @abstractmethod
    def model_statement(self) -> str:
        """Say which micro model solves contacts, and how."""

    @abstractmethod
    def coupling_statement(self) -> str:
        """Say how contacts and bodies are put together."""

    @abstractmethod
    def body_statements(self) -> Iterator[tuple[str, str]]:
        """Yield what the bodies are, with topics."""

    def law_statements(self) -> Iterator[tuple[str, str]]:
        """Yield how load steps are found from laws, with topics."""
        return iter(())

    def load_statement(self) -> str:
        """Say the load steps."""
        return describe.load(self)

    @abstractmethod
    def error_statement(self) -> str:
        """Say how the run will know its error."""

    def warnings(self) -> Iterator[str]:
        """Yield what a user should know about the validity of the scene."""
        yield from describe.surface_warnings(self, self.size)
        yield from self.contact_warnings()
        yield from describe.output_warnings(self, cells=self.shows_cells)
        if self.has_body:
            yield from self.body_warnings()
        if self.decision is not None and self.decision.warning:
            yield self.decision.warning

    @property
    @abstractmethod
    def size(self) -> float:
        """Size of the interferences, or of the roughness where these are not known [mm]."""

    def contact_warnings(self) -> Iterator[str]:
        """Yield what is doubtful of the contact and of its micro model."""
        return iter(())

    @property
    def shows_cells(self) -> bool:
        """Whether pressures of the surface's cells will be known."""
        return False

    @abstractmethod
    def body_warnings(self) -> Iterator[str]:
        """Yield what is doubtful of the bodies."""

    @abstractmethod
    def work(self, ranks: int = 1) -> Work:
        """Count what a run computes.

        Args:
            ranks: Processes that share meshes.
        """

    def memory_requests(self) -> Iterator[MemoryRequest]:
        """Yield what a run needs memory for, key by key of its scene."""
        yield from self.requests(self.scene)
        steps = step_count(self.scene.loading)
        sections = {"body": self.scene.body, "counter_body": self.scene.counter_body}
        for (key, section), facts in zip(sections.items(), (self.body, self.counter), strict=True):
            if section is not None and section.mesh and facts is not None:
                in_parts = section.mesh.lower().endswith(".xdmf")
                element, unknowns = facts.element, facts.unknowns
                yield body_request(key, element, unknowns, steps, in_parts=in_parts)

    @abstractmethod
    def unmeasured(self) -> str:
        """Return why a run does not measure the errors of its load steps; empty where it does."""

    # --- load steps

    @classmethod
    def check_has_laws(cls, scene: Scene) -> None:
        """Refuse a coupling without laws.

        Args:
            scene: The scene.

        Raises:
            InputError: When the coupling has no laws.
        """
        if not cls.has_laws:
            raise _without_laws(scene)

    def make_laws(self) -> LawTable:
        """Tabulate the laws of all patches, once.

        Raises:
            InputError: When the coupling has no laws.
            NotConverged: When the micro model does not converge.

        Note:
            Collective.
        """
        raise _without_laws(self.scene)

    @abstractmethod
    def prepare(self) -> None:
        """Make what load steps need, once; `press` does it by itself.

        Note:
            Collective.
        """

    @abstractmethod
    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step, whose number is still 0.

        Args:
            control: What the step prescribes of the plane.

        Raises:
            NotConverged: When none is found. Earlier equilibria stay what they were, so that a
                smaller step can be tried.

        Note:
            Collective.
        """

    def stiffness(self) -> Stiffness:
        """Return the interfacial stiffness dF/dδ at the latest load step, where it is known.

        The slopes of the plane stay or, where it turns, its moments stay zero.

        Note:
            Collective.
        """
        return Stiffness(None, 0)

    @property
    def past(self) -> Any:
        """What the load steps so far left behind beyond initial guesses; None where nothing.

        Set it to take load steps back.
        """
        return self._past

    @past.setter
    def past(self, value: Any) -> None:
        self._past = value

    @abstractmethod
    def state(self) -> Any:
        """Return what the next load step starts from; it does not depend on the number of ranks.

        It is made of numbers, texts, arrays and records of them, or None where there is nothing.

        Note:
            Collective.
        """

    @abstractmethod
    def restore(self, state: Any) -> None:
        """Start from a state, in a coupling newly made from the same scene.

        Args:
            state: What `state` returned.

        Note:
            Collective.
        """

    # --- what is made of load steps

    def contact_state(self) -> Any:
        """Return what `contact` takes of the latest load step."""
        return None

    def contact(self, step: LoadStep, state: Any) -> tuple[LoadStep, ContactState] | None:
        """Return the spots and fields of the contact of a load step.

        Args:
            step: The load step.
            state: What `contact_state` returned after it.

        Returns:
            The load step, with the largest pressure of the contact, and the contact; None where
            none is known.

        Raises:
            NotConverged: When the contact problem behind laws cannot be solved.

        Note:
            Collective.
        """
        return None

    def contact_note(self, step: int, force: float) -> str:
        """Return what a report says of the last contact that `contact` returned; empty for nothing.

        Args:
            step: Number of its load step.
            force: Force of the contact [N].
        """
        return ""

    def checked(self, step: LoadStep) -> LoadStep | None:
        """Return a load step with its errors measured; None where they cannot be.

        Args:
            step: The load step.

        Raises:
            NotConverged: When a contact problem cannot be solved.

        Note:
            Collective.
        """
        return None

    def with_mesh_errors(
        self, steps: Sequence[LoadStep]
    ) -> tuple[tuple[LoadStep, ...], ReferenceRecord | None]:
        """Return load steps with the errors of a reference's meshes, and its record.

        Args:
            steps: The load steps.
        """
        return tuple(steps), None

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the approximations behind load steps.

        Args:
            steps: The load steps.
        """
        imbalances = [abs(step.imbalance) for step in steps if step.imbalance is not None]
        if imbalances:
            equal = percent(max(imbalances))
            yield Detail(f"force against the support's reaction: equal to {equal}")
        yield from range_notes(steps, self.table)

    def error_notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of errors that the coupling knows of itself.

        Args:
            steps: The load steps.
        """
        return iter(())

    def interface_stiffness(self, step: LoadStep) -> float | None:
        """Return dF/dδ of the contacts between half-spaces; None where it is not known [N/mm].

        Args:
            step: The load step accepted last.

        Note:
            Collective.
        """
        return None

    def gaps(self) -> Array | None:
        """Return the gaps of all cells at the latest load step, 0 in contact; None without cells.

        Returns:
            Shape (nx, ny) [mm]; on rank 0 alone.
        """
        return None

    @property
    def areas(self) -> Array:
        """Nominal areas of the patches or regions, shape (N,) [mm²]."""
        return np.full(self.patches.count, self.patches.area)

    def face_pressures(self) -> Array | None:
        """Return places on a face with laws of samples and the pressures there; None otherwise.

        Returns:
            Columns x, y [mm] and p [MPa], shape (n, 3).

        Note:
            Collective.
        """
        return None

    # --- fields of the body

    def field_state(self, step: LoadStep) -> Any:
        """Return what the fields of the load step just accepted are made from.

        Args:
            step: The load step.

        Note:
            Collective.
        """
        return step.patches.pressure_MPa

    def write_fields(
        self, path: Path, states: Mapping[int, Any], steps: Sequence[LoadStep]
    ) -> None:
        """Write the fields of load steps as XDMF and VTX, see `macro.write_fields`.

        Args:
            path: File to write, ending in ``.xdmf``.
            states: By number of the load step what `field_state` returned.
            steps: The load steps.

        Note:
            Collective.
        """
        from multiscale.couplings.fields import write_solved

        write_solved(path, self.bodies, self.patches, states)

    # --- for the record

    def record(self) -> dict[str, Any]:
        """Return what the provenance of a run says of the coupling alone, by name."""
        return {}

    def surface_record(self) -> dict[str, Any]:
        """Return what the provenance of a run says of the surface alone, by name."""
        return {}

    @property
    def unknowns(self) -> int | None:
        """Degrees of freedom of the mesh that load steps are solved on, where there is one."""
        return None

    def meshed_bodies(self) -> list[Any]:
        """Return the meshed bodies that load steps are solved on, the finest last."""
        return []

    def release(self) -> None:
        """Free the bodies; load steps cannot be found any more.

        Note:
            Collective.
        """
        from multiscale.couplings.release import free_bodies

        bodies = self.meshed_bodies()
        self._meshes = (None, None)
        self.__dict__.pop("bodies", None)
        self._drop_solvers()
        free_bodies(bodies)

    @abstractmethod
    def _drop_solvers(self) -> None:
        """Let go of what holds the bodies, whose matrices stay in memory until then."""


def _without_laws(scene: Scene) -> InputError:
    """Return the error on a coupling without laws."""
    return InputError(
        "has no laws",
        key="coupling.kind",
        value=scene.kind,
        allowed="isolated, consistent",
        file=scene.file,
    )
