"""The configurations of a scene: all sensible ways to compute it.

They range from the micro model alone to the meshed roughness. All of them have the same surface
with its true heights, and the same load history. Load steps are never halved
(``load.force_change``), so that curves can be compared step by step. Couplings without laws sum
their results over the patches that pressures are compared on (`pressure_grid`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from geometry.errors import InputError, NotConverged
from geometry.meshes.families import suggested_fine
from micro import MODEL_NAMES
from multiscale.comparison.configuration import (
    LOW_HEIGHTS_SCALE,
    OWN,
    Configuration,
    Content,
    Grid,
    coarser_grids,
    content_of,
    pressure_grid,
    scaled,
)
from multiscale.planning.costs import Machine, predicted_cost
from multiscale.planning.problem_setup import make_setup
from multiscale.scene.scene import Scene
from multiscale.setup.checks import LAW_BLOCK_CELLS, patch_grid
from multiscale.setup.surface import make_surface

SMALL_SLOPES = ", small slopes"
"""End of the name of a configuration that differs from another by neglecting finite slopes."""

LOW_HEIGHTS = f", heights × {LOW_HEIGHTS_SCALE:g}"
"""End of the name of that reference; the rest is the name of the one with true heights."""

LAW_HEIGHTS = 128
"""Heights along a side, at most, of half-spaces behind laws of several numbers of patches."""

PATCHES = (1, 2, 4, 8, 16)
"""Patches along a side, of couplings by laws."""

CELLS_PER_PATCH = 2
"""Elements along a patch, at least, of blocks whose mesh carries the laws."""

REFERENCE_MESHES = ((1, 2.0), (1, 1.0), (2, 1.0), (3, 1.0), (3, 0.5**0.5))
"""Numbers of meshes of references, and their edges relative to those that fit the contacts."""

_HALF_SPACE: Content = {"model": "half-space"}
_FITTED: Content = {"model": "elliptic", "curvature": "contact", "border": "include"}


class Proposal(NamedTuple):
    """A configuration that the scene need not allow.

    Attributes:
        name: Its name.
        changes: The sections of the scene that it changes.
        heights: Grid of its surface.
        repeat_low: Whether to repeat it with low heights under a low load.
    """

    name: str
    changes: Content
    heights: Grid
    repeat_low: bool = False


def configurations(scene: Scene, ranks: int = 1) -> tuple[Configuration, ...]:
    """Return the configurations of a scene, those of the least predicted cost first.

    Args:
        scene: The scene; only its key ``micro.model`` may be ``auto``.
        ranks: Number of processes of configurations that can use more than one.

    Raises:
        InputError: When the surface cannot be read.
    """
    catalogue, machine = _Catalogue(scene), Machine()
    found: dict[str, Configuration] = {}

    def add(name: str, content: Content, heights: Grid, scale: float = 1.0) -> Content | None:
        """Add a configuration unless the scene does not allow it; return its complete content.

        A reference that does not fit into the memory is added with the reason.
        """
        if heights != catalogue.heights:
            content = content | {"surface": content["surface"] | {"grid": list(heights)}}
        cost, refusal, kind = float("inf"), "", content["coupling"]["kind"]
        try:
            one = Scene.from_dict(content)
            cost = predicted_cost(make_setup(one), machine).total
        except (InputError, NotConverged) as error:
            if kind != "reference" or "GB of memory" not in str(error):
                return None
            refusal = str(error)
        made = Configuration(
            name=name,
            content=content_of(one),
            heights=heights,
            cost=cost,
            ranks=1 if kind == "analytic" else ranks,
            scale=scale,
            refusal=refusal,
        )
        found.setdefault(made.key, made)
        return made.content

    # The scene itself comes first: an equal configuration does not replace its name.
    for one in catalogue.proposals():
        content = add(one.name, catalogue.base | one.changes, one.heights)
        if one.repeat_low and content is not None:
            low = scaled(content)
            if low is not None:
                add(one.name + LOW_HEIGHTS, low, one.heights, LOW_HEIGHTS_SCALE)
    return tuple(sorted(found.values(), key=lambda one: one.cost))


class _Catalogue:
    """Proposes the configurations of one scene.

    Attributes:
        base: What all configurations have in common.
        heights: Grid of the surface.
    """

    def __init__(self, scene: Scene) -> None:
        content = content_of(scene)
        # Every key of a configuration is stated, so that no accuracy chooses one.
        self._given = {"accuracy": content.pop("accuracy", None), "block": content["block"]}
        self._scene, self._patches, stated = scene, patch_grid(scene), scene.surface.grid
        self.heights: Grid = stated if isinstance(stated, tuple) else make_surface(scene).grid
        self._grids = coarser_grids(self.heights, scene)
        fitting = [grid for grid in self._grids if max(grid) <= LAW_HEIGHTS]
        self._law_grid = fitting[-1] if fitting else self._grids[0]
        block = {key: value for key, value in content["block"].items() if key != "cells"}
        patches = {"grid": list(pressure_grid(scene))}
        self.base: Content = content | {"patches": patches, "block": block}

    def proposals(self) -> Iterator[Proposal]:
        """Yield all proposals, the scene itself first."""
        yield self._own()
        micros: dict[str, Content] = {name: {"model": name} for name in MODEL_NAMES}
        del micros["half-space"]
        for name, micro in (micros | {"elliptic, fitted": _FITTED}).items():
            changes = {"coupling": {"kind": "analytic"}, "micro": micro}
            yield Proposal(f"analytic, {name}", changes, self.heights)
        for kind in ("analytic", "concurrent"):
            yield from self._half_spaces(kind, {"coupling": {"kind": kind}})
        yield from self._isolated()
        yield from self._consistent()
        yield from self._references()

    def _own(self) -> Proposal:
        kind: str = self._scene.coupling.kind
        parts = [kind]
        if kind not in ("analytic", "reference"):
            parts.append(f"{_times(self._patches)} patches")
        if kind != "reference":
            parts.append(self._scene.micro.model)
        changes = {name: value for name, value in self._given.items() if value is not None}
        changes["patches"] = {"grid": list(self._patches)}
        return Proposal(f"{OWN}: {', '.join(parts)}", changes, self.heights)

    def _half_spaces(self, name: str, changes: Content) -> Iterator[Proposal]:
        """Yield half-spaces on every grid, and one of them without finite slopes."""
        for grid in self._grids:
            full = f"{name}, half-space {_times(grid)}"
            yield Proposal(full, changes | {"micro": _HALF_SPACE}, grid)
            if grid == self._law_grid:
                small = changes | {"micro": _HALF_SPACE | {"finite_slopes": False}}
                yield Proposal(full + SMALL_SLOPES, small, grid)

    def _isolated(self) -> Iterator[Proposal]:
        micro = self.base["micro"]
        if micro["model"] in ("half-space", "auto"):
            micro = {"model": "elliptic"}
        coupling = {"kind": "isolated", "love": self._scene.coupling.love}
        half = tuple(max(1, count // 2) for count in self._cells)
        for grid, cells in (
            *((grid, self._cells) for grid in self._patch_grids),
            (self._patches, half),
        ):
            if _carries(cells, grid):
                yield self._by_laws(coupling, micro, grid, cells)
        yield self._by_laws(coupling, _HALF_SPACE, self._patches, self._cells)

    def _consistent(self) -> Iterator[Proposal]:
        own, micro = self._patches, self.base["micro"]
        coupling = {"kind": "consistent", "compliance": "decomposed"}
        for grid in self._patch_grids:
            yield self._by_laws(coupling, _HALF_SPACE, grid)
        changes = {"coupling": coupling, "patches": {"grid": list(own)}}
        yield from self._half_spaces(f"consistent, {_times(own)} patches", changes)
        if micro["model"] not in ("half-space", "auto"):
            yield self._by_laws(coupling, micro, own)
        if _carries(self._cells, own):
            meshed = {"kind": "consistent", "compliance": "finite-element"}
            yield self._by_laws(meshed, _HALF_SPACE, own, self._cells)

    def _by_laws(
        self, coupling: Content, micro: Content, patches: Grid, cells: tuple[int, ...] = ()
    ) -> Proposal:
        """Return a coupling by laws; with cells, on a mesh that carries them."""
        heights, model = self.heights, micro["model"]
        if model == "half-space":
            heights = self._law_grid
            model += f" {_times(heights)}"
        name = f"{coupling['kind']}, {_times(patches)} patches, {model}"
        changes = {"coupling": coupling, "micro": micro, "patches": {"grid": list(patches)}}
        if cells:
            name += f", {_times(cells)} elements"
            changes["block"] = self.base["block"] | {"cells": list(cells)}
        return Proposal(name, changes, heights)

    def _references(self) -> Iterator[Proposal]:
        """Yield references; edges are those that fit the contacts, where these are known."""
        section, scene, fine = self.base["reference"], self._scene, None
        if not scene.reference.hexahedral:
            fine, load_history = section.get("fine"), scene.loading.load_history
            if not fine and load_history.quantity == "approach" and load_history.tilt is not None:
                surface = make_surface(scene)
                fine = suggested_fine(surface, load_history.largest, tilt=load_history.tilt)
        for meshes, factor in REFERENCE_MESHES if fine else ((1, 1.0), (2, 1.0), (3, 1.0)):
            section = section | {"meshes": meshes}
            name = f"reference, {meshes} mesh{'es' * (meshes > 1)}"
            if fine:
                section["fine"] = float(f"{factor * fine:.4g}")
                name += f", {1e3 * section['fine']:.3g} µm"
            changes = {"coupling": {"kind": "reference"}, "reference": section}
            repeat_low = bool(fine) and (meshes, factor) == (1, 1.0)
            yield Proposal(name, changes, self.heights, repeat_low)

    @property
    def _cells(self) -> tuple[int, int, int]:
        """Elements of a block whose mesh carries the laws."""
        stated = self._scene.block.cells
        return stated if isinstance(stated, tuple) else LAW_BLOCK_CELLS

    @property
    def _patch_grids(self) -> list[Grid]:
        fitting = {(count, count) for count in PATCHES if count <= min(self.heights)}
        return sorted(fitting | {self._patches})


def _carries(cells: tuple[int, ...], patches: Grid) -> bool:
    """Tell whether enough elements lie under every patch."""
    return all(c >= CELLS_PER_PATCH * n for c, n in zip(cells[:2], patches, strict=True))


def _times(counts: tuple[int, ...]) -> str:
    return " × ".join(map(str, counts))
