"""One way to compute a scene, among those that are compared; grids that they share."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeAlias

from multiscale.scene.scene import Scene
from multiscale.scene.sections import SpectrumSection
from multiscale.setup.checks import patch_grid

Content: TypeAlias = dict[str, Any]
Grid: TypeAlias = tuple[int, int]

OWN = "the scene as it is"
"""How the name begins of the level that runs the scene as its file has it."""

OPTIONS: Content = {"figures": False, "report": False, "fields": False, "check": "none"}
"""Levels write nothing, and measure no errors: the comparison does."""

FEWEST_HEIGHTS = 32
"""Heights along a side, at least, of coarser versions of a surface."""

HEIGHTS_PER_WAVE = 3
"""Heights per shortest wave of the spectrum, at least, of coarser versions."""


@dataclass(frozen=True, kw_only=True)
class Level:
    """One way to compute a scene.

    Attributes:
        name: What tells it from the others, for tables and legends.
        kind: Its coupling.
        content: The complete scene, as `Scene.from_dict` takes it.
        heights: Heights of its surface.
        cost: Predicted wall time [s]; orders the levels.
        ranks: Processes that it runs on.
        scale: Heights and load relative to those of the scene compared; results are divided by it.
        refusal: Why it cannot be run; empty where it can.
    """

    name: str
    kind: str
    content: Content
    heights: Grid
    cost: float
    ranks: int = 1
    scale: float = 1.0
    refusal: str = ""

    @cached_property
    def scene(self) -> Scene:
        """The scene of this level."""
        return Scene.from_dict(self.content)

    @property
    def is_own(self) -> bool:
        """Whether this is the scene as its file has it."""
        return self.name.startswith(OWN)

    @property
    def model(self) -> str:
        """The micro model; an explicit reference has none."""
        return "" if self.kind == "reference" else str(self.content["micro"]["model"])

    @property
    def key(self) -> str:
        """Hash of all that its results depend on."""
        told = {"scene": self.content, "version": version("patchlaw"), "ranks": self.ranks}
        file = self.content["surface"].get("file")
        if file is not None:
            told["heights"] = hashlib.sha256(Path(file).read_bytes()).hexdigest()
        text = json.dumps(told, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]


def content_of(scene: Scene) -> Content:
    """Return a scene as it would stand in a file, alone in the world; steps are not halved."""
    content = scene.model_dump(by_alias=True, mode="json", exclude_none=True)
    if scene.surface_path is not None:
        content["surface"]["file"] = str(scene.surface_path.resolve())
    content["load"].pop("force_change", None)
    return content | {"output": OPTIONS}


def flattened(content: Content, scale: float) -> Content | None:
    """Return a scene with heights and load scaled together; None where heights are from a file.

    As slopes become small, the force and all lengths normal to the surface scale alike (Hertz's
    limit), and what is left between the two are the slopes.

    Args:
        content: The scene.
        scale: Factor of heights, approach or force, and tilt.
    """
    surface, load = content["surface"], content["load"]
    if "spectrum" not in surface:
        return None
    powers = {"rms_slope": 1, "rms_height": 1, "s0": 2}
    spectrum = {
        key: value * scale ** powers[key] if key in powers else value
        for key, value in surface["spectrum"].items()
    }
    load = dict(load)
    for name in ("approach", "force"):
        if name in load:
            load[name] = [scale * point for point in load[name]]
    if load["tilt"] != "free":
        load["tilt"] = [scale * slope for slope in load["tilt"]]
    return content | {"surface": surface | {"spectrum": spectrum}, "load": load}


def pressure_grid(scene: Scene) -> Grid:
    """Return the patches that pressures are compared on: the scene's, divided to at least 4 × 4."""
    nx, ny = (count * -(-4 // count) for count in patch_grid(scene))
    return nx, ny


def coarser_grids(heights: Grid, spectrum: SpectrumSection | None) -> list[Grid]:
    """Return the grids that a surface can be made on, coarsest first.

    Args:
        heights: Its own grid, the last.
        spectrum: What it is made from; heights from a file are taken as they are.
    """
    grids = [heights]
    while spectrum is not None and all(count % 2 == 0 for count in grids[0]):
        coarser = (grids[0][0] // 2, grids[0][1] // 2)
        fewest = [max(FEWEST_HEIGHTS, HEIGHTS_PER_WAVE * count) for count in _shortest(spectrum)]
        if any(count < least for count, least in zip(coarser, fewest, strict=True)):
            break
        grids.insert(0, coarser)
    return grids


def _shortest(spectrum: SpectrumSection) -> tuple[float, float]:
    """Return the largest numbers of waves per side."""
    x, y = (band or spectrum.waves or (0.0, 0.0) for band in (spectrum.waves_x, spectrum.waves_y))
    return x[1], y[1]
