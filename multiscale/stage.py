"""Turns a scene into its cheap ingredients: surface, summits, patches, micro model, block shape."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.asperities import Asperities, find_asperities
from geometry.errors import InputError
from geometry.files import read_surface
from geometry.meshes import BlockShape
from geometry.patches import PatchGrid, patch_means
from geometry.spectrum import synthesise
from geometry.surface import Surface
from micro import MODELS, MicroModel, contact_modulus, micro_model
from multiscale.coupling import AnalyticCoupling, tilted_approaches
from multiscale.loading import Programme
from multiscale.scene import Scene

BYTES_PER_HEIGHT = 100
"""Memory that surface, spline and spectrum take per height, roughly [B]."""

BYTES_PER_CELL = 5000
"""Memory that mesh, stiffness and multigrid take per cell, roughly [B]."""

CLOSURE_RESERVE = 0.15
"""Closure beyond the largest approach that laws are made for, relative to load.approach."""

EMBEDDED_CELLS = (40, 40, 25)
"""Cells of a block that carries the laws itself: those of Waddad et al. 2016."""

DECOMPOSED_CELLS = (16, 16, 8)
"""Cells of a block that only corrects the half-space."""

_DETREND_ORDER = {"mean": 0, "plane": 1, "quadratic": 2}


@dataclass(frozen=True, kw_only=True)
class Stage:
    """Everything that is known before laws and finite elements are made.

    Attributes:
        scene: The scene.
        surface: Its rough surface.
        asperities: The surface's summits.
        model: Micro model of the whole surface.
        patches: Partition of the interface.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        shape: The block's shape and mesh.
        furthest: Largest approach at the middle of the interface [mm] and the plane's slopes
            there; where force or moment are prescribed, those of the surface on a half-space.
    """

    scene: Scene
    surface: Surface
    asperities: Asperities
    model: MicroModel
    patches: PatchGrid
    mean_heights: NDArray[np.float64]
    shape: BlockShape
    furthest: tuple[float, tuple[float, float]]

    @property
    def embedded(self) -> bool:
        """Whether a block takes part."""
        return self.scene.coupling.kind != "analytic"

    @property
    def by_laws(self) -> bool:
        """Whether the patches get laws."""
        return self.scene.coupling.kind in ("isolated", "consistent")

    @property
    def by_summits(self) -> bool:
        """Whether the micro model sees summits rather than the whole surface."""
        return self.scene.micro.model in MODELS

    @property
    def table_tolerance(self) -> float:
        """Interpolation error that laws are tabulated to.

        By default 1e-4, and 1e-3 for models that see cells, whose steps finer tables would trace.
        """
        return self.scene.coupling.table_tolerance or (1e-4 if self.by_summits else 1e-3)

    @property
    def closure_ends(self) -> NDArray[np.float64]:
        """Largest closure that each patch's law is made for, shape (N,) [mm].

        It is the largest approach there, and a reserve: the surface of a bent block may rise
        between its loads, and a free plane may turn further than on a half-space. Laws that hold
        at points see the approach at the patch's corners.
        """
        approach, tilt = self.furthest
        ends = tilted_approaches(self.patches, approach, tilt)
        if self.scene.coupling.interface == "pointwise":
            ends = ends + 0.5 * float(np.abs(np.multiply(self.patches.size, tilt)).sum())
        if self.scene.loading.tilt == "free":
            ends = ends + 0.5 * (ends.max() - approach)
        return ends + CLOSURE_RESERVE * approach

    @property
    def approach_end(self) -> float:
        """Largest local approach that laws of the whole surface are made for [mm].

        Under a patch that is closed further than its neighbours, or on a block that is stiffer
        than the half-space, the law's own surface moves away under more load than is there; the
        laws go further by what all of its displacement is worth.
        """
        end = float(self.closure_ends.max())
        response = self.model.respond([end], patches=self.patches, mean_heights=self.mean_heights)
        return end + float(response.patch_displacement.mean())

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Which summits lie within the largest approach, shape (n,)."""
        return self._within(self.asperities.x, self.asperities.y, self.asperities.z)

    @property
    def reached_at_border(self) -> int:
        """Number of the border's maxima within the largest approach."""
        cut = self.asperities
        return int(np.sum(self._within(cut.border_x, cut.border_y, cut.border_z)))

    @property
    def reached_cells(self) -> NDArray[np.bool_]:
        """Which cells of the surface lie within the largest approach, shape (nx ny,)."""
        x, y = np.meshgrid(self.surface.x, self.surface.y, indexing="ij")
        return self._within(x.ravel(), y.ravel(), self.surface.heights.ravel())

    @property
    def reached_patches(self) -> int:
        """Number of patches with anything that the largest closure of their laws can touch."""
        x, y = (part.ravel() for part in np.meshgrid(self.surface.x, self.surface.y, indexing="ij"))
        z = self.surface.heights.ravel()
        if self.by_summits and self.scene.micro.border == "ignore":
            x, y, z = self.asperities.x, self.asperities.y, self.asperities.z
        owner = self.patches.index_of(x, y)
        return int(np.unique(owner[self.closure_ends[owner] > self.surface.highest - z]).size)

    def _within(self, x: NDArray, y: NDArray, z: NDArray) -> NDArray[np.bool_]:
        approach, tilt = self.furthest
        from_centre = np.column_stack((x, y)) - 0.5 * np.asarray(self.surface.lengths)
        approach = approach + from_centre @ np.asarray(tilt)
        return np.asarray(approach > self.surface.highest - z)


def make_stage(scene: Scene) -> Stage:
    """Make or read the surface, find its summits and check that everything fits together.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
    """
    _check_size(scene)
    surface = make_surface(scene)
    patches = PatchGrid(grid=scene.patches.grid, lengths=surface.lengths)
    _check_patches(scene, surface)
    block = scene.block
    asperities = find_asperities(surface, periodic=False)  # the block's sides are free
    by_summits = scene.micro.model in MODELS and scene.micro.border == "ignore"
    if by_summits and not len(asperities):
        raise InputError(
            "the surface has no summit that could carry load",
            key="micro.model",
            value=scene.micro.model,
            allowed="half-space, islands",
            file=scene.file,
        )
    shape = _located(scene, "block", lambda: _block_shape(scene, surface))
    model = micro_model(
        scene.micro.model,
        surface,
        contact_modulus=contact_modulus(block.young_modulus, block.poisson_ratio),
        solver=scene.micro.solver,
        curvature=scene.micro.curvature,
        border=scene.micro.border,
    )
    mean_heights = patch_means(surface, patches)
    return Stage(
        scene=scene,
        surface=surface,
        asperities=asperities,
        model=model,
        patches=patches,
        mean_heights=mean_heights,
        shape=shape,
        furthest=_furthest(scene.loading.programme, model, patches, mean_heights),
    )


def _furthest(
    programme: Programme, model: MicroModel, patches: PatchGrid, mean_heights: NDArray[np.float64]
) -> tuple[float, tuple[float, float]]:
    """Return the largest approach and the slopes there, from the half-space where not given."""
    if programme.quantity == "approach" and programme.tilt is not None:
        return programme.largest, programme.tilt
    alone = AnalyticCoupling(model, patches, mean_heights)
    step = alone.press(programme.control(programme.largest))
    return step.approach_mm, step.tilt


def make_surface(scene: Scene) -> Surface:
    """Make or read the surface of a scene.

    Raises:
        InputError: When it cannot be made or read; names file and key.
    """
    section = scene.surface
    extent: dict[str, Any] = {"grid": section.grid, "lengths": section.lengths}
    if section.spectrum is not None:
        spectrum = section.spectrum.spectrum()
        surface = _located(scene, "surface.spectrum", lambda: synthesise(spectrum, **extent))
    else:
        path = scene.surface_path or Path()
        surface = _located(scene, "surface.file", lambda: read_surface(path, **extent))
    if section.detrend == "none":
        return surface
    return surface.detrended(_DETREND_ORDER[section.detrend])


def block_cells(scene: Scene) -> tuple[int, int, int]:
    """Return the cells of the block: those asked for, or as many as its part needs.

    Laws on the plain mesh need it fine under every patch; the smooth correction of the half-space
    does not.
    """
    return scene.block.cells or (DECOMPOSED_CELLS if scene.coupling.decomposed else EMBEDDED_CELLS)


def _block_shape(scene: Scene, surface: Surface) -> BlockShape:
    block = scene.block
    return BlockShape(
        interface=surface.lengths,
        height=block.height,
        cells=block_cells(scene),
        element=block.element,
        grading=block.grading,
        margin=block.margin,
        margin_cells=block.margin_cells if block.margin else 0,
        margin_grading=block.margin_grading if block.margin else 1.0,
    )


def _check_size(scene: Scene) -> None:
    """Refuse what could never fit into this machine's memory, before anything is allocated."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    sizes: list[tuple[str, Sequence[int] | None, int]] = [
        ("surface.grid", scene.surface.grid, BYTES_PER_HEIGHT),
        ("patches.grid", scene.patches.grid, BYTES_PER_HEIGHT),
    ]
    if scene.coupling.kind != "analytic":
        sizes.append(("block.cells", block_cells(scene), BYTES_PER_CELL))
    for key, counts, each in sizes:
        if counts is not None and math.prod(counts) * each > memory:
            raise InputError(
                f"needs about {math.prod(counts) * each / 1e9:.3g} GB of memory",
                key=key,
                value=list(counts),
                allowed=f"what fits into {memory / 1e9:.3g} GB",
                file=scene.file,
            )


def _check_patches(scene: Scene, surface: Surface) -> None:
    """Refuse patches that no element or no height can resolve."""
    limits: list[tuple[str, Sequence[int]]] = [("heights of the surface", surface.grid)]
    alone = scene.coupling.kind == "isolated"
    # it cuts patches out, and a surface has at least 4 × 4 heights
    if alone and scene.micro.model == "islands":
        fourths = (surface.grid[0] // 4, surface.grid[1] // 4)
        limits = [("fourths of the surface's heights", fourths)]
    on_mesh = not scene.coupling.decomposed or scene.output.fields
    if scene.coupling.kind != "analytic" and on_mesh:
        limits.append(("cells of the interface (block.cells)", block_cells(scene)[:2]))
    for what, limit in limits:
        if any(patches > most for patches, most in zip(scene.patches.grid, limit, strict=True)):
            raise InputError(
                f"more patches than {what}",
                key="patches.grid",
                value=list(scene.patches.grid),
                allowed=f"at most {list(limit)}",
                file=scene.file,
            )


def _located(scene: Scene, key: str, make: Callable[[], Any]) -> Any:
    """Make something; an error gets the scene's file and the key."""
    try:
        return make()
    except InputError as error:
        raise error.located(key=key, file=scene.file) from None
