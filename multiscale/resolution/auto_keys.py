"""Keys of a scene that are left to the plan: which they are, and what they became."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import ValidationError

from geometry.surface import Surface
from micro import HalfSpaceModel
from multiscale.scene.coupling_sections import CouplingSection, ReferenceSection
from multiscale.scene.scene import Scene
from multiscale.setup.checks import PROVISIONAL_PATCHES
from multiscale.setup.problem import ProblemSetup

DEFAULT_ACCURACY = 0.02
"""Relative error of the force that is kept unless the scene says."""

PATCHES_ACROSS = 8
"""Patches along the shorter side, enough for a map."""

REFERENCE = "reference"
"""Section that is settled as a whole beside an accuracy."""


def auto_keys(scene: Scene) -> frozenset[str]:
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


def is_measured(scene: Scene) -> bool:
    """Tell whether errors are measured before the run, to choose what a scene leaves open.

    Without an accuracy, a micro model alone that is left open is chosen by its own error
    (`micro.choose`).

    Args:
        scene: The scene as it was given.
    """
    free = auto_keys(scene)
    if scene.accuracy is None and free <= {"micro.model", "patches.grid", "block.cells"}:
        return False
    fine = scene.coupling.kind == "reference" and scene.accuracy is not None
    return bool(free & {"surface.grid", "micro.model", "coupling.kind"}) or fine


def provisional(scene: Scene, free: frozenset[str]) -> Scene:
    """Return a scene whose open keys, but for the surface's grid, have values to start from.

    Args:
        scene: The scene as it was given.
        free: Its open keys.
    """
    changes: dict[str, Any] = {}
    if "micro.model" in free:
        measured = is_measured(scene) and scene.micro.tolerance is None
        model = "half-space" if measured else "auto"
        changes["micro"] = scene.micro.model_copy(update={"model": model})
    if "coupling.kind" in free:
        changes["coupling"] = next(couplings(scene))
    if "block.cells" in free:
        changes["block"] = scene.block.model_copy(update={"cells": None})
    if "patches.grid" in free:
        changes["patches"] = scene.patches.model_copy(update={"grid": PROVISIONAL_PATCHES})
    return scene.model_copy(update=changes)


def resolved_keys(setup: ProblemSetup, given: Scene) -> dict[str, Any]:
    """Return what the open keys of a scene became, so that a run goes on as it began.

    Rates of the machine decide near ties, and another session may run on another machine.

    Args:
        setup: The ingredients.
        given: The scene as it was given.

    Returns:
        Values that JSON can hold, by key: of the micro model the candidate's label or the cells of
        a half-space; of coupling and reference the whole section.
    """
    found: dict[str, Any] = {}
    scene = setup.scene
    for key in sorted(auto_keys(given)):
        section, _, name = key.partition(".")
        if key == "coupling.kind":
            found[key] = scene.coupling.model_dump(mode="json", exclude_unset=True)
        elif key == "micro.model":
            found[key] = _settled_model(setup)
        else:
            found[key] = getattr(getattr(scene, section), name)
    if is_measured(given):
        found[REFERENCE] = scene.reference.model_dump(mode="json", exclude_unset=True)
    return found


def _settled_model(setup: ProblemSetup) -> Any:
    if setup.choice is not None:
        return setup.choice.taken.label
    return list(setup.micro.surface.grid) if isinstance(setup.micro, HalfSpaceModel) else None


def with_resolved(scene: Scene, settled: Mapping[str, Any]) -> Scene:
    """Return a scene whose open keys, but for the micro model's cells, are what they became.

    Args:
        scene: The scene as it was given.
        settled: What `resolved_keys` returned.
    """
    changes: dict[str, Any] = {}
    for key in auto_keys(scene) & set(settled):
        section, _, name = key.partition(".")
        value = settled[key]
        if key == "coupling.kind":
            changes[section] = CouplingSection.model_validate(value)
            continue
        if key == "micro.model":
            if not isinstance(value, list):
                continue
            value = "half-space"
        value = tuple(value) if isinstance(value, list) else value
        changes[section] = getattr(scene, section).model_copy(update={name: value})
    if REFERENCE in settled:
        changes[REFERENCE] = ReferenceSection.model_validate(settled[REFERENCE])
    return scene.model_copy(update=changes)


def couplings(scene: Scene) -> Iterator[CouplingSection]:
    """Yield the couplings without meshed roughness that go with what a scene states.

    Isolated laws are never offered.

    Args:
        scene: The scene as it was given.
    """
    stated = scene.coupling.model_dump(exclude_unset=True) | {"kind": "auto"}
    for kind in ("concurrent", "consistent"):
        try:
            yield CouplingSection.model_validate(stated | {"kind": kind})
        except ValidationError:  # another key does not go with it
            continue


def map_grid(surface: Surface) -> tuple[int, int]:
    """Return nearly square patches that make a map, no more than heights.

    Args:
        surface: The surface.
    """
    shorter = min(surface.lengths)
    x, y = (
        min(max(round(PATCHES_ACROSS * length / shorter), 1), most)
        for length, most in zip(surface.lengths, surface.grid, strict=True)
    )
    return x, y
