"""The base of all couplings.

A coupling puts the parts of a scene on the bodies, makes the model that load steps are found with,
measures their errors, and knows what a run goes on from. What is said of it is `about` it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.contact_state import ContactState
from patchlaw.multiscale.bodies.bodies import Bodies, free_bodies
from patchlaw.multiscale.bodies.reader import Meshes
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.machine import Clock, ClusterNodes, MemoryRequest
from patchlaw.multiscale.models.about import About
from patchlaw.multiscale.models.problem import Model
from patchlaw.multiscale.readable import ProgressObserver
from patchlaw.multiscale.results.accuracy import ReferenceRecord
from patchlaw.multiscale.scene.parts import SceneParts
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene.surfaces import located
from patchlaw.support.arrays import Array

if TYPE_CHECKING:  # only laws take it
    from patchlaw.multiscale.laws.law_table import LawTable


class Coupling(ABC):
    """A scene on its way to load steps.

    Args:
        parts: What is known of the scene before its load steps.
        comm: MPI communicator; None for this process alone.
        meshes: The body and the counter-body where these are meshes.
        nodes: The nodes of the run.

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
        extensions: What is said of laws that load steps needed further.
    """

    def __init__(
        self, parts: SceneParts, comm: Any, meshes: Meshes, nodes: ClusterNodes | None = None
    ) -> None:
        self.parts, self.comm = parts, comm
        self._meshes = meshes if parts.samples else _placed(parts, meshes)
        self.clock = Clock()
        self.table: LawTable | None = None
        self.start: Any = None
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
    def condensed(self) -> bool:
        """Whether load steps with laws know the bodies by the compliance of their patches alone."""
        return False

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
                made = self._make_table(self.clock.observe)
                self.table = made.with_stiffness_ratios(self._stiffness_ratios())
        return self.table

    def _make_table(self, observe: ProgressObserver | None) -> LawTable:
        """Tabulate the laws; collective."""
        raise NotImplementedError

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
            with located(parts.scene, key):
                mesh.check_covers(lengths)
    return first, counter
