"""A scene's cheap ingredients: surface, summits, patches, micro model, block shape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.asperities import Asperities
from geometry.meshes.block import BlockShape
from geometry.patches import PatchGrid
from geometry.rigid_plane import RigidPlane
from geometry.surface import Surface
from micro import AsperityModel, Choice, HalfSpaceModel, MicroModel, ScaledModel
from multiscale.laws.refinement import MOST_ROWS
from multiscale.scene.scene import Scene
from multiscale.setup.contact_estimate import largest_local_approach
from multiscale.setup.decision import Decision
from multiscale.setup.reference_meshes import ReferenceMeshes

Array = NDArray[np.float64]

CLOSURE_RESERVE = 0.15
"""Closure beyond the largest approach that laws are made for, relative to the deepest overlap."""


@dataclass(frozen=True, kw_only=True)
class ProblemSetup:
    """Everything that is known before laws and finite elements are made.

    Attributes:
        scene: The scene, what it left open settled but for ``micro.model``.
        surface: Its rough surface.
        asperities: The surface's summits.
        micro: Micro model of the whole surface; None in a reference, which has none.
        patches: Partition of the interface.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        shape: The block's shape and mesh.
        plane_at_largest_load: Largest approach at the middle of the interface [mm] and the plane's
        slopes
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
    plane_at_largest_load: tuple[float, tuple[float, float]]
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
    def finite_slopes(self) -> bool:
        """Whether the micro model sees that slopes are finite."""
        stated = self.scene.micro.finite_slopes
        able = self.scene.coupling.kind != "isolated" and isinstance(self.micro, HalfSpaceModel)
        return able if stated is None else stated and able

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

        By default 1e-4, and 5e-4 for models that see cells, whose steps finer tables would trace.
        """
        return self.scene.coupling.table_tolerance or (1e-4 if self.by_summits else 5e-4)

    @property
    def table_rows(self) -> int:
        """Rows that laws may take to get there; models that see cells pay for each."""
        return 400 if self.by_summits else MOST_ROWS

    @property
    def largest_local_approach(self) -> float:
        """How near the plane at the largest load comes anywhere [mm]."""
        return largest_local_approach(self.plane_at_largest_load, self.surface)

    @cached_property
    def largest_interference(self) -> float:
        """Deepest overlap of plane and undeformed surface at the largest load [mm].

        A level plane overlaps by its approach; the approach at the middle of a tilted one may be
        negative though its lower side touches.
        """
        overlap = self._overlap(*self._cells)
        return max(self.plane_at_largest_load[0], float(overlap.max()))

    @property
    def closure_ends(self) -> Array:
        """Largest closure that each patch's law is made for, shape (N,) [mm].

        It is the largest approach there, and a reserve: the surface of a bent block may rise
        between its loads, and a free plane may turn further than on a half-space. Laws that hold
        at points see the approach at the patch's corners; so does a level patch alone that has to
        carry a force, for under the tilted plane its contacts may lie at a corner.
        """
        approach, tilt = self.plane_at_largest_load
        ends = RigidPlane.above(self.patches, approach, tilt).means(self.patches)
        coupling, loading = self.scene.coupling, self.scene.loading
        alone_by_force = coupling.kind == "isolated" and loading.force is not None
        if coupling.interface == "pointwise" or alone_by_force:
            ends = ends + 0.5 * float(np.abs(np.multiply(self.patches.size, tilt)).sum())
        if loading.tilt == "free":
            ends = ends + (ends.max() - approach)
        return ends + CLOSURE_RESERVE * self.largest_interference

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
        approach, tilt = self.plane_at_largest_load
        from_centre = np.column_stack((x, y)) - 0.5 * np.asarray(self.surface.lengths)
        return np.asarray(approach + from_centre @ np.asarray(tilt) - (self.surface.highest - z))
