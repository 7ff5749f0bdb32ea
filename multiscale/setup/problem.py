"""The problem set up from a scene: surface, patches, micro model and shape of the block."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry import (
    Asperities,
    BlockShape,
    MaterialPair,
    PatchGrid,
    Regions,
    RigidPlane,
    Surface,
    find_asperities,
)
from geometry.plausibility import check_finite_slopes
from geometry.zero import Zero
from micro import AsperityModel, HalfSpaceModel, MicroModel
from multiscale.laws.refinement import MOST_ROWS
from multiscale.loading.load_history import LoadHistory
from multiscale.scene.scene import Scene
from multiscale.setup.mesh_bodies import FaceFacts, SceneBodies
from multiscale.setup.reference_meshes import ReferenceMeshes
from multiscale.setup.samples import RegionSamples
from multiscale.setup.surface_and_block import load_history_on, located

Array = NDArray[np.float64]

CLOSURE_RESERVE = 0.15
"""Closure that laws are made for beyond the largest approach, relative to the largest interference.
The surface of a bent block may rise between the loads of its patches."""
_CELLS_TOLERANCE, _SUMMITS_TOLERANCE = 5e-4, 1e-4
"""Interpolation error of laws by default. Finer tables would trace the steps of single cells."""
_SUMMITS_ROWS = 400
"""Most rows of laws by summits. On cells a row costs a solution, which is dear."""


@dataclass(frozen=True, kw_only=True)
class Decision:
    """What was taken, and the errors that were measured for it before the run.

    Attributes:
        accuracy: Relative error of the force that was requested.
        taken: The coupling, and the cells, meshes or micro model that it works on.
        why: Why this coupling was taken; empty where the scene states it or it was missed for.
        errors: Measured errors of the force by cause, relative to it, at the load where they are
            worst; empty where they cannot be measured beforehand. That of laws is among them only
            after the run.
        missed: Errors by cause of what was tried first and could not keep the accuracy, if any.
    """

    accuracy: float
    taken: str
    errors: Mapping[str, float]
    why: str = ""
    missed: Mapping[str, float] = field(default_factory=dict)

    @property
    def error(self) -> float:
        """Measured relative error of the force; 0 where it was not measured."""
        return sum(self.errors.values())

    @property
    def kept(self) -> bool:
        """Whether the measured error is within the accuracy."""
        return bool(self.errors) and self.error <= self.accuracy

    @property
    def sentence(self) -> str:
        """What was taken, why, and what was measured for it."""
        parts = [
            self.taken + f" ({self.why})" * bool(self.why),
            f"an accuracy of {100 * self.accuracy:.3g} % is asked for, {_listed(self.errors)}",
        ]
        if self.missed:
            parts.append(f"without meshing the roughness {_listed(self.missed)}")
        return "; ".join(parts)

    @property
    def warning(self) -> str | None:
        """A warning that the accuracy is not kept; None where it is, or is not known beforehand."""
        if self.kept or not self.errors:
            return None
        largest = max(self.errors, key=lambda cause: self.errors[cause])
        return (
            f"an accuracy of {100 * self.accuracy:.3g} % is not kept: measured at the largest "
            f"load, the force may be off by {100 * self.error:.2g} %, most of it by {largest}"
        )


@dataclass(frozen=True, kw_only=True)
class ProblemSetup:
    """Everything that is known of a scene before laws and finite elements are made.

    Attributes:
        scene: The scene with its auto values resolved.
        surface: Its rough surface, with the heights of both sides where both are rough.
        micro: Micro model of the whole surface; None in a reference, which has none.
        patches: Partition of the interface.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        block_shape: Shape and mesh of the block; None where the body is a mesh of its own.
        materials: The materials on both sides of the interface.
        plane_at_largest_load: The rigid plane at the largest load. Where the force or the moment is
            prescribed, it is the plane in equilibrium on a half-space, or None where nothing
            before the load steps needs it.
        counter_surface: What of the surface is the counter-body's; None where that is smooth.
        face: What is known of the body and its contact face where the surface does not say it: of
            a mesh, and under laws of samples; None otherwise.
        counter_face: The same of a counter-body on a mesh.
        samples: Under laws of samples those of every region; empty otherwise.
        bodies: The bodies on meshes, on every rank; empty without any.
        meshes: The meshes of a reference; None with other couplings.
        decision: Why the auto values became what they are, where measured errors decided.
        seconds: Wall time of each part of setting it up [s].
    """

    scene: Scene
    surface: Surface
    micro: MicroModel | None
    patches: PatchGrid
    mean_heights: Array
    block_shape: BlockShape | None
    materials: MaterialPair
    plane_at_largest_load: RigidPlane | None
    counter_surface: Surface | None = None
    face: FaceFacts | None = None
    counter_face: FaceFacts | None = None
    samples: tuple[RegionSamples, ...] = ()
    bodies: SceneBodies = field(default_factory=SceneBodies)
    meshes: ReferenceMeshes | None = None
    decision: Decision | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.finite_slopes:
            with located(self.scene, "micro.finite_slopes"):
                for surface in self._sloped:
                    check_finite_slopes(surface)

    @property
    def _sloped(self) -> list[Surface]:
        """The rough sides of the bodies, or the samples of laws, whose slopes count."""
        if self.samples:
            return [surface for region in self.samples for surface in region.surfaces]
        if self.counter_surface is None:
            return [self.surface]
        own = replace(self.surface, heights=self.surface.heights - self.counter_surface.heights)
        return [own] if self.materials.second is None else [own, self.counter_surface]

    @cached_property
    def asperities(self) -> Asperities:
        """The surface's summits; found when first needed, which takes seconds on 4096² heights."""
        if isinstance(self.micro, AsperityModel):
            return self.micro.asperities
        return find_asperities(self.surface, periodic=False)  # the block's sides are free

    @property
    def shape(self) -> BlockShape:
        """Shape and mesh of the block.

        Raises:
            ValueError: When the body is a mesh of its own.
        """
        if self.block_shape is None:
            raise ValueError("a body on a mesh of its own has no shape")
        return self.block_shape

    @property
    def regions(self) -> Regions | None:
        """The regions of a face under laws of samples; None with other laws."""
        if not self.samples:
            return None
        return Regions(tuple(region.name for region in self.samples))

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
    def both_give_way(self) -> bool:
        """Whether the counter-body is an elastic half-space."""
        return self.materials.second is not None and self.counter_face is None

    @property
    def has_block(self) -> bool:
        """Whether the surface is on a block instead of a half-space."""
        return self.scene.kind != "analytic"

    @cached_property
    def load_history(self) -> LoadHistory:
        """The load history, counted from first touch."""
        return load_history_on(self.scene, self.rough_surfaces)

    @property
    def rough_surfaces(self) -> tuple[Surface, ...]:
        """The surface, or all samples of all regions."""
        samples = tuple(one for region in self.samples for one in region.surfaces)
        return samples or (self.surface,)

    @property
    def zero(self) -> float:
        """Approach from first touch of the height that approaches are shown from [mm]."""
        return self.load_history.depth

    @cached_property
    def zero_error(self) -> float:
        """Error of that height [mm]."""
        return Zero(self.scene.loading.zero).error(self.surface)

    @property
    def uses_laws(self) -> bool:
        """Whether the load steps use patch laws."""
        return self.scene.kind in ("isolated", "consistent", "representative")

    @property
    def finite_slopes(self) -> bool:
        """Whether the micro model takes finite slopes into account."""
        stated = self.scene.micro.finite_slopes
        able = self.scene.kind != "isolated" and isinstance(self.micro, HalfSpaceModel)
        return able and not self.samples if stated is None else stated and able

    @property
    def uses_summits(self) -> bool:
        """Whether the micro model knows the summits alone and not the whole surface."""
        return isinstance(self.micro, AsperityModel)

    @property
    def table_tolerance(self) -> float:
        """Interpolation error that laws are tabulated to."""
        default = _SUMMITS_TOLERANCE if self.uses_summits else _CELLS_TOLERANCE
        return self.scene.coupling.table_tolerance or default

    @property
    def table_rows(self) -> int:
        """Most rows of a table of laws."""
        return _SUMMITS_ROWS if self.uses_summits else MOST_ROWS

    @property
    def plane(self) -> RigidPlane:
        """The rigid plane at the largest load.

        Raises:
            ValueError: Where it is not known before the load steps.
        """
        if self.plane_at_largest_load is None:
            raise ValueError("the plane under this force is not known before the load steps")
        return self.plane_at_largest_load

    def interference(self, x: Array, y: Array, z: Array) -> Array:
        """Return how far points lie above the undeformed plane at the largest load [mm].

        Args:
            x: First coordinate of the points [mm].
            y: Second coordinate [mm].
            z: Height [mm].
        """
        return self.plane.at(x, y) - (self.surface.highest - z)

    @property
    def cell_interference(self) -> Array:
        """Interference of the heights of the surface, shape (nx, ny) [mm]."""
        surface = self.surface
        return self.interference(surface.x[:, None], surface.y, surface.heights)

    @cached_property
    def largest_interference(self) -> float:
        """Largest interference of the surface [mm], never less than the approach at the middle.

        Under a tilted plane the approach at the middle may be negative while its lower side
        touches.
        """
        return max(self.plane.approach, float(self.cell_interference.max()))

    @property
    def interfering_summits(self) -> NDArray[np.bool_]:
        """Which summits have a positive interference, shape (n,)."""
        summits = self.asperities
        return self.interference(summits.x, summits.y, summits.z) > 0.0

    @property
    def interfering_border_maxima(self) -> int:
        """Number of maxima on the border of the surface with a positive interference."""
        cut = self.asperities
        return int(np.sum(self.interference(cut.border_x, cut.border_y, cut.border_z) > 0.0))

    @property
    def interfering_patches(self) -> int:
        """Number of patches that the largest closures of their laws bring into contact."""
        surface, largest = self.surface, self.largest_closures
        if self.uses_summits:
            x, y, z = self.asperities.x, self.asperities.y, self.asperities.z
        else:  # few of many heights come near
            i, j = np.nonzero(largest.max() > surface.highest - surface.heights)
            x, y, z = surface.x[i], surface.y[j], surface.heights[i, j]
        owner = self.patches.index_of(x, y)
        closes = largest[owner] > surface.highest - z
        return int(np.unique(owner[closes]).size)

    @property
    def largest_closures(self) -> Array:
        """Largest closure that the law of each patch is made for, shape (N,) [mm].

        It is the largest mean approach of the patch and `CLOSURE_RESERVE`. Laws that hold at points
        need the approach at the corners of the patch. So do isolated laws under a force, whose
        contacts may lie at a corner. A free plane may tilt further than on a half-space.
        """
        plane, loading = self.plane, self.scene.loading
        ends = plane.means(self.patches)
        isolated_force = self.scene.kind == "isolated" and loading.force is not None
        if self.scene.coupling.interface == "pointwise" or isolated_force:
            ends = ends + 0.5 * float(np.abs(np.multiply(self.patches.size, plane.tilt)).sum())
        if loading.tilt == "free":
            ends = ends + (ends.max() - plane.approach)
        return ends + CLOSURE_RESERVE * self.largest_interference


def _listed(errors: Mapping[str, float]) -> str:
    if not errors:
        return "which is not measured beforehand"
    causes = ", ".join(f"{cause} {100 * error:.2g} %" for cause, error in errors.items())
    return f"measured at the largest load {100 * sum(errors.values()):.2g} % ({causes})"
