"""Chooses what a scene leaves open: the cheapest combination that is expected to be accurate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import product
from typing import Any

from pydantic import ValidationError

from geometry.errors import InputError
from geometry.patches import PatchGrid, patch_means
from multiscale.ingredients import make_shape
from multiscale.nodes import Nodes
from multiscale.planning.costs import predicted_cost
from multiscale.planning.decision import Alternative, decided
from multiscale.planning.expected_errors import expected_errors
from multiscale.planning.machine import this_machine
from multiscale.scene import Scene
from multiscale.scenes.sections import CouplingSection
from multiscale.stage import Stage
from multiscale.stage_checks import (
    EMBEDDED_CELLS,
    PROVISIONAL_PATCHES,
    check_patches,
    check_size,
    patch_grid,
)

DEFAULT_ACCURACY = 0.02
"""Relative error of the force that is kept unless the scene says."""

PATCHES_ACROSS = (8, 16)
"""Patches along the shorter side: enough for a map, and what laws may need more."""

MESH_CELLS = ((24, 24, 15), EMBEDDED_CELLS)
"""Cells of a mesh under laws."""

SETTLED_LATE = frozenset({"coupling.kind", "patches.grid", "block.cells"})
"""Keys that are settled when surface and micro model are known."""


def open_keys(scene: Scene) -> frozenset[str]:
    """Return the keys that are left to the plan: ``"auto"``, or not stated beside an accuracy.

    The block's cells are one of them only under laws on its mesh.

    Args:
        scene: The scene as it was given.
    """
    free = set()
    for name, key in (
        ("surface", "grid"),
        ("micro", "model"),
        ("coupling", "kind"),
        ("patches", "grid"),
        ("block", "cells"),
    ):
        section = getattr(scene, name)
        unstated = scene.accuracy is not None and key not in section.model_fields_set
        if name == "micro":  # its other keys are about a model that they want stated
            unstated = unstated and not section.model_fields_set
        if getattr(section, key) == "auto" or (unstated and name != "surface"):
            free.add(f"{name}.{key}")
    if not scene.coupling.on_mesh:
        free.discard("block.cells")
    return frozenset(free)


def accuracy_of(scene: Scene) -> float:
    """Return the relative error of the force that a scene may be left with.

    Args:
        scene: The scene.
    """
    return scene.accuracy or DEFAULT_ACCURACY


def provisional(scene: Scene, free: frozenset[str]) -> Scene:
    """Return a scene whose open keys, but for the surface's grid, have values to start from.

    Args:
        scene: The scene as it was given.
        free: Its open keys.
    """
    changes: dict[str, Any] = {}
    if "micro.model" in free:
        changes["micro"] = scene.micro.model_copy(update={"model": "auto"})
    if "coupling.kind" in free:
        changes["coupling"] = next(_couplings(scene))
    if "block.cells" in free:
        changes["block"] = scene.block.model_copy(update={"cells": None})
    if "patches.grid" in free:
        changes["patches"] = scene.patches.model_copy(update={"grid": PROVISIONAL_PATCHES})
    return _changed(scene, changes)


def cheapest(stage: Stage, given: Scene, free: frozenset[str], nodes: Nodes) -> Stage:
    """Return a stage whose open keys of coupling, patches and block are chosen.

    Args:
        stage: The ingredients with provisional values.
        given: The scene as it was given.
        free: Its open keys.
        nodes: The nodes of the run.

    Raises:
        InputError: When no combination fits what the scene states.
    """
    stages, refused = [], None
    for scene in _scenes(stage, given, free):
        try:
            stages.append(_with(stage, scene, nodes))
        except InputError as error:
            refused = refused or error
    if not stages:
        raise refused or InputError("leaves nothing to choose", key="coupling.kind")
    found = [_alternative(each) for each in stages]
    decision = decided(found, accuracy_of(given))
    taken = stages[next(k for k, a in enumerate(found) if a is decision.taken)]
    return replace(taken, decision=decision)


def settled_keys(stage: Stage, given: Scene) -> dict[str, Any]:
    """Return what the open keys of a scene became, so that a run goes on as it began.

    Rates of the machine decide near ties, and another session may run on another machine.

    Args:
        stage: The ingredients.
        given: The scene as it was given.

    Returns:
        Values that JSON can hold, by key; of the micro model the candidate's label.
    """
    found: dict[str, Any] = {}
    for key in sorted(open_keys(given)):
        section, _, name = key.partition(".")
        if key == "coupling.kind":
            found[key] = stage.scene.coupling.model_dump(mode="json", exclude_unset=True)
        elif key == "micro.model":
            found[key] = stage.choice.taken.label if stage.choice else None
        else:
            found[key] = getattr(getattr(stage.scene, section), name)
    return found


def with_settled(scene: Scene, settled: Mapping[str, Any]) -> Scene:
    """Return a scene whose open keys, but for the micro model, are what they became before.

    Args:
        scene: The scene as it was given.
        settled: What `settled_keys` returned.
    """
    changes: dict[str, Any] = {}
    for key in open_keys(scene) & set(settled) - {"micro.model"}:
        section, _, name = key.partition(".")
        if key == "coupling.kind":
            changes[section] = CouplingSection.model_validate(settled[key])
            continue
        value = settled[key]
        value = tuple(value) if isinstance(value, list) else value
        changes[section] = getattr(scene, section).model_copy(update={name: value})
    return _changed(scene, changes)


def _alternative(stage: Stage) -> Alternative:
    return Alternative(
        kind=stage.scene.coupling.kind,
        patches=stage.patches.grid,
        cells=stage.shape.cells if stage.scene.coupling.on_mesh else None,
        error=sum(expected_errors(stage).values()),
        seconds=predicted_cost(stage, this_machine()).total,
    )


def _with(stage: Stage, scene: Scene, nodes: Nodes) -> Stage:
    """Return a stage of the same surface and micro model for another scene."""
    check_size(scene, nodes)
    check_patches(scene, stage.surface)
    patches = PatchGrid(grid=patch_grid(scene), lengths=stage.surface.lengths)
    shape = make_shape(scene, stage.surface)
    means = patch_means(stage.surface, patches)
    made = replace(stage, scene=scene, patches=patches, mean_heights=means, shape=shape)
    return made


def _scenes(stage: Stage, given: Scene, free: frozenset[str]) -> Iterator[Scene]:
    """Yield the scenes that the open keys allow."""
    couplings = list(_couplings(given)) if "coupling.kind" in free else [given.coupling]
    for coupling in couplings:
        grids, cells = [stage.scene.patches.grid], [stage.scene.block.cells]
        if "patches.grid" in free:
            # patches gather results; only laws can become better with more of them
            across = PATCHES_ACROSS if coupling.kind == "consistent" else PATCHES_ACROSS[:1]
            grids = [_grid(stage, count) for count in across]
        if "block.cells" in free:
            cells = list(MESH_CELLS)
        for grid, each in product(grids, cells):
            yield _changed(
                stage.scene,
                {
                    "coupling": coupling,
                    "patches": given.patches.model_copy(update={"grid": grid}),
                    "block": given.block.model_copy(update={"cells": each}),
                },
            )


def _grid(stage: Stage, across: int) -> tuple[int, int]:
    """Return nearly square patches, as many along the shorter side, but no more than heights."""
    lengths, heights = stage.surface.lengths, stage.surface.grid
    shorter = min(lengths)
    x, y = (
        min(max(round(across * length / shorter), 1), most)
        for length, most in zip(lengths, heights, strict=True)
    )
    return x, y


def _couplings(scene: Scene) -> Iterator[CouplingSection]:
    """Yield the couplings that go with what the scene states; isolated laws are never offered."""
    stated = scene.coupling.model_dump(exclude_unset=True) | {"kind": "auto"}
    for kind in ("concurrent", "consistent"):
        try:
            yield CouplingSection.model_validate(stated | {"kind": kind})
        except ValidationError:  # another key does not go with it
            continue


def _changed(scene: Scene, sections: dict[str, Any]) -> Scene:
    """Return a scene with other sections, from the same file."""
    return scene.model_copy(update=sections)
