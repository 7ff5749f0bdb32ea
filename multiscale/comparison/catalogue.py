"""The configurations of a scene: all sensible ways to compute it.

They range from the micro model alone to the meshed roughness. All of them have the same surface
with its true heights, and the same load history. Load steps are never halved
(``load.force_change``), so that curves can be compared step by step. Couplings without laws sum
their results over the patches that pressures are compared on (`pressure_grid`).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from geometry.meshes.families import suggested_fine
from micro import MODELS
from multiscale.comparison.configuration import OWN, Configuration
from multiscale.comparison.scene_content import (
    LOW_HEIGHTS,
    LOW_HEIGHTS_SCALE,
    Content,
    Grid,
    coarser_grids,
    content_of,
    name_of,
    pressure_grid,
    scaled,
)
from multiscale.couplings.coupling import Coupling
from multiscale.inputs.block import LAW_BLOCK_CELLS, block_section
from multiscale.inputs.loads import load_history_on, patch_grid
from multiscale.inputs.memory import MemoryLacking
from multiscale.inputs.surfaces import make_surface
from multiscale.scene.scene import Scene
from multiscale.setup import make_setup
from support.errors import InputError, NotConverged

LAW_HEIGHTS = 128
"""Heights along a side, at most, of half-spaces behind laws of several numbers of patches."""

PATCHES = (1, 2, 4, 8, 16)
"""Patches along a side, of couplings by laws."""

CELLS_PER_PATCH = 2
"""Elements along a patch, at least, of blocks whose mesh carries the laws."""

REFERENCE_MESHES = ((1, 2.0), (1, 1.0), (2, 1.0), (3, 1.0), (3, 0.5**0.5))
"""Numbers of meshes of references, and their edges relative to those that fit the contacts."""

_HALF_SPACE: Content = {"model": "half-space"}


def configurations(scene: Scene, ranks: int = 1) -> tuple[Configuration, ...]:
    """Return the configurations of a scene, those of the least work first.

    Args:
        scene: The scene, without auto values.
        ranks: Number of processes of configurations that can use more than one.

    Raises:
        InputError: When the surface cannot be read.
    """
    found: dict[str, Configuration] = {}
    setups: dict[str, Coupling] = {}
    # The scene itself comes first: an equal configuration does not replace its name.
    for proposal in _Catalogue(scene).proposals():
        one = _allowed(proposal, setups)
        if one is not None:
            one = replace(one, ranks=1 if one.kind == "analytic" else ranks)
            found.setdefault(one.key, one)
    return tuple(sorted(found.values(), key=lambda one: one.cost))


def _allowed(proposal: Configuration, setups: dict[str, Coupling]) -> Configuration | None:
    """Return a configuration with all its keys and its cost; None when its scene is refused.

    A reference that does not fit into the memory stays, with the reason.

    Args:
        proposal: The configuration without its cost.
        setups: A problem that was set up for each surface so far, to which others are added.
    """
    cost, refusal, surface = float("inf"), "", json.dumps(proposal.content["surface"])
    try:
        setup = make_setup(proposal.scene, like=setups.get(surface))
        cost = setup.work().computing
        setups.setdefault(surface, setup)
    except (InputError, NotConverged) as error:
        if proposal.kind != "reference" or not isinstance(error, MemoryLacking):
            return None
        refusal = str(error)
    return replace(proposal, content=content_of(proposal.scene), cost=cost, refusal=refusal)


class _Catalogue:
    """Proposes the configurations of one scene, whose costs are not known yet.

    All of them have the content `_base`, apart from what a proposal changes.
    """

    def __init__(self, scene: Scene) -> None:
        content, self._scene, self._patches = content_of(scene), scene, patch_grid(scene)
        # Every key of a configuration is stated, so that no accuracy chooses one.
        self._accuracy, self._own_micro = content.pop("accuracy", None), content["micro"]
        content["micro"] = scene.micro.model_dump(mode="json", exclude_none=True)
        # Only laws need a mesh of the block.
        content["block"].pop("cells", None)
        cells = block_section(scene).cells
        stated = cells if isinstance(cells, tuple) else None
        self._own_cells = stated if scene.on_mesh else None
        self._cells = stated or LAW_BLOCK_CELLS
        self._base = content | {"patches": {"grid": list(pressure_grid(scene))}}
        nx, ny = content["surface"].get("grid") or make_surface(scene).grid
        self._grids = coarser_grids((nx, ny), scene)
        fitting = [grid for grid in self._grids if max(grid) <= LAW_HEIGHTS]
        self._law_grid = fitting[-1] if fitting else self._grids[0]

    def proposals(self) -> Iterator[Configuration]:
        """Yield all proposals, the scene itself first."""
        own: dict[str, Any] = {"patches": self._patches, "cells": self._own_cells}
        open_or_stated = {"accuracy": self._accuracy, "micro": self._own_micro}
        made = self._proposal(self._base["coupling"], **open_or_stated, **own)
        yield replace(made, name=f"{OWN}: {made.name}")
        for model in MODELS:
            yield self._proposal({"kind": "analytic"}, {"model": model})
        for kind in ("analytic", "concurrent"):
            yield from self._half_spaces({"kind": kind})
        yield from self._laws()
        yield from self._references()

    def _proposal(
        self,
        coupling: Content,
        micro: Content | None = None,
        *,
        heights: Grid | None = None,
        patches: Grid | None = None,
        cells: Sequence[int] | None = None,
        **sections: Any,
    ) -> Configuration:
        """Return a proposal that changes grids and whole sections."""
        content = self._base | {"coupling": coupling} | sections
        content["surface"] = content["surface"] | {"grid": list(heights or self._grids[-1])}
        if micro is not None:
            content["micro"] = micro
        if patches is not None:
            content["patches"] = {"grid": list(patches)}
        if cells is not None:
            content["block"] = content["block"] | {"cells": list(cells)}
        return Configuration(name=name_of(content), content=content)

    def _half_spaces(self, coupling: Content, **grids: Grid) -> Iterator[Configuration]:
        """Yield half-spaces on every grid, and one of them without finite slopes."""
        for heights in self._grids:
            yield self._proposal(coupling, _HALF_SPACE, heights=heights, **grids)
        small = _HALF_SPACE | {"finite_slopes": False}
        yield self._proposal(coupling, small, heights=self._law_grid, **grids)

    def _laws(self) -> Iterator[Configuration]:
        """Yield couplings by laws, from asperities and from half-spaces."""
        own, cells, micro = self._patches, self._cells, self._base["micro"]
        isolated = {"kind": "isolated", "love": self._scene.coupling.love}
        consistent = {"kind": "consistent", "compliance": "decomposed"}
        if micro["model"] != "half-space":
            yield self._proposal(consistent, micro, patches=own)
        else:
            micro = {"model": "elliptic"}
        half = tuple(max(1, count // 2) for count in cells)
        grids = {(count, count) for count in PATCHES if count <= min(self._grids[-1])} | {own}
        for patches, mesh in (*((patches, cells) for patches in grids), (own, half)):
            if _carries(mesh, patches):
                yield self._proposal(isolated, micro, patches=patches, cells=mesh)
        half_space = partial(self._proposal, micro=_HALF_SPACE, heights=self._law_grid)
        for patches in grids:
            yield half_space(consistent, patches=patches)
        yield from self._half_spaces(consistent, patches=own)
        yield half_space(isolated, patches=own, cells=cells)
        if _carries(cells, own):
            meshed = consistent | {"compliance": "finite-element"}
            yield half_space(meshed, patches=own, cells=cells)

    def _references(self) -> Iterator[Configuration]:
        """Yield references, the one with edges that fit the contacts also with low heights."""
        fine, section = self._fine, self._base["reference"]
        for meshes, factor in REFERENCE_MESHES if fine else ((1, 1.0), (2, 1.0), (3, 1.0)):
            section = section | {"meshes": meshes}
            if fine:
                section["fine"] = float(f"{factor * fine:.4g}")
            made = self._proposal({"kind": "reference"}, reference=section)
            yield made
            if fine and (meshes, factor) == (1, 1.0) and self._scene.surface.spectrum:
                low, name = scaled(made.content), made.name + LOW_HEIGHTS
                yield replace(made, name=name, content=low, scale=LOW_HEIGHTS_SCALE)

    @property
    def _fine(self) -> float | None:
        """Edges of tetrahedra that fit the contacts; None where they are not known."""
        section, loads = self._scene.reference, self._scene.loading
        if section.hexahedral or section.fine:
            return section.fine
        if loads.approach is None or loads.tilt == "free":
            return None
        surface = make_surface(self._scene)
        largest = load_history_on(self._scene, (surface,)).largest
        return suggested_fine(surface, largest, tilt=loads.tilt)


def _carries(cells: tuple[int, ...], patches: Grid) -> bool:
    """Tell whether enough elements lie under every patch."""
    return all(c >= CELLS_PER_PATCH * n for c, n in zip(cells[:2], patches, strict=True))
