"""The base of all couplings, and what is said about them.

A coupling puts the parts of a scene on the bodies, makes the model that load steps are found with,
measures their errors, and knows what a run goes on from. What is said of it is `About` it.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.contact_state import ContactState
from patchlaw.micro.half_space.error_probe import MOST_CHECKED_CELLS
from patchlaw.multiscale.bodies.bodies import Bodies, free_bodies
from patchlaw.multiscale.bodies.reader import Meshes
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.machine import Clock, MemoryRequest
from patchlaw.multiscale.models import describe, validity
from patchlaw.multiscale.models.problem import Model
from patchlaw.multiscale.results.accuracy import ReferenceRecord
from patchlaw.multiscale.results.history import range_notes
from patchlaw.multiscale.scene.memory import (
    CELL_OF_CONTACT,
    body_request,
    memory_statement,
    modes_request,
    scene_requests,
)
from patchlaw.multiscale.scene.parts import SceneParts, block_section, meshed_cells
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support import Array, located
from patchlaw.support.readable import (
    Detail,
    ProgressObserver,
    number,
    percent,
    quantity,
    unobserved,
)

if TYPE_CHECKING:  # only laws take them
    from patchlaw.macro import FacePair, LawContactProblem, LoadedFace
    from patchlaw.multiscale.laws.law_table import LawTable


class About:
    """Statements on a coupling and on its load steps.

    Args:
        coupling: The coupling, a `Coupling`.

    Attributes:
        coupling: The coupling.
        parts: What is known of its scene.
        scene: The scene.
    """

    def __init__(self, coupling: Any) -> None:
        self.coupling, self.parts, self.scene = coupling, coupling.parts, coupling.scene

    # --- what a run would do

    def statements(self, memory: str = "") -> Iterator[tuple[str, str]]:
        """Yield pairs of topic and sentence that say what will be done and why, in one order.

        Args:
            memory: The memory that it takes, see `memory_statement`; empty says nothing of it.
        """
        said = self._described() | ({"memory": memory} if memory else {})
        yield from ((topic, said[topic]) for topic in describe.TOPICS if topic in said)

    def _described(self) -> dict[str, str]:
        """Return what will be done and why, a sentence for each of some of `describe.TOPICS`."""
        parts, scene, why = self.parts, self.scene, self.unmeasured()
        said = {
            "inputs": f"{describe.materials(parts)}; a surface of "
            f"{describe.dimensions(parts, has_body=scene.has_body)}",
            "surface": describe.surface(parts),
            "contact": describe.contact(parts),
            "micro model": parts.micro.name if parts.micro else describe.MESHED_CONTACTS,
            "coupling": self.coupling.statement,
            "load": describe.load(parts),
            "error": f"not measured: {why}" if why else self.coupling.checks,
        }
        if parts.plane_at_largest_load is not None and parts.path.quantity == "force":
            approach = quantity(parts.plane.approach - parts.zero, "mm", 3)
            said["load"] += f"; on a half-space its approach is about {approach}"
        if scene.has_body:
            said |= self._of_bodies()
        if scene.counter_surface is not None:
            said["two rough sides"] = describe.two_sides(parts)
        if parts.decision is not None:
            said["choice"] = parts.decision.sentence
        if scene.by_laws:
            said["newton"] = self.coupling.way_of_steps
        if scene.by_laws and (coefficients := scene.coefficients):
            said["friction"] = (
                f"coefficient {describe.of_zones(parts, map(number, coefficients))}; the laws "
                "are beds of springs with a slider each; GMRES, as tangents are unsymmetric"
            )
        return said

    def _of_bodies(self) -> dict[str, str]:
        """Return what the bodies are, and how contact problems see them."""
        parts, scene = self.parts, self.scene
        if scene.meshes_roughness:
            meshes = self.coupling.rough_meshes.statement
            if scene.block is not None:
                return {"block": f"{meshes}; {scene.block.sides} sides"}
            own = f"bisected from the {parts.body.cells} of {Path(scene.body.mesh).name}"
            return {"body": f"{meshes}; {own}"}
        if parts.samples:
            return {"body": describe.body(parts)}
        if not parts.body.on_mesh:
            return {"block": describe.block(parts)}
        return {"body": describe.body(parts), "body term": describe.body_term(parts)}

    # --- errors

    def unmeasured(self) -> str:
        """Return why a run does not measure the errors of its load steps; empty where it does."""
        why, asked = self.coupling.unmeasured, self.scene.output.check != "none"
        return why or ("" if asked or not self.coupling.causes else "output.check = 'none'")

    def warnings(self) -> Iterator[str]:
        """Yield what a user should know about the validity of the scene."""
        meshes = self.coupling.rough_meshes if self.scene.meshes_roughness else None
        return validity.warnings(self.parts, meshes)

    # --- memory

    @property
    def contact_memory(self) -> float:
        """Memory of the largest contact problem of cells, that of an error check included [B]."""
        parts = self.parts
        if parts.samples:
            return CELL_OF_CONTACT * parts.surface.heights.size
        if parts.cells is None:
            return 0.0
        size = math.prod(parts.cells)
        checked = parts.finite_slopes and self.scene.output.check != "none"
        return CELL_OF_CONTACT * size * (4 if checked and 4 * size <= MOST_CHECKED_CELLS else 1)

    def memory_requests(self) -> Iterator[MemoryRequest]:
        """Yield what a run needs memory for, key by key of its scene."""
        parts, scene = self.parts, self.scene
        yield from scene_requests(scene)
        steps = scene.loading.expected_count
        sections = {"body": scene.body, "counter_body": scene.counter_body}
        bodies = {"body": parts.body, "counter_body": parts.counter}
        for key, section in sections.items():
            if section is not None and section.mesh and (facts := bodies[key]) is not None:
                in_parts = section.mesh.lower().endswith(".xdmf")
                yield body_request(key, facts.element, facts.unknowns, steps, in_parts=in_parts)
        if scene.vibration is not None:
            yield modes_request(self._unknowns, scene.vibration.modes)
        yield from self.coupling.further_requests()

    @property
    def _unknowns(self) -> int:
        """Degrees of freedom of the bodies that have a mesh."""
        own = [one for one in (self.parts.body, self.parts.counter) if one is not None]
        if (cells := meshed_cells(self.scene)) is None:
            return sum(one.unknowns for one in own)
        order = int(block_section(self.scene).element[1])
        return sum(one.unknowns for one in own) + 3 * math.prod(order * n + 1 for n in cells)

    def memory_statement(self, program: float, ranks: int) -> str:
        """Say the memory that a run takes, and what takes most of it.

        Args:
            program: Memory of a process before anything of the scene is in it [B].
            ranks: Processes of the MPI job.
        """
        parts, scene, leak = self.parts, self.scene, 0.0
        # dolfinx and matplotlib take 70 MB each
        program += 70e6 * (scene.has_body + bool(scene.output.figures))
        if scene.leak is not None:
            from patchlaw.multiscale.laws.transmissivity import flow_memory  # others do without

            each = parts.patches.count if scene.by_laws else 1  # laws have a map for every patch
            sizes = [one.heights.size for region in parts.samples for one in region.surfaces]
            tabled = max(max(sizes), sum(sizes) // ranks) if sizes else 0
            leak = flow_memory(math.prod(parts.cells or parts.surface.grid) // each, tabled)
        requests = self.memory_requests()
        return memory_statement(parts, self.contact_memory, requests, program, ranks, leak)

    # --- of load steps

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the approximations behind load steps.

        Args:
            steps: The load steps.
        """
        yield from validity.large_strains(self.parts, steps)
        table = self.coupling.table
        if table is not None:
            yield from table.notes(self.coupling.table_tolerance)
        imbalances = [abs(step.imbalance) for step in steps if step.imbalance is not None]
        if imbalances:
            equal = percent(max(imbalances))
            yield Detail(f"force against the support's reaction: equal to {equal}")
        yield from range_notes(steps, table)
        yield from self.coupling.extensions


class Coupling(ABC):
    """A scene on its way to load steps.

    Args:
        parts: What is known of the scene before its load steps.
        comm: MPI communicator; None for this process alone.
        meshes: The body and the counter-body where these are meshes.

    Raises:
        InputError: When something does not lie on the bodies, or does not fit.

    Note:
        Collective, as all here.

    Attributes:
        parts: What is known of the scene before its load steps.
        comm: MPI communicator; None for this process alone.
        clock: Measures the phases of the run.
        table: The patch laws, once made, counted from first touch; set it to laws that are at hand.
            None without laws.
        start: What the first load step starts from, see `state`; set it before the model is made.
        told: What errors of load steps so far told once for later ones.
        extensions: What is said of laws that load steps needed further.
    """

    def __init__(self, parts: SceneParts, comm: Any, meshes: Meshes) -> None:
        self.parts, self.comm = parts, comm
        self._meshes = _placed(parts, meshes) if any(meshes) and not parts.samples else meshes
        self.clock = Clock()
        self.table: LawTable | None = None
        self.start: Any = None
        self.told: list[Any] = []
        self.extensions: list[str] = []

    @property
    def scene(self) -> Scene:
        """The scene, which leaves nothing open."""
        return self.parts.scene

    @property
    def about(self) -> About:
        """What is said of the coupling and of its load steps."""
        return About(self)

    @cached_property
    def bodies(self) -> Bodies:
        """The bodies under the contact, on every rank."""
        first, counter = self._meshes
        return Bodies(parts=self.parts, comm=self.comm, first=first, counter=counter)

    # --- what a plan and a report say of it; see `about` for the rest

    @property
    @abstractmethod
    def label(self) -> str:
        """The coupling, and the cells, meshes or micro model that it works on, in few words."""

    @property
    @abstractmethod
    def statement(self) -> str:
        """What the coupling is, in a sentence."""

    @property
    def causes(self) -> str:
        """Causes of the errors that are measured, in words; empty where none is."""
        return ""

    @property
    def unmeasured(self) -> str:
        """Why errors cannot be measured; empty where they can."""
        return f"coupling.kind = '{self.scene.kind}' has no measure of it"

    @property
    def checks(self) -> str:
        """At which load steps errors are measured, and their causes, in words."""
        which = "every load step" if self.scene.output.check == "all" else "the last load step"
        sheared = self.scene.friction is not None and not self.scene.loading.slides
        shear = "; those of the shear as well" * sheared
        return f"measured at {which}, by cause: {self.causes}{shear}"

    def error_notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of errors that the coupling knows of itself.

        Args:
            steps: The load steps.
        """
        return iter(())

    def further_requests(self) -> Iterator[MemoryRequest]:
        """Yield what the coupling alone needs memory for."""
        return iter(())

    def record(self) -> dict[str, Any]:
        """Return what the provenance of a run says of the coupling alone, by name."""
        return {} if self.parts.micro is None else {"micro_model": {"name": self.parts.micro.name}}

    @property
    def friction_is_coupled(self) -> bool:
        """Whether pressures and tractions of contacts see each other."""
        return False

    # --- laws

    @property
    def way_of_steps(self) -> str:
        """How load steps with laws are found, in words."""
        return "on the mesh of the body"

    @property
    def table_tolerance(self) -> float:
        """Interpolation error that laws are tabulated to."""
        # finer tables on cells would trace the steps of single ones
        default = 2e-3 if self.parts.summits is None else 1e-4
        return self.scene.coupling.table_tolerance or default

    def make_laws(self) -> LawTable:
        """Tabulate the laws of all patches or regions, once.

        Raises:
            InputError: When the coupling has no laws.
            NotConverged: When the micro model does not converge.

        Note:
            Collective.
        """
        self.scene.check_has_laws()
        if self.table is None:
            with self.clock.phase("laws"):
                made = self._make_table(self.clock.tell)
                self.table = made.with_stiffness_ratios(self._stiffness_ratios())
        return self.table

    def _make_table(self, observe: ProgressObserver, before: LawTable | None = None) -> LawTable:
        """Tabulate the laws; collective.

        Args:
            observe: Told of rows as they are made.
            before: Laws that end too early; where they cannot go further they come back.
        """
        raise NotImplementedError

    def _problem(self, face: LoadedFace | FacePair, table: LawTable) -> LawContactProblem:
        """Return a contact face with the laws on it."""
        raise NotImplementedError

    def _longer(self, table: LawTable) -> tuple[LawContactProblem, LawTable] | None:
        """Return laws that go further, on the contact face; None where none do; collective."""
        longer = self._make_table(unobserved, table)
        if longer is table:
            return None
        self.table = longer = longer.with_stiffness_ratios(self._stiffness_ratios())
        self.extensions.append(
            f"the laws were extended to {number(longer.largest_pressure)} MPa, which a load step "
            "needed"
        )
        return self._problem(self.bodies.contact_face, longer), longer

    def _stiffness_ratios(self) -> list[float]:
        """Return Mindlin's ratio of the bodies for every law."""
        return [self.parts.materials.stiffness_ratio] * self.parts.patches.count

    # --- load steps

    @abstractmethod
    def _make_model(self) -> Model:
        """Make the model of the contact; collective."""

    @cached_property
    def model(self) -> Model:
        """The model of the contact, on the bodies, which are made with it; collective."""
        with self.clock.phase("block"):
            made = self._make_model()
        if self.start is not None:
            made.restore(self.start)
        return made

    @property
    def made_model(self) -> Model | None:
        """The model, where it is made already."""
        return self.__dict__.get("model")

    @property
    def unknowns(self) -> int | None:
        """Degrees of freedom of the mesh that load steps are solved on, where there is one."""
        return None if self.made_model is None else self.made_model.unknowns

    def state(self) -> Any:
        """Return what the next load step starts from, see `Model.state`.

        Note:
            Collective.
        """
        return self.start if self.made_model is None else self.made_model.state()

    # --- what is made of load steps

    def contact(self, step: LoadStep, latest: Any) -> tuple[dict[str, Any], ContactState] | None:
        """Return the spots and fields of the contact of a load step.

        Args:
            step: The load step.
            latest: What `Model.latest` was after it.

        Returns:
            Columns of the load step that the contact tells, and the contact; None where none is
            known.

        Raises:
            NotConverged: When the contact problem behind laws cannot be solved.

        Note:
            Collective.
        """
        detail = self.model.detail(latest)
        return None if detail is None else ({}, detail)

    def measured_errors(
        self, step: LoadStep, past: Sequence[LoadStep] = (), *, normal: bool = True
    ) -> dict[str, Any]:
        """Measure the errors of a load step by further solutions.

        Args:
            step: The load step.
            past: All load steps before it.
            normal: Whether those of the normal force are measured, and not those of a shear alone.

        Returns:
            Columns of the load step; none where errors cannot be measured.

        Raises:
            NotConverged: When a contact problem cannot be solved.

        Note:
            Collective.
        """
        return {}

    def other_gap(self, step: LoadStep, factor: int = 1, *, worn: bool = False) -> Array | None:
        """Return the gaps under the load of a step, solved once more; see `open_gap`.

        Args:
            step: The load step.
            factor: How many times fewer cells there are along a side.
            worn: Whether as much more has worn off as the depths err by the steps of wear.

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

    @property
    def field_parts(self) -> PatchGrid:
        """The parts of the contact face that contacts are seen on in fields."""
        return self.parts.patches

    def release(self) -> None:
        """Free the bodies; load steps cannot be found any more.

        Note:
            Collective.
        """
        bodies = [] if self.made_model is None else self.made_model.meshed_bodies
        if not bodies and "bodies" in self.__dict__:
            bodies = self.bodies.made_bodies
        self._meshes = (None, None)
        for name in ("model", "bodies", "put_on_body"):  # they hold the bodies' matrices
            self.__dict__.pop(name, None)
        free_bodies(bodies)


def _placed(parts: SceneParts, meshes: Meshes) -> Meshes:
    """Return bodies in coordinates of the surface, which their contact faces must cover."""
    first, counter = meshes
    section, lengths = parts.scene.body, parts.surface.lengths
    if first is not None and section is not None:
        free = np.subtract(first.facts.lengths, lengths)
        place = section.place or (0.5 * float(free[0]), 0.5 * float(free[1]))
        first, counter = first.placed(place), counter and counter.placed(place)
    for mesh, key in ((first, "body.place"), (counter, "counter_body.contact")):
        if mesh is not None:
            with located(parts.scene.file, key):
                mesh.check_covers(lengths)
    return first, counter
