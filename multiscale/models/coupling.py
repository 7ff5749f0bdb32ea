"""From a scene to its coupling, which makes the model of its load steps: the base of all couplings.

One process makes what is known of the scene before the run, its `parts`: surface, materials, loads,
micro model. A coupling puts them on the bodies, makes the model that load steps are found with,
measures their errors, and knows what a run goes on from. What is said of it is `about` it.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from patchlaw.geometry import MaterialPair, PatchGrid, RigidPlane, Surface, patch_means
from patchlaw.geometry.contact_state import ContactState
from patchlaw.micro import HalfSpaceModel, MicroModel, micro_model
from patchlaw.multiscale.bodies.bodies import Bodies, free_bodies
from patchlaw.multiscale.bodies.reader import SceneBody, read_bodies
from patchlaw.multiscale.console import Clock
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.machine import ClusterNodes, large_object_comm
from patchlaw.multiscale.models.about import About
from patchlaw.multiscale.models.cell_contact import CellContact, on_few_cells
from patchlaw.multiscale.models.problem import Model, plane_at_largest_load
from patchlaw.multiscale.readable import ProgressObserver
from patchlaw.multiscale.results.accuracy import ReferenceRecord
from patchlaw.multiscale.scene.loads import check_load, check_patches, path_on
from patchlaw.multiscale.scene.memory import check_memory, scene_requests
from patchlaw.multiscale.scene.parts import BodyFacts, Facts, SceneParts, second_material
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene.surfaces import (
    located,
    make_surfaces,
    region_samples,
    sample_surface,
)
from patchlaw.support.arguments import Comm, checked
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError
from patchlaw.support.parallel import on_root_alone

if TYPE_CHECKING:  # only laws take it
    from patchlaw.multiscale.laws.law_table import LawTable

Meshes = tuple[SceneBody | None, SceneBody | None]
"""The body and the counter-body where these are meshes."""


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


def scene_parts(scene: Scene, facts: Facts, nodes: ClusterNodes) -> SceneParts:
    """Return what is known of a scene before its load steps; on one process.

    Args:
        scene: The scene, which leaves nothing open.
        facts: What is known of its bodies' meshes.
        nodes: The nodes of the run.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
        NotConverged: When the plane at the largest load is not found.
    """
    check_memory(nodes, scene_requests(scene))
    made = _of_samples(scene, facts) if scene.law.representative else _of_surface(scene, facts)
    made.check_slopes()
    return made


def _of_surface(scene: Scene, facts: Facts) -> SceneParts:
    """Return the parts of a scene that presses one rough surface as a whole."""
    began = time.perf_counter()
    surface, counter_surface = make_surfaces(scene)
    check_patches(scene, surface)
    body, counter = facts
    body = body or BodyFacts.of_block(scene, surface)
    materials = MaterialPair(first=body.materials[0], second=second_material(scene, counter))
    path, zero = path_on(scene, (surface,), surface.area)
    check_load(scene, path, zero, (surface,), surface.area, body if scene.has_body else None)
    patches = PatchGrid(grid=scene.patches.grid, lengths=surface.lengths)
    mean_heights, made = patch_means(surface, patches), time.perf_counter()
    micro = None if scene.meshes_roughness else _micro_model(scene, surface, materials)
    contact: Model | None = None
    if micro is None:
        modulus = materials.contact_modulus
        contact = on_few_cells(HalfSpaceModel(surface, contact_modulus=modulus))
    elif not math.isfinite(micro.first_touch):
        problem, key = "the surface has no summit that could carry load", "micro.model"
        raise InputError(problem, key=key, value=scene.micro.model, allowed="half-space")
    elif scene.on_mesh or not isinstance(micro, HalfSpaceModel):
        # laws end at the plane, and statements say it of summits
        contact = CellContact(micro, patches, mean_heights)
    slopes = scene.micro.finite_slopes is not False and isinstance(micro, HalfSpaceModel)
    plane = plane_at_largest_load(path, contact, surface)
    return SceneParts(
        scene=scene,
        surface=surface,
        counter_surface=counter_surface,
        materials=materials,
        patches=patches,
        mean_heights=mean_heights,
        body=body,
        counter=counter,
        path=path,
        zero=zero,
        micro=micro,
        finite_slopes=slopes and not scene.patches_alone,
        plane_at_largest_load=plane,
        seconds={"surface": made - began, "load estimate": time.perf_counter() - made},
    )


def _micro_model(scene: Scene, surface: Surface, materials: MaterialPair) -> MicroModel:
    """Return the micro model that a scene states, of its surface or a sample, on a half-space."""
    micro, periodic = scene.micro, scene.surface.periodic
    model = micro_model(micro.model, surface, contact_modulus=materials.contact_modulus)
    if isinstance(model, HalfSpaceModel):
        model = replace(model, periodic=periodic, hardness=micro.hardness)
        return model if micro.cells is None else model.resampled(micro.cells)
    return model


def _of_samples(scene: Scene, facts: Facts) -> SceneParts:
    """Return the parts of a scene under laws of samples."""
    began, (body, counter) = time.perf_counter(), facts
    body = body or BodyFacts.of_block(scene, sample_surface(scene, scene.surface, "surface"))
    samples = region_samples(scene, body.materials, second_material(scene, counter))
    surface, materials = samples[0].surfaces[0], samples[0].materials
    surfaces = tuple(one for region in samples for one in region.surfaces)
    (path, zero), plane = path_on(scene, surfaces, body.area), None
    check_load(scene, path, zero, surfaces, body.area, body)
    stated = _micro_model(scene, surface, materials)
    assert isinstance(stated, HalfSpaceModel), "scenes of summits are refused"
    model = replace(stated, periodic=True)
    if path.quantity != "force":
        mean = model.reference_height - surface.mean_height
        plane = RigidPlane.above(surface, min(path.largest(), mean))
    whole = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    return SceneParts(
        scene=scene,
        surface=surface,
        patches=whole,
        mean_heights=patch_means(surface, whole),
        materials=materials,
        body=body,
        counter=counter,
        path=path,
        zero=zero,
        seconds={"surface": time.perf_counter() - began},
        samples=samples,
        micro=model,
        finite_slopes=bool(scene.micro.finite_slopes),
        plane_at_largest_load=plane,
    )


_COUPLINGS = {
    "analytic": "cells.CellCoupling",
    "concurrent": "cells.CellCoupling",
    "consistent": "patch_laws.PatchCoupling",
    "isolated": "patch_laws.PatchCoupling",
    "representative": "samples.RepresentativeCoupling",
    "reference": "reference.ReferenceCoupling",
}
"""Module in this folder, and class, of every coupling; a run loads its own."""


@checked
def make_setup(
    scene: Scene,
    comm: Comm | None = None,
    *,
    nodes: ClusterNodes | None = None,
    read: Callable[[Scene, Any], Meshes] = read_bodies,
) -> Coupling:
    """Make the coupling of a scene: read its bodies, make all else on rank 0, and check the fit.

    Args:
        scene: The scene, of which an accuracy leaves nothing open; see `resolve`.
        comm: MPI communicator; None for this process alone.
        nodes: The nodes of the run; None for this process alone.
        read: Reads the bodies of a scene from their meshes; collective.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
        NotConverged: When a contact problem cannot be solved.

    Note:
        Collective.
    """
    if opened := sorted(scene.open_keys):
        raise InputError(
            f"leaves {', '.join(opened)} open",
            key="accuracy",
            value=scene.accuracy,
            allowed="make_setup(resolve(scene)), as run does",
            file=scene.file,
        )
    return trial_coupling(scene, comm, nodes or ClusterNodes(), read)


def trial_coupling(
    scene: Scene, comm: Any, nodes: ClusterNodes, read: Callable[[Scene, Any], Meshes]
) -> Coupling:
    """Make the coupling of a scene whose open keys are as they are by default; see `make_setup`."""
    _load_finite_elements(scene, comm)
    module, _, name = _COUPLINGS[scene.kind].partition(".")
    with located(scene):
        first, counter = meshes = read(scene, comm)
        facts = first.facts if first else None, counter.facts if counter else None
        parts = on_root_alone(large_object_comm(comm), lambda: scene_parts(scene, facts, nodes))
        kind = getattr(import_module(f"patchlaw.multiscale.models.{module}"), name)
        made: Coupling = kind(parts, comm, meshes, nodes)
        return made


def _load_finite_elements(scene: Scene, comm: Any) -> None:
    """Import the finite elements on all ranks where a scene may need them.

    PETSc starts with collective calls on all processes of the job, so that one rank alone must not
    import it. A process on its own imports them when it needs them.
    """
    meshed = scene.body is not None or (scene.counter_body and scene.counter_body.mesh)
    if comm is not None and (scene.has_body or meshed):
        import patchlaw.macro.bodies  # noqa: F401
