"""What couplings that press one rough surface as a whole have in common.

The surface is made or read on one process, and its bodies must lie under all of it.
"""

from __future__ import annotations

import time

import numpy as np

from patchlaw.geometry import MaterialPair, PatchGrid, patch_means
from patchlaw.multiscale.couplings.coupling import Meshes
from patchlaw.multiscale.couplings.dispatch import traits_of
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
