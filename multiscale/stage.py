"""Turns a scene into its cheap ingredients: surface, summits, patches, micro model, block shape."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.asperities import Asperities, find_asperities
from geometry.errors import InputError
from geometry.meshes import BlockShape
from geometry.patches import PatchGrid, patch_means
from geometry.surface import Surface
from micro import MODELS, AsperityModel, Choice, MicroModel, ScaledModel
from multiscale.coupling import tilted_approaches
from multiscale.ingredients import make_shape, make_surface
from multiscale.law_tables.refinement import MOST_ROWS
from multiscale.planning.choices import SETTLED_LATE, cheapest, open_keys, provisional, with_settled
from multiscale.planning.contact_estimate import Contacts, contacts
from multiscale.planning.decision import Decision
from multiscale.planning.micro_choice import (
    chosen_model,
    estimated_plane,
    furthest_plane,
    nearest,
    stated_model,
)
from multiscale.planning.surface_choice import chosen_surface, micro_tolerance
from multiscale.reference.meshes import ReferenceMeshes, reference_meshes
from multiscale.scene import Scene
from multiscale.stage_checks import check_load, check_patches, check_size, patch_grid

Array = NDArray[np.float64]

CLOSURE_RESERVE = 0.15
"""Closure beyond the largest approach that laws are made for, relative to the deepest overlap."""


@dataclass(frozen=True, kw_only=True)
class Stage:
    """Everything that is known before laws and finite elements are made.

    Attributes:
        scene: The scene, what it left open settled but for ``micro.model``.
        surface: Its rough surface.
        asperities: The surface's summits.
        micro: Micro model of the whole surface; None in a reference, which has none.
        patches: Partition of the interface.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        shape: The block's shape and mesh.
        furthest: Largest approach at the middle of the interface [mm] and the plane's slopes
            there; where force or moment are prescribed, those of the surface on a half-space.
        choice: Why this micro model, where the scene leaves it open.
        meshes: The meshes of a reference; None with other couplings.
        decision: Why this coupling, these patches and cells, where the scene leaves them open.
        seconds: Wall time of making the surface and of choosing the micro model [s].
    """

    scene: Scene
    surface: Surface
    asperities: Asperities
    micro: MicroModel | None
    patches: PatchGrid
    mean_heights: Array
    shape: BlockShape
    furthest: tuple[float, tuple[float, float]]
    choice: Choice | None = None
    meshes: ReferenceMeshes | None = None
    decision: Decision | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def model(self) -> MicroModel:
        """Micro model of the whole surface.

        Raises:
            ValueError: In a reference, which has none.
        """
        if self.micro is None:
            raise ValueError("a reference has no micro model")
        return self.micro

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
        return isinstance(self.micro, AsperityModel | ScaledModel)

    @property
    def ignores_border(self) -> bool:
        """Whether maxima on the surface's border carry no load in the micro model."""
        model = self.micro
        return self.by_summits and not (
            isinstance(model, ScaledModel) and model.border == "include"
        )

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
    def nearest(self) -> float:
        """How near the plane at the largest load comes anywhere [mm]."""
        return nearest(self.furthest, self.surface)

    @cached_property
    def contacts(self) -> Contacts:
        """What is known of the contacts before; solves a half-space of few cells once."""
        return contacts(self.surface, self.model.contact_modulus, self.furthest)

    @cached_property
    def deepest(self) -> float:
        """Deepest overlap of plane and undeformed surface at the largest load [mm].

        A level plane overlaps by its approach; the approach at the middle of a tilted one may be
        negative though its lower side touches.
        """
        overlap = self._overlap(*self._cells)
        return max(self.furthest[0], float(overlap.max()))

    @property
    def closure_ends(self) -> Array:
        """Largest closure that each patch's law is made for, shape (N,) [mm].

        It is the largest approach there, and a reserve: the surface of a bent block may rise
        between its loads, and a free plane may turn further than on a half-space. Laws that hold
        at points see the approach at the patch's corners; so does a level patch alone that has to
        carry a force, for under the tilted plane its contacts may lie at a corner.
        """
        approach, tilt = self.furthest
        ends = tilted_approaches(self.patches, approach, tilt)
        coupling, loading = self.scene.coupling, self.scene.loading
        alone_by_force = coupling.kind == "isolated" and loading.force is not None
        if coupling.interface == "pointwise" or alone_by_force:
            ends = ends + 0.5 * float(np.abs(np.multiply(self.patches.size, tilt)).sum())
        if loading.tilt == "free":
            ends = ends + (ends.max() - approach)
        return ends + CLOSURE_RESERVE * self.deepest

    @cached_property
    def approach_end(self) -> float:
        """Largest approach at the middle that laws of the whole surface are made for [mm].

        Under a patch that is closed further than its neighbours, or on a block that is stiffer
        than the half-space, the law's own surface moves away under more load than is there; the
        laws go further by what all of its displacement is worth. Solves the micro model once.

        Raises:
            NotConverged: When the micro model does not converge.
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
        return self._overlap(self.asperities.x, self.asperities.y, self.asperities.z) > 0.0

    @property
    def reached_at_border(self) -> int:
        """Number of the border's maxima within the largest approach."""
        cut = self.asperities
        return int(np.sum(self._overlap(cut.border_x, cut.border_y, cut.border_z) > 0.0))

    @property
    def reached_cells(self) -> NDArray[np.bool_]:
        """Which cells of the surface lie within the largest approach, shape (nx ny,)."""
        return self._overlap(*self._cells) > 0.0

    @property
    def reached_patches(self) -> int:
        """Number of patches with anything that the largest closure of their laws can touch."""
        summits = self.asperities.x, self.asperities.y, self.asperities.z
        x, y, z = summits if self.ignores_border else self._cells
        owner = self.patches.index_of(x, y)
        return int(np.unique(owner[self.closure_ends[owner] > self.surface.highest - z]).size)

    @property
    def _cells(self) -> tuple[Array, Array, Array]:
        x, y = np.meshgrid(self.surface.x, self.surface.y, indexing="ij")
        return x.ravel(), y.ravel(), self.surface.heights.ravel()

    def _overlap(self, x: Array, y: Array, z: Array) -> Array:
        """Return how far the plane at the largest load lies below points of the surface [mm]."""
        approach, tilt = self.furthest
        from_centre = np.column_stack((x, y)) - 0.5 * np.asarray(self.surface.lengths)
        return np.asarray(approach + from_centre @ np.asarray(tilt) - (self.surface.highest - z))


def make_stage(scene: Scene, settled: Mapping[str, Any] | None = None) -> Stage:
    """Make or read the surface, find its summits, settle what is open, check that all fits.

    Args:
        scene: The scene.
        settled: What open keys became when the run began; see `settled_keys`.

    Raises:
        InputError: When something cannot be made or does not fit; names file, key and value.
    """
    began = time.perf_counter()
    known = settled or {}
    free = open_keys(scene) - set(known)
    start = provisional(with_settled(scene, known), free)
    check_size(start)
    if "surface.grid" in free:
        start, surface = chosen_surface(scene, start)
    else:
        surface = make_surface(start)
    check_patches(start, surface)
    check_load(start, surface)
    patches = PatchGrid(grid=patch_grid(start), lengths=surface.lengths)
    asperities = find_asperities(surface, periodic=False)  # the block's sides are free
    if start.coupling.kind == "reference":
        return _reference_stage(start, surface, patches, asperities, began)
    _check_summits(start, asperities)
    shape = make_shape(start, surface)
    made = time.perf_counter()
    seconds = {"surface": made - began}
    choice, label = None, known.get("micro.model")
    if start.micro.model == "auto":
        choice = chosen_model(
            start, surface, patches, micro_tolerance(scene, start, surface), label
        )
        seconds["micro choice"] = time.perf_counter() - made
    model = choice.model if choice else stated_model(start, surface)
    mean_heights = patch_means(surface, patches)
    stage = Stage(
        scene=start,
        surface=surface,
        asperities=asperities,
        micro=model,
        patches=patches,
        mean_heights=mean_heights,
        shape=shape,
        furthest=furthest_plane(start.loading.programme, model, patches, mean_heights),
        choice=choice,
        seconds=seconds,
    )
    return cheapest(stage, scene, free) if free & SETTLED_LATE else stage


def _check_summits(scene: Scene, asperities: Asperities) -> None:
    by_summits = scene.micro.model in MODELS and scene.micro.border == "ignore"
    if by_summits and not len(asperities):
        raise InputError(
            "the surface has no summit that could carry load",
            key="micro.model",
            value=scene.micro.model,
            allowed="half-space, islands",
            file=scene.file,
        )


def _reference_stage(
    scene: Scene, surface: Surface, patches: PatchGrid, asperities: Asperities, began: float
) -> Stage:
    """Return the ingredients of a reference, which needs no micro model."""
    furthest = estimated_plane(scene, surface)
    return Stage(
        scene=scene,
        surface=surface,
        asperities=asperities,
        micro=None,
        patches=patches,
        mean_heights=patch_means(surface, patches),
        shape=make_shape(scene, surface),
        furthest=furthest,
        meshes=reference_meshes(scene, surface, furthest),
        seconds={"surface": time.perf_counter() - began},
    )
