"""Sets up the problem of a scene and resolves its auto values."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from geometry.patches import PatchGrid, patch_means
from geometry.rigid_plane import RigidPlane
from geometry.surface import Surface
from micro import HalfSpaceModel, MicroModel, micro_model
from multiscale.couplings.contact import ContactCoupling
from multiscale.loading.stepper import Coupling, LoadHistory, load_steps
from multiscale.machine import ClusterNodes
from multiscale.planning.accuracy import setup_by_accuracy
from multiscale.planning.auto_keys import (
    auto_keys,
    is_measured,
    map_grid,
    provisional,
    with_resolved,
    with_value,
)
from multiscale.planning.mesh_accuracy import MeshError, measured_mesh_error
from multiscale.planning.representative_setup import representative_setup
from multiscale.scene.scene import Scene
from multiscale.setup.body_reader import scene_bodies
from multiscale.setup.memory import check_memory
from multiscale.setup.mesh_bodies import Faces, materials_in_contact
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.reference_meshes import reference_meshes
from multiscale.setup.surface_and_block import (
    Bulk,
    check_load,
    check_patches,
    load_history_on,
    make_shape,
    make_surface,
    make_surfaces,
    patch_grid,
)
from support.errors import InputError

_ESTIMATE_CELLS = 96
"""Cells along a side, at most, of the half-space that estimates the plane at the largest load. On
1024² cells with waves down to a 16th, 64th and 256th of the side the approach was within 1.5 %."""


def make_setup(
    scene: Scene,
    resolved: Mapping[str, Any] | None = None,
    nodes: ClusterNodes | None = None,
    *,
    like: ProblemSetup | None = None,
    mesh_error: MeshError = measured_mesh_error,
    faces: Faces | None = None,
) -> ProblemSetup:
    """Set up the problem of a scene: make the surface, resolve auto values, check that all fits.

    Args:
        scene: The scene.
        resolved: What auto values became when the run began; see `resolved_sections`.
        nodes: The nodes of the run; None for this process alone.
        like: A problem that was set up before and has the same surface, which is taken from it.
        mesh_error: Measures the relative error of a reference's meshes at the largest load.
        faces: What is known of the meshes of the scene's bodies; by default they are read.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
        NotConverged: When a contact problem cannot be solved.
    """
    began, nodes, known = time.perf_counter(), nodes or ClusterNodes(), resolved or {}
    auto: frozenset[str] = frozenset() if known else auto_keys(scene)
    start = provisional(with_resolved(scene, known), auto)
    faces = scene_bodies(scene, None).facts if faces is None else faces
    if scene.law.representative:
        return representative_setup(scene, nodes, faces)
    if not known and is_measured(scene):
        found = setup_by_accuracy(
            scene, start, lambda stated: _setup(stated, nodes, faces), mesh_error
        )
        return replace(found, seconds={"surface": 0.0, "choice": time.perf_counter() - began})
    if "patches.grid" in auto:
        start = with_value(start, "patches.grid", map_grid(start, make_surface(start)))
    return _setup(start, nodes, faces, known.get("micro"), like)


def _setup(
    scene: Scene,
    nodes: ClusterNodes,
    faces: Faces,
    known: Any = None,
    like: ProblemSetup | None = None,
) -> ProblemSetup:
    """Set up the problem of a scene without auto values, but for cells of its half-space.

    Args:
        scene: The scene.
        nodes: The nodes of the run.
        faces: What is known of the meshes of its bodies.
        known: The cells of the half-space when the run began; None when they are the surface's.
        like: As in `make_setup`.
    """
    began = time.perf_counter()
    check_memory(scene, nodes)
    if like:
        surface, counter_surface = like.surface, like.counter_surface
    else:
        surface, counter_surface = make_surfaces(scene)
    check_patches(scene, surface)
    materials, face = materials_in_contact(scene, faces), faces[0]
    shape = make_shape(scene, surface) if face is None else None
    height = shape.height if shape else face.depth if face else 0.0
    check_load(scene, (surface,), Bulk(surface.area, height, materials.first.young_modulus))
    patches = PatchGrid(grid=patch_grid(scene), lengths=surface.lengths)
    modulus = materials.contact_modulus
    setup = partial(
        ProblemSetup,
        scene=scene,
        surface=surface,
        counter_surface=counter_surface,
        materials=materials,
        patches=patches,
        mean_heights=patch_means(surface, patches),
        block_shape=shape,
        face=face,
        counter_face=faces[1],
    )
    made = time.perf_counter()
    seconds = {"surface": made - began}
    if scene.kind == "reference":  # whose meshes are small where contact can occur
        known_plane = estimated_plane(scene, surface, modulus)
        seconds["load estimate"] = time.perf_counter() - made
        meshes = reference_meshes(scene, surface, known_plane, nodes)
        return setup(micro=None, plane_at_largest_load=known_plane, meshes=meshes, seconds=seconds)
    model = stated_model(scene, surface, modulus)
    if isinstance(known, list) and isinstance(model, HalfSpaceModel):
        model = model.resampled((int(known[0]), int(known[1])))
    _refuse_without_summits(scene, model)
    chosen = time.perf_counter()
    load_history = load_history_on(scene, (surface,))
    plane = prescribed_plane(load_history, surface)
    isolated_or_meshed = scene.kind == "isolated" or scene.on_mesh  # whose laws end there
    if plane is None and (isolated_or_meshed or not isinstance(model, HalfSpaceModel)):
        coupling = ContactCoupling(model, patches, patch_means(surface, patches))
        plane = plane_at_largest_load(load_history, coupling, surface)
    seconds["load estimate"] = time.perf_counter() - chosen
    return setup(micro=model, plane_at_largest_load=plane, seconds=seconds)


def _refuse_without_summits(scene: Scene, model: MicroModel) -> None:
    if not math.isfinite(model.first_touch):
        raise InputError(
            "the surface has no summit that could carry load",
            key="micro.model",
            value=scene.micro.model,
            allowed="half-space",
            file=scene.file,
        )


def stated_model(scene: Scene, surface: Surface, contact_modulus: float) -> MicroModel:
    """Return the micro model that a scene names.

    Args:
        scene: The scene.
        surface: Its surface.
        contact_modulus: E* of its pair of materials [MPa].
    """
    model = micro_model(
        scene.micro.model,
        surface,
        contact_modulus=contact_modulus,
        solver=scene.micro.solver,
    )
    if isinstance(model, HalfSpaceModel):
        return replace(model, periodic=scene.surface.periodic, hardness=scene.micro.hardness)
    return model


def prescribed_plane(load_history: LoadHistory, surface: Surface) -> RigidPlane | None:
    """Return the rigid plane at the largest load; None where force or moments are prescribed.

    Args:
        load_history: The loads.
        surface: The surface.
    """
    if load_history.quantity == "force" or load_history.slopes is None:
        return None
    return RigidPlane.above(surface, load_history.largest, load_history.slopes)


def plane_at_largest_load(
    load_history: LoadHistory, coupling: Coupling, surface: Surface
) -> RigidPlane:
    """Return the rigid plane at the largest load.

    Args:
        load_history: The loads.
        coupling: Finds the plane where the force or the moment is prescribed.
        surface: The surface.

    Raises:
        NotConverged: When the plane is not found in smaller steps either.
    """
    if plane := prescribed_plane(load_history, surface):
        return plane
    (step,) = load_steps(coupling, load_history.up_to_largest)
    return RigidPlane.above(surface, step.approach_mm, step.tilt)


def estimated_plane(scene: Scene, surface: Surface, contact_modulus: float) -> RigidPlane:
    """Return the rigid plane at the largest load on a half-space of few cells.

    Args:
        scene: The scene.
        surface: Its surface.
        contact_modulus: E* of its pair of materials [MPa].
    """
    x, y = surface.grid
    periodic = scene.surface.periodic
    fine = HalfSpaceModel(
        surface, contact_modulus=contact_modulus, periodic=periodic, hardness=scene.micro.hardness
    )
    model = fine.resampled((min(x, _ESTIMATE_CELLS), min(y, _ESTIMATE_CELLS)))
    whole = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    coupling = ContactCoupling(model, whole, patch_means(surface, whole))
    return plane_at_largest_load(load_history_on(scene, (surface,)), coupling, surface)
