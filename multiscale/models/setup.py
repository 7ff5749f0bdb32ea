"""From a scene to its coupling.

One process makes what is known of the scene before the run, its parts: surface, materials, loads,
micro model. Of these every process makes the coupling that the scene names.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

from patchlaw.geometry import MaterialPair, PatchGrid, RigidPlane, Surface, patch_means
from patchlaw.micro import HalfSpaceModel, MicroModel, micro_model
from patchlaw.multiscale.bodies.reader import Meshes, read_bodies
from patchlaw.multiscale.machine import ClusterNodes, large_object_comm
from patchlaw.multiscale.models.cell_contact import CellContact, on_few_cells
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.models.problem import Model, plane_at_largest_load
from patchlaw.multiscale.scene.loads import check_load, check_patches, loads_on
from patchlaw.multiscale.scene.memory import check_memory, scene_requests
from patchlaw.multiscale.scene.parts import BodyFacts, Facts, SceneParts, second_material
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene.surfaces import make_surfaces, region_samples, sample_surface
from patchlaw.support import Comm, InputError, checked, located, on_root_alone


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
    made.nodes = nodes
    return made


def _of_surface(scene: Scene, facts: Facts) -> SceneParts:
    """Return the parts of a scene that presses one rough surface as a whole."""
    began = time.perf_counter()
    surface, counter_surface = make_surfaces(scene)
    check_patches(scene, surface)
    body, counter = facts
    body = body or BodyFacts.of_block(scene, surface)
    materials = MaterialPair(first=body.materials[0], second=second_material(scene, counter))
    path, zero, *_ = loads = loads_on(scene, (surface,), surface.area)
    check_load(scene, loads, body if scene.has_body else None)
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
    (path, zero, *_), plane = (loads := loads_on(scene, surfaces, body.area)), None
    check_load(scene, loads, body)
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
    "analytic": "cell_coupling.CellCoupling",
    "concurrent": "cell_coupling.CellCoupling",
    "consistent": "patch_coupling.PatchCoupling",
    "isolated": "patch_coupling.PatchCoupling",
    "representative": "representative_coupling.RepresentativeCoupling",
    "reference": "reference_coupling.ReferenceCoupling",
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
    meshed = scene.body is not None or (scene.counter_body and scene.counter_body.mesh)
    if comm is not None and (scene.has_body or meshed):
        # PETSc starts with collective calls on all processes of the job: one rank alone must not
        # import it; a process on its own does when it needs it
        import patchlaw.macro.bodies  # noqa: F401
    module, _, name = _COUPLINGS[scene.kind].partition(".")
    with located(scene.file):
        first, counter = meshes = read(scene, comm)
        facts = first.facts if first else None, counter.facts if counter else None
        parts = on_root_alone(large_object_comm(comm), lambda: scene_parts(scene, facts, nodes))
        kind = getattr(import_module(f"patchlaw.multiscale.models.{module}"), name)
        made: Coupling = kind(parts, comm, meshes)
        return made
