"""The content of scenes as dictionaries, which a comparison changes to compute them differently."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from multiscale.inputs.loads import patch_grid
from multiscale.scene.scene import Scene

Content: TypeAlias = dict[str, Any]
Grid: TypeAlias = tuple[int, int]
"""Heights or patches along x and y."""

LOW_HEIGHTS_SCALE = 0.1
"""Heights and load of a reference with small slopes, relative to those of the scene."""

LOW_HEIGHTS = f", heights × {LOW_HEIGHTS_SCALE:g}"
"""End of the name of that reference; the rest is the name of the one with true heights."""

FEWEST_HEIGHTS = 32
"""Heights along a side, at least, of coarser versions of a surface."""

HEIGHTS_PER_WAVE = 3
"""Heights per shortest wave of the spectrum, at least, of coarser versions."""

SMALL_SLOPES = ", small slopes"
"""End of the name of a configuration that differs from another by neglecting finite slopes."""

_NO_OUTPUT: Content = {
    "figures": False,
    "report": False,
    "fields": False,
    "check": "none",
    "contact": "none",
}


def pressure_grid(scene: Scene) -> Grid:
    """Return the patches that pressures are compared on: the scene's, divided to at least 4 × 4."""
    nx, ny = (count * -(-4 // count) for count in patch_grid(scene))
    return nx, ny


def content_of(scene: Scene) -> Content:
    """Return a scene as it would stand in a file, without output and without halved load steps.

    A micro model that an accuracy leaves open stays open.
    """
    content = scene.model_dump(by_alias=True, mode="json", exclude_none=True)
    if scene.accuracy is not None and not scene.micro.model_fields_set:
        content["micro"] = {}
    for key, path in scene.files().items():  # the content has no folder that names start in
        *sections, name = key.split(".")
        place: Any = content
        for one in sections:
            place = place[int(one) if one.isdigit() else one]
        place[name] = str(path.resolve())
    content["load"].pop("force_change", None)
    return content | {"output": _NO_OUTPUT}


def scaled(content: Content) -> Content:
    """Return a scene with heights, made from a spectrum, and load scaled together.

    As slopes become small, the force and all lengths normal to the surface scale alike (Hertz).
    What remains between the scaled scene and the scene itself is the effect of finite slopes.
    """
    surface, load, scale = content["surface"], content["load"], LOW_HEIGHTS_SCALE
    powers = {"rms_slope": 1, "rms_height": 1, "s0": 2}
    spectrum = {
        key: value * scale ** powers[key] if key in powers else value
        for key, value in surface["spectrum"].items()
    }
    motion = {  # approach, force and a prescribed tilt are the lists
        key: [scale * number for number in value] if isinstance(value, list) else value
        for key, value in load.items()
    }
    return content | {"surface": surface | {"spectrum": spectrum}, "load": motion}


def coarser_grids(heights: Grid, scene: Scene) -> list[Grid]:
    """Return the grids that the surface can be made on, the coarsest first and its own last.

    Heights from a file have their own grid only, and so have those of two rough sides.
    """
    grids, spectrum = [heights], scene.surface.spectrum
    if spectrum is None or scene.counter_surface is not None:
        return grids
    bands = (spectrum.waves_x or spectrum.waves, spectrum.waves_y or spectrum.waves)
    least = [max(FEWEST_HEIGHTS, HEIGHTS_PER_WAVE * band[1]) for band in bands if band]
    while all(n % 2 == 0 and n // 2 >= few for n, few in zip(grids[0], least, strict=True)):
        grids.insert(0, (grids[0][0] // 2, grids[0][1] // 2))
    return grids


def name_of(content: Content) -> str:
    """Return the name of a scene among its configurations."""
    micro, reference, surface = (content[name] for name in ("micro", "reference", "surface"))
    kind, model = content["coupling"]["kind"], micro.get("model", "half-space")
    cells = content["block"].get("cells")
    if kind == "reference":
        meshes, fine = reference["meshes"], reference.get("fine")
        name = f"reference, {meshes} mesh{'es' * (meshes > 1)}"
        return f"{name}, {1e3 * fine:.3g} µm" if fine else name
    name = kind
    if kind in ("isolated", "consistent"):
        name += f", {_times(content['patches']['grid'])} patches"
    name += f", {model}"
    if model == "half-space":
        name += f" {_times(surface['grid'])}"
    name += f", {_times(cells)} elements" if cells else ""
    return name + SMALL_SLOPES * (micro.get("finite_slopes") is False)


def _times(counts: Sequence[int]) -> str:
    return " × ".join(map(str, counts))
