"""One way to compute a scene, and what all ways to compute it share."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeAlias

from multiscale.scene.scene import Scene
from multiscale.setup.surface_and_block import patch_grid

Content: TypeAlias = dict[str, Any]
Grid: TypeAlias = tuple[int, int]

OWN = "the scene as it is"
"""Beginning of the name of the configuration that runs the scene as its file states it."""

LOW_HEIGHTS_SCALE = 0.1
"""Heights and load of a reference with small slopes, relative to those of the scene."""

FEWEST_HEIGHTS = 32
"""Heights along a side, at least, of coarser versions of a surface."""

HEIGHTS_PER_WAVE = 3
"""Heights per shortest wave of the spectrum, at least, of coarser versions."""

_NO_OUTPUT: Content = {"figures": False, "report": False, "fields": False, "check": "none"}


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """One way to compute a scene.

    Attributes:
        name: A unique name, for tables and legends.
        content: The complete scene, as `Scene.from_dict` takes it.
        heights: Grid of the surface.
        cost: Predicted wall time [s].
        ranks: Number of processes.
        scale: Heights and load relative to those of the compared scene; results are divided by it.
        refusal: Why it cannot be run; empty where it can.
    """

    name: str
    content: Content
    heights: Grid
    cost: float
    ranks: int = 1
    scale: float = 1.0
    refusal: str = ""

    @cached_property
    def scene(self) -> Scene:
        """The scene of this configuration."""
        return Scene.from_dict(self.content)

    @property
    def is_own(self) -> bool:
        """Whether this is the scene as its file states it."""
        return self.name.startswith(OWN)

    @property
    def kind(self) -> str:
        """The coupling."""
        return str(self.content["coupling"]["kind"])

    @property
    def model(self) -> str:
        """The micro model; empty for an explicit reference."""
        return "" if self.kind == "reference" else str(self.content["micro"]["model"])

    @cached_property
    def key(self) -> str:
        """Hash of everything that the results depend on."""
        parts = {"scene": self.content, "version": version("patchlaw"), "ranks": self.ranks}
        file = self.content["surface"].get("file")
        if file is not None:
            parts["heights"] = hashlib.sha256(Path(file).read_bytes()).hexdigest()
        text = json.dumps(parts, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]


def pressure_grid(scene: Scene) -> Grid:
    """Return the patches that pressures are compared on: the scene's, divided to at least 4 × 4."""
    nx, ny = (count * -(-4 // count) for count in patch_grid(scene))
    return nx, ny


def content_of(scene: Scene) -> Content:
    """Return a scene as it would stand in a file, without output and without halved load steps."""
    content = scene.model_dump(by_alias=True, mode="json", exclude_none=True)
    if scene.surface_path is not None:
        content["surface"]["file"] = str(scene.surface_path.resolve())
    content["load"].pop("force_change", None)
    return content | {"output": _NO_OUTPUT}


def scaled(content: Content) -> Content | None:
    """Return a scene with heights and load scaled together; None where heights are from a file.

    As slopes become small, the force and all lengths normal to the surface scale alike (Hertz).
    What remains between the scaled scene and the scene itself is the effect of finite slopes.
    """
    surface, load, scale = content["surface"], content["load"], LOW_HEIGHTS_SCALE
    if "spectrum" not in surface:
        return None
    powers = {"rms_slope": 1, "rms_height": 1, "s0": 2}
    spectrum = {
        key: value * scale ** powers[key] if key in powers else value
        for key, value in surface["spectrum"].items()
    }
    scaled = {
        key: [scale * number for number in value]
        for key, value in load.items()
        if key in ("approach", "force") or (key == "tilt" and value != "free")
    }
    return content | {"surface": surface | {"spectrum": spectrum}, "load": load | scaled}


def coarser_grids(heights: Grid, scene: Scene) -> list[Grid]:
    """Return the grids that the surface can be made on, the coarsest first and its own last.

    Heights from a file have their own grid only.
    """
    grids, spectrum = [heights], scene.surface.spectrum
    while spectrum is not None and all(count % 2 == 0 for count in grids[0]):
        coarser = (grids[0][0] // 2, grids[0][1] // 2)
        bands = (spectrum.waves_x or spectrum.waves, spectrum.waves_y or spectrum.waves)
        shortest = [0.0 if band is None else band[1] for band in bands]
        if any(
            count < max(FEWEST_HEIGHTS, HEIGHTS_PER_WAVE * waves)
            for count, waves in zip(coarser, shortest, strict=True)
        ):
            break
        grids.insert(0, coarser)
    return grids
