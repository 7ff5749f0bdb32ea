"""The problem set up from a scene: surface, patches, micro model and shape of the block."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
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
from micro import AsperityModel, HalfSpaceModel, MicroModel
from multiscale.laws.refinement import MOST_ROWS
from multiscale.readable import duration
from multiscale.scene.scene import Scene
from multiscale.setup.mesh_bodies import FaceFacts, SceneBodies
from multiscale.setup.reference_meshes import ReferenceMeshes
from multiscale.setup.samples import RegionSamples

Array = NDArray[np.float64]

CLOSURE_RESERVE = 0.15
"""Closure that laws are made for beyond the largest approach, relative to the largest interference.
The surface of a bent block may rise between the loads of its patches."""
_CELLS_TOLERANCE, _SUMMITS_TOLERANCE = 5e-4, 1e-4
"""Interpolation error of laws by default. Finer tables would trace the steps of single cells."""
_SUMMITS_ROWS = 400
"""Most rows of laws by summits. On cells a row costs a solution, which is dear."""


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """A way to compute a scene.

    Attributes:
        label: The coupling, and the cells, meshes or micro model that it works on.
        seconds: Predicted time of the run [s].
    """

    label: str
    seconds: float

    @property
    def text(self) -> str:
        """The alternative in words."""
        return f"{self.label}, in about {duration(self.seconds)}"


@dataclass(frozen=True, kw_only=True)
class Decision:
    """What was taken, the errors that were measured for it, and what else there was.

    Attributes:
        accuracy: Relative error of the force that was requested.
        taken: What was taken.
        errors: Measured errors of the force by cause, relative to it, at the load where they are
            worst; empty where they cannot be measured beforehand.
        others: What was predicted to take longer, or could not keep the accuracy.
        missed: Errors by cause of what was tried first and could not keep the accuracy, if any.
    """

    accuracy: float
    taken: Alternative
    errors: Mapping[str, float]
    others: tuple[Alternative, ...] = ()
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
        """What was taken, what was measured for it, and what else there was."""
        parts = [
            self.taken.text,
            f"an accuracy of {100 * self.accuracy:.3g} % is asked for, {_listed(self.errors)}",
        ]
        if self.missed:
            parts.append(f"without meshing the roughness {_listed(self.missed)}")
        if self.others:
            parts.append(f"instead, {'; '.join(each.text for each in self.others)}")
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
            prescribed, it is the plane in equilibrium on a half-space, estimated on few of its
            cells where load steps solve the half-space model itself and need no plane before.
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
    plane_at_largest_load: RigidPlane
    counter_surface: Surface | None = None
    face: FaceFacts | None = None
    counter_face: FaceFacts | None = None
    samples: tuple[RegionSamples, ...] = ()
    bodies: SceneBodies = field(default_factory=SceneBodies)
    meshes: ReferenceMeshes | None = None
    decision: Decision | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)

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

    def interference(self, x: Array, y: Array, z: Array) -> Array:
        """Return how far points lie above the undeformed plane at the largest load [mm].

        Args:
            x: First coordinate of the points [mm].
            y: Second coordinate [mm].
            z: Height [mm].
        """
        return self.plane_at_largest_load.at(x, y) - (self.surface.highest - z)

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
        return max(self.plane_at_largest_load.approach, float(self.cell_interference.max()))

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
        plane, loading = self.plane_at_largest_load, self.scene.loading
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
