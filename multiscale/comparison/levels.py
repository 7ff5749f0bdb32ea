"""The levels at which a scene can be computed, from the micro model alone to the meshed roughness.

All levels run the same surface, with its true heights, under the same load programme. Steps are not
halved (``load.force_change``), so that curves can be compared step by step. Couplings without laws
sum their results over the patches that pressures are compared on (`pressure_grid`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from geometry.errors import InputError, NotConverged
from geometry.meshes.families import suggested_fine
from micro import MODEL_NAMES
from multiscale.comparison.level import (
    OWN,
    Content,
    Grid,
    Level,
    coarser_grids,
    content_of,
    flattened,
    pressure_grid,
)
from multiscale.costs.prediction import predicted_cost
from multiscale.machine.rates import Machine
from multiscale.resolution.problem_setup import make_setup
from multiscale.scene.scene import Scene
from multiscale.setup.checks import EMBEDDED_CELLS, patch_grid
from multiscale.setup.surface import make_surface

LAW_HEIGHTS = 128
"""Heights along a side, at most, of half-spaces behind laws of several numbers of patches."""

PATCHES = (1, 2, 4, 8, 16)
"""Patches along a side of the couplings by laws."""

CELLS_PER_PATCH = 2
"""Elements along a patch, at least, of blocks that carry laws themselves."""

SMALL_SLOPES = ", small slopes"
"""What the name of a level has behind that of the same one with finite slopes."""

LOW = 0.1
"""Heights and load of a reference with small slopes, relative to the scene's."""

LOW_HEIGHTS = f", heights × {LOW:g}"
"""What the name of a level has behind that of the same one with true heights."""

_HALF_SPACE: Content = {"model": "half-space"}
_FITTED: Content = {"model": "elliptic", "curvature": "contact", "border": "include"}
_MESHES = tuple((meshes, 1.0) for meshes in (1, 2, 3))
_EDGES = ((1, 2.0), (1, 1.0), (2, 1.0), (3, 1.0), (3, 0.5**0.5))
"""Numbers of meshes, and edges relative to those that fit the contacts."""


def levels(scene: Scene, ranks: int = 1) -> tuple[Level, ...]:
    """Return the levels of a scene, cheapest first by predicted cost.

    Args:
        scene: The scene; of its keys only ``micro.model`` may be open.
        ranks: Processes for levels that can use more than one.

    Raises:
        InputError: When the surface cannot be read.
    """
    found: dict[str, Level] = {}
    for level in _Family(scene, ranks).all():  # the scene itself comes first, and keeps its name
        found.setdefault(level.key, level)
    return tuple(sorted(found.values(), key=lambda level: level.cost))


class _Family:
    """Makes the levels of one scene."""

    def __init__(self, scene: Scene, ranks: int) -> None:
        self._scene, self._ranks, self._machine = scene, ranks, Machine()
        self._base = content_of(scene)
        stated = scene.surface.grid
        self._heights: Grid = stated if isinstance(stated, tuple) else make_surface(scene).grid
        self._grids = coarser_grids(self._heights, scene.surface.spectrum)
        self._base["patches"] = {"grid": list(pressure_grid(scene))}
        # levels say what they are; beside an accuracy what they leave out would be chosen
        self._accuracy = {"accuracy": self._base.pop("accuracy", None)}

    def all(self) -> Iterator[Level]:
        for level in (
            self._own(),
            *self._analytic(),
            *self._isolated(),
            *self._consistent(),
            *self._concurrent(),
            *self._references(),
        ):
            if level is not None:
                yield level

    def _own(self) -> Level | None:
        whole = self._base | {"patches": {"grid": list(self._patches)}}
        if self._accuracy["accuracy"] is not None:
            whole |= self._accuracy
        kind, model = self._scene.coupling.kind, self._scene.micro.model
        parts: list[str] = [kind]
        if kind not in ("analytic", "reference"):
            parts.append(f"{_times(self._patches)} patches")
        if kind != "reference":
            parts.append(model)
        return self._level(f"{OWN}: {', '.join(parts)}", whole, self._heights)

    def _analytic(self) -> Iterator[Level | None]:
        alone = {"coupling": {"kind": "analytic"}, "block": self._block(None)}
        micros: dict[str, Content] = {
            name: {"model": name} for name in MODEL_NAMES if name != "half-space"
        }
        for name, micro in (micros | {"elliptic, fitted": _FITTED}).items():
            yield self._level(
                f"analytic, {name}", self._base | alone | {"micro": micro}, self._heights
            )
        for grid in self._grids:
            yield from self._half_spaces(f"analytic, half-space {_times(grid)}", alone, grid)

    def _concurrent(self) -> Iterator[Level | None]:
        changes = {"coupling": {"kind": "concurrent"}, "block": self._block(None)}
        for grid in self._grids:
            yield from self._half_spaces(f"concurrent, half-space {_times(grid)}", changes, grid)

    def _half_spaces(self, name: str, changes: Content, grid: Grid) -> Iterator[Level | None]:
        """Yield a level with the half-space; on one grid with small slopes too."""
        content = self._base | changes | {"micro": _HALF_SPACE}
        yield self._level(name, content, grid)
        if grid == self._law_grid:
            flat = content | {"micro": _HALF_SPACE | {"finite_slopes": False}}
            yield self._level(name + SMALL_SLOPES, flat, grid)

    def _isolated(self) -> Iterator[Level | None]:
        micro = self._base["micro"]
        if micro["model"] in ("half-space", "auto"):
            micro = {"model": "elliptic"}
        love = {"kind": "isolated", "love": self._scene.coupling.love}
        own, cells = self._patches, self._cells
        half = (max(1, cells[0] // 2), max(1, cells[1] // 2), max(1, cells[2] // 2))
        for grid, mesh in (*((grid, cells) for grid in self._patch_grids), (own, half)):
            if _carries(mesh, grid):
                yield self._patched("isolated", micro, grid, love, mesh)
        yield self._patched("isolated", _HALF_SPACE, own, love, cells)

    def _consistent(self) -> Iterator[Level | None]:
        own, coupling = self._patches, {"kind": "consistent", "compliance": "decomposed"}
        for grid in self._patch_grids:
            yield self._patched("consistent", _HALF_SPACE, grid, coupling, None)
        for heights in self._grids:
            name = f"consistent, {_times(own)} patches, half-space {_times(heights)}"
            changes = {"coupling": coupling, "patches": {"grid": list(own)}}
            yield from self._half_spaces(name, changes | {"block": self._block(None)}, heights)
        micro = self._base["micro"]
        if micro["model"] not in ("half-space", "auto"):
            yield self._patched("consistent", micro, own, coupling, None)
        meshed = {"kind": "consistent", "compliance": "finite-element"}
        if _carries(self._cells, own):
            yield self._patched("consistent", _HALF_SPACE, own, meshed, self._cells)

    def _patched(
        self, kind: str, micro: Content, grid: Grid, coupling: Content, cells: Any
    ) -> Level | None:
        heights, model = self._heights, micro["model"]
        if model == "half-space":
            heights = self._law_grid
            model += f" {_times(heights)}"
        name = f"{kind}, {_times(grid)} patches, {model}"
        changes: Content = {
            "micro": micro,
            "coupling": coupling,
            "patches": {"grid": list(grid)},
            "block": self._block(cells),
        }
        return self._level(
            f"{name}, {_times(cells)} elements" if cells else name, self._base | changes, heights
        )

    def _references(self) -> Iterator[Level | None]:
        """Yield levels with meshed roughness; one of them with low heights under a low load too."""
        stated = self._base["reference"]
        hexahedral = self._scene.reference.hexahedral
        fine = None if hexahedral else stated.get("fine") or self._finest_edge()
        for meshes, factor in _EDGES if fine else _MESHES:
            section = stated | {"meshes": meshes}
            name = f"reference, {meshes} mesh{'es' * (meshes > 1)}"
            if fine:
                section["fine"] = float(f"{factor * fine:.4g}")
                name += f", {1e3 * section['fine']:.3g} µm"
            changes = {"coupling": {"kind": "reference"}, "reference": section}
            level = self._level(
                name, self._base | changes | {"block": self._block(None)}, self._heights
            )
            yield level
            if fine and level is not None and (meshes, factor) == (1, 1.0):
                low = flattened(level.content, LOW)
                small = None if low is None else self._level(name + LOW_HEIGHTS, low, self._heights)
                yield None if small is None else replace(small, scale=LOW)

    def _finest_edge(self) -> float | None:
        """Return the edge of tetrahedra that fits the contacts; None where they are unknown."""
        load_history = self._scene.loading.load_history
        if load_history.quantity == "force" or load_history.tilt is None:
            return None
        surface = make_surface(self._scene)
        return suggested_fine(surface, load_history.largest, tilt=load_history.tilt)

    def _block(self, cells: Any) -> Content:
        block = {key: value for key, value in self._base["block"].items() if key != "cells"}
        return block | {"cells": list(cells)} if cells else block

    def _level(self, name: str, content: Content, heights: Grid) -> Level | None:
        """Return a level; None when the scene does not allow it.

        A reference that does not fit into the memory is told instead.
        """
        if heights != self._heights:
            content = content | {"surface": content["surface"] | {"grid": list(heights)}}
        cost, refusal = float("inf"), ""
        try:
            scene = Scene.from_dict(content)
            cost = predicted_cost(make_setup(scene), self._machine).total
        except (InputError, NotConverged) as error:
            if content["coupling"]["kind"] != "reference" or "GB of memory" not in str(error):
                return None
            refusal = str(error)
        kind = scene.coupling.kind
        return Level(
            name=name,
            kind=kind,
            content=content_of(scene),
            heights=heights,
            cost=cost,
            ranks=1 if kind == "analytic" else self._ranks,
            refusal=refusal,
        )

    @property
    def _cells(self) -> tuple[int, int, int]:
        """Elements of a block that carries laws itself."""
        stated = self._scene.block.cells
        return stated if isinstance(stated, tuple) else EMBEDDED_CELLS

    @property
    def _patches(self) -> Grid:
        """The scene's own patches."""
        return patch_grid(self._scene)

    @property
    def _patch_grids(self) -> list[Grid]:
        fitting = [count for count in PATCHES if count <= min(self._heights)]
        grids = {(count, count) for count in fitting} | {self._patches}
        return sorted(grids)

    @property
    def _law_grid(self) -> Grid:
        """The finest of the surface's grids that laws can be made on without much waiting."""
        fitting = [grid for grid in self._grids if max(grid) <= LAW_HEIGHTS]
        return fitting[-1] if fitting else self._grids[0]


def _carries(cells: tuple[int, ...], grid: Grid) -> bool:
    """Tell whether every patch lies on enough elements."""
    return all(c >= CELLS_PER_PATCH * n for c, n in zip(cells[:2], grid, strict=True))


def _times(counts: tuple[int, ...]) -> str:
    return " × ".join(map(str, counts))
