"""The levels at which a scene can be computed, from the micro model alone to the meshed roughness.

All levels run the same surface under the same load programme. Steps are not halved
(``load.force_change``), so that curves can be compared step by step. Couplings without laws sum
their results over the patches that pressures are compared on (`pressure_grid`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from geometry.errors import InputError, NotConverged
from micro import MODEL_NAMES
from multiscale.comparing.level import OWN, Content, Level, content_of, flattened
from multiscale.comparing.level_grids import Grid, coarser_grids, pressure_grid
from multiscale.comparing.meshed_levels import meshed
from multiscale.ingredients import make_surface
from multiscale.planning.costs import predicted_cost
from multiscale.planning.machine import Machine
from multiscale.scene import Scene
from multiscale.stage_checks import EMBEDDED_CELLS, patch_grid
from multiscale.staging import make_stage

LAW_HEIGHTS = 128
"""Heights along a side, at most, of the half-space behind consistent laws."""

PATCHES = (1, 2, 4, 8, 16)
"""Patches along a side of the couplings by laws."""

CELLS_PER_PATCH = 2
"""Elements along a patch, at least, of blocks that carry laws themselves."""

SMOOTH_CELLS = ((8, 8, 6), (20, 20, 12), (24, 24, 16))
"""Elements of blocks that only correct the half-space: coarse, as by default, fine."""

FINE_LOADS = 32
"""Rectangles along a side, at least, that tell a block of the contacts' forces where they are told
finely; patches decide how many they are, and contacts next to the block's sides feel them."""

SMALL = 0.1
"""Heights and load of a reference with small slopes, relative to the scene's."""


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
        first = found.setdefault(level.key, level)
        found[level.key] = replace(first, slopes=first.slopes or level.slopes)
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
        fitted = {"model": "elliptic", "curvature": "contact", "border": "include"}
        micros: dict[str, Content] = {
            name: {"model": name} for name in MODEL_NAMES if name != "half-space"
        }
        for name, micro in (micros | {"elliptic, fitted": fitted}).items():
            yield self._level(f"analytic, {name}", self._alone(micro), self._heights)
        for grid in self._grids:
            yield self._level(
                f"analytic, half-space {_times(grid)}",
                self._alone({"model": "half-space"}),
                grid,
                slopes=grid == self._law_grid,
            )

    def _alone(self, micro: Content) -> Content:
        return self._base | {
            "micro": micro,
            "coupling": {"kind": "analytic"},
            "block": self._block(None),
        }

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
        yield self._patched("isolated", {"model": "half-space"}, own, love, cells)

    def _consistent(self) -> Iterator[Level | None]:
        own, whole = self._patches, {"model": "half-space"}
        decomposed = {"kind": "consistent", "compliance": "decomposed"}
        for grid in self._patch_grids:
            yield self._patched("consistent", whole, grid, decomposed, None)
        micro = self._base["micro"]
        if micro["model"] not in ("half-space", "auto"):
            yield self._patched("consistent", micro, own, decomposed, None)
        meshed = {"kind": "consistent", "compliance": "finite-element"}
        if _carries(self._cells, own):
            yield self._patched("consistent", whole, own, meshed, self._cells)

    def _patched(
        self, kind: str, micro: Content, grid: Grid, coupling: Content, cells: Any
    ) -> Level | None:
        heights = self._law_grid if micro["model"] == "half-space" else self._heights
        name = f"{kind}, {_times(grid)} patches, {micro['model']}"
        changes: Content = {
            "micro": micro,
            "coupling": coupling,
            "patches": {"grid": list(grid)},
            "block": self._block(cells),
        }
        return self._level(
            f"{name}, {_times(cells)} elements" if cells else name, self._base | changes, heights
        )

    def _concurrent(self) -> Iterator[Level | None]:
        coarse, usual, fine = SMOOTH_CELLS
        pairs = [(grid, usual) for grid in self._grids]
        pairs += [(self._law_grid, coarse), *((grid, fine) for grid in self._grids[-2:])]
        for grid, cells in pairs:
            changes: Content = {
                "micro": {"model": "half-space"},
                "coupling": {"kind": "concurrent"},
                "block": self._block(cells),
            }
            name = f"concurrent, half-space {_times(grid)}, {_times(cells)} elements"
            yield self._level(name, self._base | changes, grid)
            if (grid, cells) == (self._grids[-1], usual):
                nx, ny = (count * -(-FINE_LOADS // count) for count in self._patches)
                loads = {"patches": {"grid": [nx, ny]}}
                name = f"{name}, {_times((nx, ny))} loads"
                yield self._level(name, self._base | changes | loads, grid)

    def _references(self) -> Iterator[Level | None]:
        for mesh in meshed(self._scene, self._base, self._block(None)):
            level = self._level(mesh.name, self._base | mesh.changes, self._heights)
            yield level
            if mesh.small_slopes_too and level is not None:
                yield self._small_slopes(level)

    def _small_slopes(self, level: Level) -> Level | None:
        """Return a reference with low heights under a small load, on the same mesh."""
        content = flattened(level.content, SMALL)
        if content is None:
            return None
        small = self._level(f"{level.name}, heights × {SMALL:g}", content, self._heights)
        return None if small is None else replace(small, scale=SMALL)

    def _block(self, cells: Any) -> Content:
        block = {key: value for key, value in self._base["block"].items() if key != "cells"}
        return block | {"cells": list(cells)} if cells else block

    def _level(
        self, name: str, content: Content, heights: Grid, *, slopes: bool = False
    ) -> Level | None:
        """Return a level; None when the scene does not allow it."""
        if heights != self._heights:
            content = content | {"surface": content["surface"] | {"grid": list(heights)}}
        try:
            scene = Scene.from_dict(content)
            cost = predicted_cost(make_stage(scene), self._machine).total
        except (InputError, NotConverged):
            return None
        kind = scene.coupling.kind
        return Level(
            name=name,
            kind=kind,
            content=content_of(scene),
            heights=heights,
            cost=cost,
            slopes=slopes,
            ranks=1 if kind == "analytic" else self._ranks,
        )

    @property
    def _cells(self) -> tuple[int, int, int]:
        """Elements of a block that carries laws itself; a decomposed one's are for less."""
        stated = self._scene.block.cells
        if self._scene.coupling.decomposed or not isinstance(stated, tuple):
            return EMBEDDED_CELLS
        return stated

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
