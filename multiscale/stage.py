"""Turns a scene into its cheap ingredients: surface, summits, patches, micro model, block shape."""

from __future__ import annotations

from collections.abc import Callable
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
from geometry.smooth_shape import smooth_shape
from geometry.spectrum import synthesise
from geometry.surface import Surface
from micro import MODELS, MicroModel, contact_modulus, micro_model
from multiscale.coupling import AnalyticCoupling, tilted_approaches
from multiscale.loading import Programme
from multiscale.refinement import MOST_ROWS
from multiscale.scene import Scene
from multiscale.stage_checks import block_cells, check_patches, check_size

CLOSURE_RESERVE = 0.15
"""Closure beyond the largest approach that laws are made for, relative to load.approach."""

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
    def table_rows(self) -> int:
        """Rows that laws may take to get there; models that see cells pay for each."""
        return 400 if self.by_summits else MOST_ROWS

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
        """Largest approach at the middle that laws of the whole surface are made for [mm].

        Under a patch that is closed further than its neighbours, or on a block that is stiffer
        than the half-space, the law's own surface moves away under more load than is there; the
        laws go further by what all of its displacement is worth.
        """
        tilt = self.furthest[1]
        end = float(np.max(self.closure_ends - tilted_approaches(self.patches, 0.0, tilt)))
        response = self.model.respond(
            [end], patches=self.patches, mean_heights=self.mean_heights, tilt=tilt
        )
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
    check_size(scene)
    surface = make_surface(scene)
    patches = PatchGrid(grid=scene.patches.grid, lengths=surface.lengths)
    check_patches(scene, surface)
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


def _block_shape(scene: Scene, surface: Surface) -> BlockShape:
    block = scene.block
    shape = BlockShape(
        interface=surface.lengths,
        height=block.height,
        cells=block_cells(scene),
        element=block.element,
        grading=block.grading,
        margin=block.margin,
        margin_cells=block.margin_cells if block.margin else 0,
        margin_grading=block.margin_grading if block.margin else 1.0,
    )
    if scene.coupling.kind != "analytic" and scene.coupling.decomposed:
        _located(scene, "block.cells", lambda: smooth_shape(shape))
    return shape


def _located(scene: Scene, key: str, make: Callable[[], Any]) -> Any:
    """Make something; an error gets the scene's file and the key."""
    try:
        return make()
    except InputError as error:
        raise error.located(key=key, file=scene.file) from None
