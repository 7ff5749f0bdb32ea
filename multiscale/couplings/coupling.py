"""What stands between a scene and its load steps: one class for each coupling has this as its base.

A coupling is made from its scene on one process, sent to the others, and put on the bodies there.
Everything that a scene is used for asks the coupling: what a run would do, a load step, its error,
its fields, what a run goes on from. None of it asks which coupling it is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from patchlaw.geometry import PatchGrid, RigidPlane, Surface
from patchlaw.geometry.contact_state import ContactState
from patchlaw.geometry.plausibility import check_finite_slopes
from patchlaw.geometry.statistics import roughness
from patchlaw.micro import HalfSpaceModel, MicroModel
from patchlaw.multiscale.bodies.bodies import Bodies, free_bodies
from patchlaw.multiscale.console import Clock
from patchlaw.multiscale.couplings import describe, validity
from patchlaw.multiscale.inputs.bodies import SceneBody
from patchlaw.multiscale.inputs.cost import body_request, memory_statement, scene_requests
from patchlaw.multiscale.inputs.scene_parts import SceneParts, Source
from patchlaw.multiscale.inputs.surfaces import located
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.loading.stepper import StepSolver, step_count
from patchlaw.multiscale.machine import MemoryRequest
from patchlaw.multiscale.readable import Detail, percent, quantity, times
from patchlaw.multiscale.results.accuracy import ReferenceRecord
from patchlaw.multiscale.results.history import range_notes
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError

Meshes = tuple[SceneBody | None, SceneBody | None]
"""The body and the counter-body where these are meshes."""


@dataclass(kw_only=True, eq=False)
class Coupling(SceneParts, ABC):
    """A scene on its way to load steps.

    The attributes up to `plane_at_largest_load` are made from the scene alone; they do not change.

    Attributes:
        micro: Micro model of the surface on a half-space; None where contacts are meshed.
        plane_at_largest_load: The rigid plane at the largest load. Where the force or the moment is
            prescribed, it is the plane in equilibrium on a half-space, or None where nothing before
            the load steps needs it.
        comm: MPI communicator; None for this process alone.
        clock: Measures the phases of the run.
        table: The patch laws, once made, counted from first touch; set it to laws that are at hand.
            None without laws.
        start: What the first load step starts from, see `state`; set it before the solver is made.
    """

    micro: MicroModel | None = None
    plane_at_largest_load: RigidPlane | None = None
    comm: Any = field(default=None, init=False)
    clock: Clock = field(default_factory=Clock, init=False)
    table: LawTable | None = field(default=None, init=False)
    start: Any = field(default=None, init=False)
    _meshes: Meshes = field(default=(None, None), init=False)

    def __post_init__(self) -> None:
        """Refuse finite slopes of surfaces that are too steep for them."""
        if self.finite_slopes:
            with located(self.scene, "micro.finite_slopes"):
                for surface in self.sloped_surfaces:
                    check_finite_slopes(surface)

    def __getstate__(self) -> dict[str, Any]:
        """Return what is made from the scene alone; bodies and solvers are not sent."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.init}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state)  # type: ignore[misc]

    # --- from the scene

    @classmethod
    @abstractmethod
    def from_scene(cls, source: Source) -> Self:
        """Make the coupling of a scene on one process, without finite elements.

        Args:
            source: The scene, and what else is known.

        Raises:
            InputError: When something cannot be made or does not fit; names file, key and value.
            NotConverged: When a contact problem cannot be solved.
        """

    def attach(self, comm: Any, meshes: Meshes) -> None:
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

    def changed(self, **attributes: Any) -> Self:
        """Return a coupling on the same bodies, nothing of which is made yet.

        Args:
            attributes: Those that differ.
        """
        other = replace(self, **attributes)
        for name in ("comm", "_meshes"):
            setattr(other, name, getattr(self, name))
        return other

    @classmethod
    def requests(cls, scene: Scene) -> Iterator[MemoryRequest]:
        """Yield the memory that a scene needs, key by key, as far as its file tells.

        Args:
            scene: The scene.
        """
        cells, made_by = cls.block_cells(scene), cls.laws_made_by
        return scene_requests(scene, cells, interact=cls.patches_interact, made_by=made_by)

    # --- what is known before the run

    @cached_property
    def bodies(self) -> Bodies:
        """The bodies under the contact, on every rank."""
        first, counter = self._meshes
        return Bodies(parts=self, comm=self.comm, first=first, counter=counter)

    @property
    def sloped_surfaces(self) -> Sequence[Surface]:
        """The rough sides of the bodies, whose slopes count."""
        return self.rough_surfaces

    @property
    def friction_is_coupled(self) -> bool:
        """Whether pressures and tractions of contacts see each other."""
        return False

    @property
    def cells(self) -> tuple[int, int] | None:
        """Cells of the half-space of contact problems; None where these have no cells."""
        return None

    @property
    def label(self) -> str:
        """The coupling, and the cells, meshes or micro model that it works on, in few words."""
        kind, micro = self.scene.kind, self.micro
        if isinstance(micro, HalfSpaceModel):
            return f"{kind} on {times(micro.surface.grid)} cells"
        return kind if micro is None else f"{kind}, {micro.name}"

    def interference(self, x: Array, y: Array, z: Array) -> Array:
        """Return how far points lie above the undeformed plane at the largest load [mm].

        Args:
            x: First coordinate of the points [mm].
            y: Second coordinate [mm].
            z: Height [mm].

        Raises:
            ValueError: Where the plane is not known before the load steps.
        """
        return self.plane.at(x, y) - (self.surface.highest - z)

    @property
    def plane(self) -> RigidPlane:
        """The rigid plane at the largest load.

        Raises:
            ValueError: Where it is not known before the load steps.
        """
        if self.plane_at_largest_load is None:
            raise ValueError("the plane under this force is not known before the load steps")
        return self.plane_at_largest_load

    @property
    def cell_interference(self) -> Array:
        """Interference of the heights of the surface, shape (nx, ny) [mm]."""
        surface = self.surface
        return self.interference(surface.x[:, None], surface.y, surface.heights)

    @cached_property
    def largest_interference(self) -> float:
        """Largest interference of the surface [mm], never less than the approach at the middle.

        Under a tilted plane the approach at the middle may be negative while its lower side
        touches.
        """
        return max(self.plane.approach, float(self.cell_interference.max()))

    def statements(self, memory: str = "") -> Iterator[tuple[str, str]]:
        """Yield pairs of topic and sentence that say what will be done and why, in one order.

        Args:
            memory: The memory that it takes, see `memory_statement`; empty says nothing of it.
        """
        said = self.describe() | ({"memory": memory} if memory else {})
        yield from ((topic, said[topic]) for topic in describe.TOPICS if topic in said)

    def describe(self) -> dict[str, str]:
        """Return what will be done and why, a sentence for each of some of `describe.TOPICS`."""
        why, cells = self.unmeasured(), f"{self.surface.heights.size} cells"
        said = {
            "inputs": f"{describe.materials(self)}; a surface of {describe.dimensions(self)}",
            "surface": describe.surface(self),
            "contact": cells,
            "micro model": self.micro.name if self.micro else describe.MESHED_CONTACTS,
            "load": describe.load(self),
            "error": f"not measured: {why}" if why else describe.checks(self, self.error_causes),
        }
        if self.plane_at_largest_load is not None:
            within = int((self.cell_interference > 0.0).sum())
            said["contact"] = f"{cells}, {within} within the largest approach"
            if self.load_history.quantity == "force":
                approach = quantity(self.plane.approach - self.zero, "mm", 3)
                said["load"] += f"; on a half-space its approach is about {approach}"
        if self.scene.counter_surface is not None:
            said["two rough sides"] = describe.two_sides(self)
        if self.decision is not None:
            said["choice"] = self.decision.sentence
        return said

    @property
    def error_causes(self) -> str:
        """The causes of errors that a run measures."""
        return ""

    def warnings(self) -> Iterator[str]:
        """Yield what a user should know about the validity of the scene."""
        known = self.plane_at_largest_load is not None
        size = self.largest_interference if known else roughness(self.surface).sq
        yield from validity.of_surface(self, size)
        yield from self.contact_warnings()
        yield from validity.of_output(self, cells=self.shows_cells)
        if self.has_body:
            yield from validity.compressibility(self)
            yield from self.body_warnings()
        if self.decision is not None and self.decision.warning:
            yield self.decision.warning

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

    @property
    def contact_memory(self) -> float:
        """Memory of the largest contact problem of cells [B]."""
        return 0.0

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

    def memory_statement(self, program: float, ranks: int) -> str:
        """Say the memory that a run takes, and what takes most of it.

        Args:
            program: Memory of a process before anything of the scene is in it [B].
            ranks: Processes of the MPI job.
        """
        requests = self.memory_requests()
        return memory_statement(self, self.contact_memory, requests, program, ranks)

    @abstractmethod
    def unmeasured(self) -> str:
        """Return why a run does not measure the errors of its load steps; empty where it does."""

    @property
    def checks_steps(self) -> bool:
        """Whether further solutions measure the errors of load steps, see `checked`."""
        return not self.unmeasured()

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
            raise InputError(
                "has no laws",
                key="coupling.kind",
                value=scene.kind,
                allowed="isolated, consistent",
                file=scene.file,
            )

    def make_laws(self) -> LawTable:
        """Tabulate the laws of all patches, once.

        Raises:
            InputError: When the coupling has no laws.
            NotConverged: When the micro model does not converge.

        Note:
            Collective.
        """
        self.check_has_laws(self.scene)
        raise NotImplementedError  # couplings with laws make them

    @abstractmethod
    def _make_solver(self) -> StepSolver:
        """Make what finds load steps; collective."""

    @cached_property
    def solver(self) -> StepSolver:
        """What finds load steps, on the bodies, which are made with it; collective."""
        with self.clock.phase("block"):
            made = self._make_solver()
        if self.start is not None:
            made.restore(self.start)
        return made

    def state(self) -> Any:
        """Return what the next load step starts from, see `StepSolver.state`.

        Note:
            Collective.
        """
        return self.start if self.made_solver is None else self.made_solver.state()

    # --- what is made of load steps

    def contact(self, step: LoadStep, latest: Any) -> tuple[LoadStep, ContactState] | None:
        """Return the spots and fields of the contact of a load step.

        Args:
            step: The load step.
            latest: What `StepSolver.latest` was after it.

        Returns:
            The load step, with the largest pressure of the contact, and the contact; None where
            none is known.

        Raises:
            NotConverged: When the contact problem behind laws cannot be solved.

        Note:
            Collective.
        """
        detail = self.solver.detail(latest)
        return None if detail is None else (step, detail)

    def checked(
        self, step: LoadStep, past: Sequence[LoadStep] = (), *, normal: bool = True
    ) -> LoadStep:
        """Return a load step with its errors measured; as it is where they cannot be.

        Args:
            step: The load step.
            past: All load steps before it.
            normal: Whether those of the normal force are, and not those of a shear alone.

        Raises:
            NotConverged: When a contact problem cannot be solved.

        Note:
            Collective.
        """
        return step

    def coarser_gap(self, step: LoadStep, factor: int) -> Array | None:
        """Return the gaps under the load of a step on fewer cells a side; see `open_gap`.

        Args:
            step: The load step.
            factor: How many times fewer.

        Returns:
            Shape (nx // factor, ny // factor), 4 at least [mm]; None without cells.

        Raises:
            NotConverged: When the contact problem cannot be solved.

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
        made = self.made_solver
        return None if made is None or self.regions is None else made.face_pressures()

    # --- fields of the body

    @property
    def field_parts(self) -> PatchGrid:
        """The parts of the contact face that contacts are seen on in fields."""
        return self.patches

    def write_fields(self, path: Path, states: Mapping[int, Any]) -> None:
        """Write the fields of load steps as XDMF and VTX, see `macro.write_fields`.

        Args:
            path: File to write, ending in ``.xdmf``.
            states: By number of the load step what `StepSolver.field_state` returned.

        Note:
            Collective.
        """
        if self.solver.on_mesh:
            self.solver.write_fields(path, states)
        else:
            from patchlaw.macro.fields import write_solved

            write_solved(path, self.bodies.contact_face(), self.field_parts, states)

    # --- for the record

    def record(self) -> dict[str, Any]:
        """Return what the provenance of a run says of the coupling alone, by name."""
        return {} if self.micro is None else {"micro_model": {"name": self.micro.name}}

    def surface_record(self) -> dict[str, Any]:
        """Return what the provenance of a run says of the surface alone, by name."""
        return {}

    @property
    def made_solver(self) -> StepSolver | None:
        """What finds load steps, where it is made already."""
        return self.__dict__.get("solver")

    @property
    def unknowns(self) -> int | None:
        """Degrees of freedom of the mesh that load steps are solved on, where there is one."""
        return None if self.made_solver is None else self.made_solver.unknowns

    def release(self) -> None:
        """Free the bodies; load steps cannot be found any more.

        Note:
            Collective.
        """
        bodies = [] if self.made_solver is None else self.made_solver.meshed_bodies
        if not bodies and "bodies" in self.__dict__:
            bodies = self.bodies.made_bodies
        self._meshes = (None, None)
        for name in ("solver", "bodies", "put_on_body"):  # they hold the bodies' matrices
            self.__dict__.pop(name, None)
        free_bodies(bodies)
