"""What couplings that press one rough surface as a whole have in common.

The surface is made or read on one process, and its bodies must lie under all of it. Where the plane
is at the largest load is found before the load steps.
"""

from __future__ import annotations

import time

import numpy as np

from patchlaw.geometry import MaterialPair, PatchGrid, RigidPlane, Surface, patch_means
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale.loading.path import Path, Step
from patchlaw.multiscale.models.cell_contact import CellContact
from patchlaw.multiscale.models.couplings.coupling import Meshes
from patchlaw.multiscale.models.couplings.dispatch import traits_of
from patchlaw.multiscale.models.model import Model
from patchlaw.multiscale.models.problem import Problem
from patchlaw.multiscale.scene.loads import check_load, check_patches, path_on
from patchlaw.multiscale.scene.memory import check_memory
from patchlaw.multiscale.scene.parts import BodyFacts, SceneParts, Source, second_material
from patchlaw.multiscale.scene.surfaces import located, make_surfaces


def surface_parts(source: Source) -> SceneParts:
    """Return what is made from a scene of one surface, without its micro model; on one process.

    Args:
        source: The scene, and what else is known.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
    """
    began, scene = time.perf_counter(), source.scene
    traits = traits_of(scene)
    check_memory(source.nodes, traits.requests(scene))
    surface, counter_surface = make_surfaces(scene)
    check_patches(scene, traits.patch_limits(scene, surface))
    body, counter = source.facts
    body = body or BodyFacts.of_block(scene, surface, traits.unstated_cells(scene))
    materials = MaterialPair(first=body.materials[0], second=second_material(scene, counter))
    path, zero = path_on(scene, (surface,), surface.area)
    check_load(scene, path, zero, (surface,), surface.area, body if traits.has_body else None)
    patches = PatchGrid(grid=scene.patches.grid, lengths=surface.lengths)
    return SceneParts(
        scene=scene,
        surface=surface,
        counter_surface=counter_surface,
        materials=materials,
        patches=patches,
        mean_heights=patch_means(surface, patches),
        body=body,
        counter=counter,
        path=path,
        zero=zero,
        closes_at_corners=scene.coupling.interface == "pointwise",
        seconds={"surface": time.perf_counter() - began},
    )


def placed(parts: SceneParts, meshes: Meshes) -> Meshes:
    """Return bodies in coordinates of the surface, which their contact faces must cover.

    Args:
        parts: What is made from the scene.
        meshes: The body and the counter-body where these are meshes.

    Raises:
        InputError: When the surface does not lie on them.

    Note:
        Collective.
    """
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


def plane_at_largest_load(path: Path, model: Model | None, surface: Surface) -> RigidPlane | None:
    """Return the rigid plane at the largest load; of several, that which comes nearest.

    Args:
        path: The loads.
        model: Finds the plane where the force or the moment is prescribed; None leaves it open.
        surface: The surface.

    Raises:
        NotConverged: When the plane is not found in smaller steps either.
    """
    planes = []
    for control in path.largest_controls:
        if control.approach is not None and control.tilt is not None:
            planes.append(RigidPlane.above(surface, control.approach, control.tilt))
            continue
        if model is None:
            return None
        whole = Step(approach=control.approach, force=control.force, tilt=control.tilt)
        (step,) = Problem(model, [whole]).steps()
        planes.append(RigidPlane.above(surface, step.approach_mm, step.tilt))
    return max(planes, key=lambda plane: plane.approach)


def on_few_cells(model: HalfSpaceModel) -> CellContact:
    """Return what solves the contact of a half-space on few cells, which estimate planes.

    On 1024² cells with waves down to a 256th of the side the approach was within 1.5 %.

    Args:
        model: The half-space on the cells of the surface.
    """
    surface = model.surface
    x, y = (min(count, 96) for count in surface.grid)
    whole = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    return CellContact(model.resampled((x, y)), whole, patch_means(surface, whole))
