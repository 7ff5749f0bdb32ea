"""Turns a scene into its ingredients, and settles what it leaves open."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any

from geometry.asperities import Asperities, find_asperities
from geometry.errors import InputError
from geometry.patches import PatchGrid, patch_means
from geometry.surface import Surface
from micro import MicroModel
from multiscale.ingredients import make_shape, make_surface
from multiscale.nodes import Nodes
from multiscale.planning.choices import SETTLED_LATE, cheapest, open_keys, provisional, with_settled
from multiscale.planning.micro_choice import (
    chosen_model,
    estimated_plane,
    furthest_plane,
    stated_model,
)
from multiscale.planning.surface_choice import chosen_surface, micro_tolerance
from multiscale.reference.meshes import reference_meshes
from multiscale.scene import Scene
from multiscale.stage import Stage
from multiscale.stage_checks import check_load, check_patches, check_size, patch_grid


def make_stage(
    scene: Scene, settled: Mapping[str, Any] | None = None, nodes: Nodes | None = None
) -> Stage:
    """Make or read the surface, find its summits, settle what is open, check that all fits.

    Args:
        scene: The scene.
        settled: What open keys became when the run began; see `settled_keys`.
        nodes: The nodes of the run; None for this process alone.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
    """
    began, nodes = time.perf_counter(), nodes or Nodes()
    known = settled or {}
    free = open_keys(scene) - set(known)
    start = provisional(with_settled(scene, known), free)
    check_size(start, nodes)
    if "surface.grid" in free:
        start, surface = chosen_surface(scene, start)
    else:
        surface = make_surface(start)
    check_patches(start, surface)
    check_load(start, surface)
    patches = PatchGrid(grid=patch_grid(start), lengths=surface.lengths)
    asperities = find_asperities(surface, periodic=False)  # the block's sides are free
    if start.coupling.kind == "reference":
        return _reference_stage(start, surface, patches, asperities, nodes, began)
    label = known.get("micro.model")
    stage = _micro_stage(scene, start, surface, patches, asperities, label, began)
    if free & SETTLED_LATE:
        return cheapest(stage, scene, free, nodes)
    return stage


def _micro_stage(
    scene: Scene,
    start: Scene,
    surface: Surface,
    patches: PatchGrid,
    asperities: Asperities,
    label: str | None,
    began: float,
) -> Stage:
    """Return the ingredients with the micro model that a scene names, or leaves to be chosen.

    Args:
        scene: The scene as it was given.
        start: What it has become so far.
        surface: Its surface.
        patches: Its patches.
        asperities: The surface's summits.
        label: What was chosen when the run began; None when it begins now.
        began: When this began.
    """
    seconds, choice = {"surface": time.perf_counter() - began}, None
    if start.micro.model == "auto":
        made, tolerance = time.perf_counter(), micro_tolerance(scene, start, surface)
        choice = chosen_model(start, surface, patches, tolerance, label)
        seconds["micro choice"] = time.perf_counter() - made
    model = choice.model if choice else stated_model(start, surface)
    _check_summits(start, model)
    mean_heights = patch_means(surface, patches)
    return Stage(
        scene=start,
        surface=surface,
        asperities=asperities,
        micro=model,
        patches=patches,
        mean_heights=mean_heights,
        shape=make_shape(start, surface),
        furthest=furthest_plane(start.loading.programme, model, patches, mean_heights),
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
    nodes: Nodes,
    began: float,
) -> Stage:
    """Return the ingredients of a reference, which needs no micro model."""
    furthest = estimated_plane(scene, surface)
    return Stage(
        scene=scene,
        surface=surface,
        asperities=asperities,
        micro=None,
        patches=patches,
        mean_heights=patch_means(surface, patches),
        shape=make_shape(scene, surface),
        furthest=furthest,
        meshes=reference_meshes(scene, surface, furthest, nodes),
        seconds={"surface": time.perf_counter() - began},
    )
