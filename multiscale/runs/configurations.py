"""The configurations of a scene: all sensible ways to compute it.

They range from the micro model alone to the meshed roughness. All of them have the same surface
with its true heights, and the same load history. Load steps are never halved
(``load.force_change``), so that curves can be compared step by step. Couplings without laws sum
their results over the patches that pressures are compared on (`pressure_grid`).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias, cast

from patchlaw.geometry import Surface, suggested_fine
from patchlaw.micro import MODELS
from patchlaw.multiscale.scene.loads import loads_on
from patchlaw.multiscale.scene.parts import LAW_BLOCK_CELLS, block_section
from patchlaw.multiscale.scene.scene import Scene, identity
from patchlaw.multiscale.scene.schema import to_dict
from patchlaw.multiscale.scene.surfaces import make_surface
from patchlaw.support import InputError
from patchlaw.support.readable import times

Grid: TypeAlias = tuple[int, int]
"""Heights or patches along x and y."""
Values: TypeAlias = dict[str, Any]
"""Sections and dotted keys of a scene with their values."""

OWN = "the scene as it is"
"""Beginning of the name of the configuration that runs the scene as its file states it."""

SMALL_SLOPES = ", small slopes"
"""End of the name of a configuration that differs from another by neglecting finite slopes."""

_HALF_SPACE: Values = {"model": "half-space"}
_NO_OUTPUT: Values = {"figures": False, "report": False, "check": "none", "contact": "none"}


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """One way to compute a scene.

    Attributes:
        name: A unique name, for tables and legends.
        scene: The scene that does it.
    """

    name: str
    scene: Scene

    @property
    def kind(self) -> str:
        """The name of the coupling."""
        return self.scene.kind

    @property
    def model(self) -> str:
        """The micro model; empty for an explicit reference."""
        return "" if self.scene.meshes_roughness else self.scene.micro.model

    @property
    def heights(self) -> Grid:
        """Grid of the surface, which all configurations state."""
        return cast("Grid", self.scene.surface.grid)

    @property
    def cells(self) -> Grid:
        """Cells of half-space contact problems, which are the heights if nothing else is stated."""
        return self.scene.micro.cells or self.heights

    @cached_property
    def key(self) -> str:
        """Hash of everything that the results depend on."""
        content = json.dumps(identity(self.scene), sort_keys=True)
        return hashlib.sha256(content.encode()).hexdigest()[:20]


def configurations(scene: Scene) -> list[Configuration]:
    """Return the configurations of a scene: itself, then others, roughly the cheap ones first.

    Args:
        scene: The scene, which leaves nothing open.

    Raises:
        InputError: When the surface cannot be read.
    """
    chosen: dict[str, Configuration] = {}
    # The scene itself comes first: an equal configuration does not replace its name.
    for number, values in enumerate(_ways(scene)):
        with suppress(InputError):  # what a key of the scene does not go with
            changed = scene.with_(values)
            name = f"{OWN}: " * (number == 0) + _name(changed)
            one = Configuration(name=name, scene=changed)
            chosen.setdefault(one.key, one)
    return list(chosen.values())


def pressure_grid(scene: Scene) -> Grid:
    """Return the patches that pressures are compared on: the scene's, divided to at least 4 × 4."""
    nx, ny = (count * -(-4 // count) for count in scene.patches.grid)
    return nx, ny


def coarser_grids(heights: Grid, scene: Scene) -> list[Grid]:
    """Return the grids that the surface can be made on, the coarsest first and its own last.

    Heights from a file have their own grid only, and so have those of two rough sides.
    """
    grids, spectrum = [heights], scene.surface.spectrum
    if spectrum is None or scene.counter_surface is not None:
        return grids
    bands = (spectrum.waves_x or spectrum.waves, spectrum.waves_y or spectrum.waves)
    # at least 32 heights along a side, and 3 per shortest wave
    least = [max(32, 3 * band[1]) for band in bands if band]
    while all(n % 2 == 0 and n // 2 >= few for n, few in zip(grids[0], least, strict=True)):
        grids.insert(0, (grids[0][0] // 2, grids[0][1] // 2))
    return grids


def _ways(scene: Scene) -> Iterator[Values]:
    """Yield by what the configurations differ from the scene; the scene itself is first."""
    surface, cells = make_surface(scene), block_section(scene).cells
    grids = coarser_grids(surface.grid, scene)
    of_all = {"output": _NO_OUTPUT, "load.force_change": None, "surface.grid": grids[-1]}
    yield of_all | {"block.cells": cells if scene.on_mesh else None}
    # Of all others every key is stated, so that no accuracy chooses one; only laws need a mesh.
    common = of_all | {"accuracy": None, "block.cells": None, "patches.grid": pressure_grid(scene)}
    common["micro"] = to_dict(replace(scene.micro, cells=None), whole=False)
    half_spaces = _half_spaces(grids)
    for model in MODELS:
        yield common | {"coupling": {"kind": "analytic"}, "micro": {"model": model}}
    for kind in ("analytic", "concurrent"):
        yield from (common | {"coupling": {"kind": kind}} | values for values in half_spaces)
    yield from (common | values for values in _laws(scene, grids, cells or LAW_BLOCK_CELLS))
    yield from (common | values for values in _references(scene, surface))


def _law_grid(grids: Sequence[Grid]) -> Grid:
    """Return the finest of the grids that is quick behind many laws."""
    return next((grid for grid in reversed(grids) if max(grid) <= 128), grids[0])


def _half_spaces(grids: Sequence[Grid]) -> list[Values]:
    """Return half-spaces on every grid, and one of them without finite slopes."""
    small = {"micro": _HALF_SPACE | {"finite_slopes": False}, "surface.grid": _law_grid(grids)}
    return [*({"micro": _HALF_SPACE, "surface.grid": grid} for grid in grids), small]


def _laws(scene: Scene, grids: Sequence[Grid], cells: tuple[int, int, int]) -> Iterator[Values]:
    """Yield couplings by laws, from asperities and from half-spaces."""
    own = scene.patches.grid
    isolated: Values = {"coupling": {"kind": "isolated", "love": scene.coupling.love}}
    consistent: Values = {"coupling": {"kind": "consistent"}}
    on_cells: Values = {"micro": _HALF_SPACE, "surface.grid": _law_grid(grids)}
    if scene.micro.model != "half-space":
        yield consistent | {"patches.grid": own}
    else:
        isolated["micro"] = {"model": "elliptic"}
    half = tuple(max(1, count // 2) for count in cells)
    sides = (count for count in (1, 2, 4, 8, 16) if count <= min(grids[-1]))
    partitions = {(count, count) for count in sides} | {own}
    for patches, mesh in (*((patches, cells) for patches in partitions), (own, half)):
        if all(c >= 2 * n for c, n in zip(mesh[:2], patches, strict=True)):  # under every patch
            yield isolated | {"patches.grid": patches, "block.cells": mesh}
    for patches in partitions:
        yield consistent | on_cells | {"patches.grid": patches}
    for values in _half_spaces(grids):
        yield consistent | values | {"patches.grid": own}
    yield isolated | on_cells | {"patches.grid": own, "block.cells": cells}


def _references(scene: Scene, surface: Surface) -> Iterator[Values]:
    """Yield references, of several numbers of meshes and, where known, with several edges."""
    loads, fine = scene.loading, scene.reference.fine
    if not fine and loads.approach is not None and loads.tilt != "free":
        largest = loads_on(scene.with_({"load.steps": 1}), (surface,), surface.area).path.largest()
        fine = suggested_fine(surface, largest, tilt=loads.tilt)
    ways = [(1, 1.0), (2, 1.0), (3, 1.0)]  # numbers of meshes, and edges over those that fit
    for meshes, factor in [(1, 2.0), *ways, (3, 0.5**0.5)] if fine else ways:
        edges = {"reference.fine": float(f"{factor * fine:.4g}")} if fine else {}
        yield {"coupling": {"kind": "reference"}, "reference.meshes": meshes} | edges


def _name(scene: Scene) -> str:
    """Return the name of a configuration in tables: its coupling, micro model and grids."""
    micro, reference = scene.micro, scene.reference
    if scene.meshes_roughness:
        name = f"reference, {reference.meshes} mesh{'es' * (reference.meshes > 1)}"
        return f"{name}, {1e3 * reference.fine:.3g} µm" if reference.fine else name
    name = scene.kind
    if scene.by_laws:
        name += f", {times(scene.patches.grid)} patches"
    name += f", {micro.model}"
    if micro.model == "half-space":
        name += f" {times(micro.cells or scene.surface.grid)}"
    cells = block_section(scene).cells
    name += f", {times(cells)} elements" if cells else ""
    return name + SMALL_SLOPES * (micro.finite_slopes is False)
