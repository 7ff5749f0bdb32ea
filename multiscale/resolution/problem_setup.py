"""Turns a scene into its ingredients, and settles what it leaves open."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from geometry.asperities import Asperities, find_asperities
from geometry.errors import InputError
from geometry.patches import PatchGrid, patch_means
from geometry.surface import Surface
from micro import HalfSpaceModel, MicroModel, resampled
from multiscale.machine.nodes import ClusterNodes
from multiscale.resolution.accuracy import accurate_stage
from multiscale.resolution.auto_keys import (
    accuracy_of,
    auto_keys,
    is_measured,
    map_grid,
    provisional,
    with_resolved,
)
from multiscale.resolution.micro_model import (
    chosen_model,
    estimated_plane,
    find_plane_at_largest_load,
    stated_model,
)
from multiscale.scene.scene import Scene
from multiscale.setup.checks import check_load, check_memory, check_patches, patch_grid
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.reference_meshes import reference_meshes
from multiscale.setup.surface import make_shape, make_surface


def make_setup(
    scene: Scene, settled: Mapping[str, Any] | None = None, nodes: ClusterNodes | None = None
) -> ProblemSetup:
    """Make or read the surface, find its summits, settle what is open, check that all fits.

    Args:
        scene: The scene.
        settled: What open keys became when the run began; see `resolved_keys`.
        nodes: The nodes of the run; None for this process alone.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
    """
    began, nodes = time.perf_counter(), nodes or ClusterNodes()
    known = settled or {}
    free = auto_keys(scene) - set(known)
    start = provisional(with_resolved(scene, known), free)
    if free and is_measured(scene) and not known:
        setup = accurate_stage(scene, start, lambda stated: _stage(stated, nodes))
        return replace(setup, seconds={"surface": 0.0, "choice": time.perf_counter() - began})
    if "patches.grid" in free:
        section = start.patches.model_copy(update={"grid": map_grid(make_surface(start))})
        start = start.model_copy(update={"patches": section})
    return _stage(start, nodes, known.get("micro.model"))


def _stage(scene: Scene, nodes: ClusterNodes, known: Any = None) -> ProblemSetup:
    """Return the ingredients of a scene of which the micro model alone may be open.

    Args:
        scene: The scene.
        nodes: The nodes of the run.
        known: What became of the micro model when the run began: a label, or cells; None when
            that is not known.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
    """
    began = time.perf_counter()
    check_memory(scene, nodes)
    surface = make_surface(scene)
    check_patches(scene, surface)
    check_load(scene, surface)
    patches = PatchGrid(grid=patch_grid(scene), lengths=surface.lengths)
    asperities = find_asperities(surface, periodic=False)  # the block's sides are free
    if scene.coupling.kind == "reference":
        return _reference_stage(scene, surface, patches, asperities, nodes, began)
    seconds, choice = {"surface": time.perf_counter() - began}, None
    if scene.micro.model == "auto":
        made = time.perf_counter()
        tolerance = scene.micro.tolerance or accuracy_of(scene)
        choice = chosen_model(scene, surface, patches, tolerance, known)
        seconds["micro choice"] = time.perf_counter() - made
    model = choice.model if choice else stated_model(scene, surface)
    if isinstance(known, list) and isinstance(model, HalfSpaceModel):
        cells = resampled(surface, (int(known[0]), int(known[1])))
        model = replace(model, surface=cells, highest=surface.highest)
    _check_summits(scene, model)
    mean_heights = patch_means(surface, patches)
    return ProblemSetup(
        scene=scene,
        surface=surface,
        asperities=asperities,
        micro=model,
        patches=patches,
        mean_heights=mean_heights,
        shape=make_shape(scene, surface),
        plane_at_largest_load=find_plane_at_largest_load(
            scene.loading.load_history, model, patches, mean_heights
        ),
        choice=choice,
        seconds=seconds,
    )


def _check_summits(scene: Scene, model: MicroModel) -> None:
    if not math.isfinite(model.first_touch):
        raise InputError(
            "the surface has no summit that could carry load",
            key="micro.model",
            value=scene.micro.model,
            allowed="half-space, islands",
            file=scene.file,
        )


def _reference_stage(
    scene: Scene,
    surface: Surface,
    patches: PatchGrid,
    asperities: Asperities,
    nodes: ClusterNodes,
    began: float,
) -> ProblemSetup:
    """Return the ingredients of a reference, which needs no micro model."""
    plane_at_largest_load = estimated_plane(scene, surface)
    return ProblemSetup(
        scene=scene,
        surface=surface,
        asperities=asperities,
        micro=None,
        patches=patches,
        mean_heights=patch_means(surface, patches),
        shape=make_shape(scene, surface),
        plane_at_largest_load=plane_at_largest_load,
        meshes=reference_meshes(scene, surface, plane_at_largest_load, nodes),
        seconds={"surface": time.perf_counter() - began},
    )
