"""Auto values of a scene: which keys have one, what to start from, and what they became."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from patchlaw.geometry.surface import Surface
from patchlaw.multiscale.couplings.coupling import Coupling
from patchlaw.multiscale.couplings.dispatch import coupling_class
from patchlaw.multiscale.inputs.surfaces import most_waves
from patchlaw.multiscale.scene.reader import read, to_dict
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene.sections import CouplingSection
from patchlaw.support.errors import InputError

MOST_HEIGHTS = 2048
"""Heights along a side of grids that are chosen, at most."""
SOLUTIONS_OF_LAWS = 84
"""Solutions of the contact problem that a table of laws takes: models of cells took 75 to 105 for
45 to 65 rows."""
_KEYS = ("surface.grid", "micro.model", "coupling.kind", "patches.grid", "block.cells")
_OF_SAMPLES = ("surface.grid", "micro.finite_slopes")
_BODIES = ("body", "counter_body")
_MEASURED = ("surface.grid", "micro.model", "coupling.kind", "micro.finite_slopes")


def auto_keys(scene: Scene) -> frozenset[str]:
    """Return the keys that an accuracy chooses, which are not stated beside it.

    The block's cells are one of them only under laws on its mesh, the grid of the surface only
    where it is a spectrum's, the degree of displacements only under laws of samples.

    Args:
        scene: The scene as it was given.
    """
    if scene.accuracy is None:
        return frozenset()
    representative = scene.law.representative
    keys = _OF_SAMPLES if representative else _KEYS
    open_keys = {key for key in keys if _is_open(scene, key)} | set(_of_elements(scene))
    return frozenset(open_keys if scene.on_mesh else open_keys - {"block.cells"})


def _is_open(scene: Scene, key: str) -> bool:
    """Tell whether a key is not stated."""
    name, _, field = key.partition(".")
    section = getattr(scene, name)
    if section is None:
        return False
    if name == "surface":
        return scene.surface.lacks_grid
    # other keys of a micro model belong to one that is stated
    return not (scene.stated(name) if key == "micro.model" else field in scene.stated(name))


def _of_elements(scene: Scene) -> Iterator[str]:
    """Yield the open keys on the meshes of bodies: refinements, under laws of samples elements."""
    if not coupling_class(scene).has_body:
        return
    meshed = [name for name in _BODIES if getattr(getattr(scene, name), "mesh", None)]
    fields = [f"{name}.refinements" for name in meshed]
    if scene.law.representative:
        fields += [f"{name}.element" for name in meshed]
        fields += [f"block.{field}" for field in ("cells", "element") if scene.block is not None]
    yield from (key for key in fields if _is_open(scene, key))


def is_measured(scene: Scene) -> bool:
    """Tell whether errors are measured before the run to resolve auto values.

    They are wherever a key is open that errors depend on, the edges of a reference's meshes and the
    elements of bodies among them.

    Args:
        scene: The scene as it was given.
    """
    if scene.accuracy is None:
        return False
    opened = bool(auto_keys(scene) & {*_MEASURED, *_of_elements(scene)})
    return opened or (coupling_class(scene).meshes_roughness and scene.reference.fine is None)


def provisional(scene: Scene, auto: frozenset[str]) -> Scene:
    """Return a scene with values to start from for its auto keys, but for the surface's grid.

    Args:
        scene: The scene as it was given.
        auto: Its auto keys.
    """
    return replace(scene, coupling=chosen_coupling(scene)[0]) if "coupling.kind" in auto else scene


def with_value(scene: Scene, key: str, value: Any) -> Scene:
    """Return a scene with another value of a key, which is not checked.

    Args:
        scene: The scene.
        key: Section and name, such as ``"patches.grid"``.
        value: The value.
    """
    name, _, field = key.partition(".")
    section = replace(getattr(scene, name), **{field: value})
    return replace(scene, **{name: section})


def resolved_sections(coupling: Coupling, given: Scene) -> dict[str, Any]:
    """Return what the auto values of a scene became, so that a run goes on as it began.

    It need not measure errors again.

    Args:
        coupling: The coupling.
        given: The scene as it was given.

    Returns:
        The sections with auto values by name, as JSON can hold them. That of the micro model is the
        cells of the half-space; under laws of samples ``finite_slopes`` is beside it.
    """
    names = {key.partition(".")[0] for key in auto_keys(given)}
    if is_measured(given):
        names |= {"coupling", "reference"}  # the tolerance of laws, and the edges of meshes
    sections: dict[str, Any] = {}
    for name in sorted(names):
        section = getattr(coupling.scene, name)
        sections[name] = to_dict(section)
    if "micro" in names:
        sections["micro"] = None if coupling.cells is None else list(coupling.cells)
    if "micro.finite_slopes" in auto_keys(given):
        sections["finite_slopes"] = coupling.scene.micro.finite_slopes
    return sections


def with_resolved(scene: Scene, resolved: Mapping[str, Any]) -> Scene:
    """Return a scene whose auto values are what they became, but for the micro model's cells.

    Args:
        scene: The scene as it was given.
        resolved: What `resolved_sections` returned.
    """
    of_micro = ("micro", "finite_slopes")
    contents = {name: content for name, content in resolved.items() if name not in of_micro}
    sections: dict[str, Any] = {
        name: read(type(getattr(scene, name)), content) for name, content in contents.items()
    }
    stated = {  # which other scenes are made from
        name: {key: value for key, value in content.items() if value is not None}
        for name, content in contents.items()
    }
    if "finite_slopes" in resolved:
        scene = with_value(scene, "micro.finite_slopes", resolved["finite_slopes"])
    return replace(scene, **sections, written=scene.written | stated)


def chosen_coupling(scene: Scene) -> tuple[CouplingSection, str]:
    """Return the coupling that is chosen beside what a scene states, and why.

    It is concurrent, which has neither laws nor their error, unless the scene has more load steps
    than consistent laws take solutions, or states what belongs to laws.

    Args:
        scene: The scene as it was given, whose coupling is open.
    """
    fitting = {}
    for kind in ("concurrent", "consistent"):
        with suppress(InputError):  # another key does not go with it
            fitting[kind] = scene.with_({"coupling.kind": kind}).coupling
    steps = scene.loading.expected_count
    if len(fitting) < 2:
        kind = next(iter(fitting), "consistent")
        return fitting.get(kind, scene.coupling), "what the scene states goes with no other"
    if steps > SOLUTIONS_OF_LAWS:
        why = f"laws take about {SOLUTIONS_OF_LAWS} contact problems, fewer than {steps} load steps"
        return fitting["consistent"], why
    why = f"no laws, which take about {SOLUTIONS_OF_LAWS} contact problems for {steps} load steps"
    return fitting["concurrent"], why


def map_grid(scene: Scene, surface: Surface) -> tuple[int, int]:
    """Return nearly square patches that make a map, no more than heights or elements below.

    There are 8 along the shorter side.

    Args:
        scene: The scene.
        surface: Its surface.
    """
    shorter = min(surface.lengths)
    most = np.min(list(coupling_class(scene).patch_limits(scene, surface).values()), axis=0)
    x, y = (
        min(max(round(8 * length / shorter), 1), int(limit))
        for length, limit in zip(surface.lengths, most, strict=True)
    )
    return x, y


def on_waves(scene: Scene, count: int) -> Scene:
    """Return a scene on a grid with so many heights along the shortest wavelength.

    Args:
        scene: The scene, of a spectrum.
        count: Heights along the wavelength.
    """
    section = scene.surface
    if section.spectrum is None or section.lengths is None:  # refused when the scene was read
        return scene
    waves = most_waves(section.spectrum, section.lengths)
    grid = tuple(min(max(8 * math.ceil(count * k / 8), 32), MOST_HEIGHTS) for k in waves)
    return with_value(scene, "surface.grid", grid)
