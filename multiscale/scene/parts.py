"""The parts that a coupling is made from: surface, materials, facts of the bodies, loads.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import Self

import numpy as np

from patchlaw.geometry import (
    Asperities,
    BlockShape,
    Material,
    MaterialPair,
    PatchGrid,
    Regions,
    RigidPlane,
    Surface,
    find_asperities,
    rough_sides,
)
from patchlaw.geometry.meshes.block import BlockMeshing
from patchlaw.geometry.statistics import check_finite_slopes
from patchlaw.geometry.surface import Zero
from patchlaw.micro import AsperityModel, HalfSpaceModel, MicroModel
from patchlaw.multiscale.loading.path import Path
from patchlaw.multiscale.machine import ClusterNodes
from patchlaw.multiscale.results.accuracy import Decision
from patchlaw.multiscale.scene.body_sections import BlockSection
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene.surfaces import RegionSamples
from patchlaw.support import Array, Flags, located, part_of
from patchlaw.support.readable import times

Cells = tuple[int, int, int]

LAW_BLOCK_CELLS: Cells = (40, 40, 25)
"""Cells of a block that carries laws on its mesh, those of Waddad et al. 2016, or contacts."""
FIELD_CELLS: Cells = (20, 20, 12)
"""Cells of a block that is meshed after the load for its fields under the mean pressures of
patches."""


def block_section(scene: Scene) -> BlockSection:
    """Return the section on the block of a scene that has one.

    Raises:
        ValueError: When its body is a mesh.
    """
    if scene.block is None:
        raise ValueError("a scene with a body of its own has no block")
    return scene.block


def stated_cells(scene: Scene) -> Cells:
    """Return the cells of the flat block's mesh, by default as many as its use needs.

    Laws need a fine mesh under every patch, and contacts are to be seen in fields; the mean
    pressures of patches need less.
    """
    fine = scene.shows_contacts or scene.on_mesh
    return block_section(scene).cells or (LAW_BLOCK_CELLS if fine else FIELD_CELLS)


def meshed_cells(scene: Scene) -> Cells | None:
    """Return the cells of a flat block that is meshed: for laws, or for fields afterwards."""
    meshed = scene.on_mesh or (scene.has_body and bool(scene.output.fields))
    if scene.block is None or not meshed or scene.meshes_roughness:
        return None
    return stated_cells(scene)


def second_material(scene: Scene, counter: BodyFacts | None) -> Material | None:
    """Return the material of a scene's counter-body at the interface; None where it is rigid.

    Args:
        scene: The scene.
        counter: What is known of its mesh; None of a half-space.
    """
    if counter is not None:
        return counter.materials[0]
    return None if scene.counter_body is None else scene.counter_body.whole_material


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyFacts:
    """What is known of a body and its contact face without its mesh.

    Attributes:
        lengths: Sides of the bounding rectangle of the contact face along its axes [mm].
        area: Area of the contact face [mm²].
        depth: Extent of the body below its contact face [mm].
        cells: What its mesh is made of, in words.
        unknowns: Degrees of freedom.
        element: Hexahedra Q or tetrahedra P, and the degree of the displacements.
        materials: Elastic constants at the contact face, and at its further regions.
        poisson_ratio: Largest Poisson's ratio in the body.
        above: Whether parts of the body lie above the plane of its contact face.
        digest: SHA-256 of the file of the mesh; empty for a block.
        notes: What a user should know of the mesh.
        shape: Shape and cells of a block; None of a body on a mesh.
    """

    lengths: tuple[float, float]
    area: float
    depth: float
    cells: str
    unknowns: int
    element: str
    materials: tuple[Material, ...]
    poisson_ratio: float
    above: bool = False
    digest: str = ""
    notes: tuple[str, ...] = ()
    shape: BlockShape | None = None

    @classmethod
    def of_block(cls, scene: Scene, surface: Surface) -> Self:
        """Return what is known of a scene's block under its surface.

        Args:
            scene: The scene.
            surface: Its surface.

        Raises:
            InputError: When shape and cells do not fit together; names file and key.
        """
        block = block_section(scene)
        lengths = block.lengths or surface.lengths
        with located(scene.file, "block"):
            shape = BlockShape(
                interface=lengths,
                height=block.height_under(lengths),
                cells=stated_cells(scene),
                **part_of(block, BlockMeshing),
            )
        x, y = shape.widths
        nodes = math.prod(shape.degree * (len(ticks) - 1) + 1 for ticks in shape.ticks)
        kind = "hexahedra" if shape.hexahedral else "tetrahedra"
        return cls(
            lengths=shape.interface,
            area=shape.interface[0] * shape.interface[1],
            depth=shape.height,
            cells=f"{times(shape.cells)} {kind}",
            unknowns=3 * nodes,
            element=shape.element,
            materials=(block.material,),
            poisson_ratio=block.poisson_ratio,
            notes=(f"its sides are {x:g} × {y:g} mm",) if shape.margin else (),
            shape=shape,
        )

    @property
    def on_mesh(self) -> bool:
        """Whether the body is a mesh of its own, and no block."""
        return self.shape is None

    @property
    def degree(self) -> int:
        """Degree of the displacements."""
        return int(self.element[1])


Facts = tuple[BodyFacts | None, BodyFacts | None]
"""What is known of the meshes of a body and of its counter-body."""


@dataclass(kw_only=True, eq=False)
class SceneParts:
    """What is made from a scene alone; it does not change, and is sent to all ranks.

    Attributes:
        scene: The scene, which leaves nothing open.
        surface: Its rough surface, with the heights of both sides where both are rough; under laws
            of samples the first sample.
        counter_surface: What of it is the counter-body's; None where that is smooth, and under laws
            of samples.
        patches: Partition of the interface.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        materials: The materials on both sides of the interface.
        body: What is known of the body below the surface.
        counter: The same of a counter-body on a mesh; None where that is rigid or a half-space.
        path: The loads, counted from first touch.
        zero: Approach from first touch of the height that approaches are shown from [mm].
        samples: The samples of every region of a face under laws of samples; none otherwise.
        micro: Micro model of the surface on a half-space; of the first sample under laws of
            samples; None where contacts are meshed.
        finite_slopes: Whether finite slopes of the surface count.
        plane_at_largest_load: The rigid plane at the largest load. Where the force or the moment is
            prescribed, it is the plane in equilibrium on a half-space, or None where nothing before
            the load steps needs it. Under laws of samples it is that on the first sample, an upper
            bound, as the body takes part of the approach.
        seconds: Wall time of each part of making it [s].
        nodes: The nodes of the run.
    """

    scene: Scene
    surface: Surface
    counter_surface: Surface | None = None
    patches: PatchGrid
    mean_heights: Array
    materials: MaterialPair
    body: BodyFacts
    counter: BodyFacts | None = None
    path: Path
    zero: float = 0.0
    samples: tuple[RegionSamples, ...] = ()
    micro: MicroModel | None = None
    finite_slopes: bool = False
    plane_at_largest_load: RigidPlane | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    nodes: ClusterNodes = field(default_factory=ClusterNodes)

    def check_slopes(self) -> None:
        """Refuse finite slopes of surfaces that are too steep for them.

        Raises:
            InputError: When a surface is.
        """
        if self.finite_slopes:
            with located(self.scene.file, "micro.finite_slopes"):
                for surface in self.sloped_surfaces:
                    check_finite_slopes(surface)

    # --- surfaces and bodies

    @property
    def decision(self) -> Decision | None:
        """What was measured for the keys that an accuracy chose; None where it chose none."""
        return self.scene.decision

    @property
    def regions(self) -> Regions | None:
        """The regions of a face under laws of samples; None with other laws."""
        return Regions(tuple(one.name for one in self.samples)) if self.samples else None

    @property
    def area(self) -> float:
        """Nominal contact area [mm²]."""
        return self.body.area if self.samples else self.patches.area * self.patches.count

    @property
    def rough_surfaces(self) -> tuple[Surface, ...]:
        """The surface, or all samples of all regions."""
        samples = tuple(one for region in self.samples for one in region.surfaces)
        return samples or (self.surface,)

    @property
    def sloped_surfaces(self) -> Sequence[Surface]:
        """The rough sides of the bodies, whose slopes count."""
        sides = [rough_sides(self.surface, self.counter_surface, self.materials)]
        if self.samples:
            sides = [region.sides_of(one) for region in self.samples for one in region.surfaces]
        return [surface for surface, _ in chain(*sides)]

    @property
    def meshes(self) -> list[BodyFacts]:
        """What is known of the bodies that are meshes of their own."""
        return [one for one in (self.body, self.counter) if one is not None and one.on_mesh]

    @property
    def shown_bodies(self) -> list[BodyFacts]:
        """What is known of the bodies that the record of a run tells: those loaded as meshes."""
        loaded = [self.body, self.counter] if self.samples else self.meshes
        return [one for one in loaded if one is not None]

    @cached_property
    def zero_error(self) -> float:
        """Error of that height [mm]."""
        return Zero(self.scene.loading.zero).error(self.rough_surfaces)

    # --- contacts

    @property
    def cells(self) -> tuple[int, int] | None:
        """Cells of contact problems of the whole surface; None where these have no cells."""
        known = isinstance(self.micro, HalfSpaceModel) and not self.samples
        return self.micro.surface.grid if known else None  # type: ignore[union-attr]

    @property
    def summits(self) -> Asperities | None:
        """The summits that the micro model consists of; None where it knows the whole surface."""
        return self.micro.asperities if isinstance(self.micro, AsperityModel) else None

    @cached_property
    def asperities(self) -> Asperities:
        """The surface's summits; found when first needed, which takes seconds on 4096² heights."""
        known = self.summits
        return find_asperities(self.surface) if known is None else known  # sides are free

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

        Raises:
            ValueError: Where the plane is not known before the load steps.
        """
        return self.plane.at(x, y) - (self.surface.highest - z)

    @cached_property
    def interfering_cells(self) -> int:
        """Number of cells of contact problems, else of heights, with a positive interference."""
        surface = self.micro.surface if self.cells else self.surface  # type: ignore[union-attr]
        return int(np.sum(self._interference(surface) > 0.0))

    @cached_property
    def largest_interference(self) -> float:
        """Largest interference of the surface [mm], never less than the approach at the middle.

        Under a tilted plane the approach at the middle may be negative while its lower side
        touches.
        """
        return max(self.plane.approach, float(self._interference(self.surface).max()))

    def _interference(self, surface: Surface) -> Array:
        """Return the interference of the heights of a surface, shape (nx, ny) [mm]."""
        return self.interference(surface.x[:, None], surface.y, surface.heights)

    @property
    def interfering_summits(self) -> Flags:
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
        if self.summits is not None:
            x, y, z = self.summits.x, self.summits.y, self.summits.z
        else:  # few of many heights come near
            i, j = np.nonzero(largest.max() > surface.highest - surface.heights)
            x, y, z = surface.x[i], surface.y[j], surface.heights[i, j]
        owner = self.patches.index_of(x, y)
        closes = largest[owner] > surface.highest - z
        return int(np.unique(owner[closes]).size)

    @property
    def largest_closures(self) -> Array:
        """Largest closure that the law of each patch is made for, shape (N,) [mm].

        It is the largest mean approach of the patch and 15 % of the largest interference, for the
        surface of a bent block may rise between the loads of its patches. Laws that hold at points
        need the approach at the corners of the patch, where contacts under a force may lie, too,
        that are taken alone. A free plane may tilt further than on a half-space.
        """
        plane, loading = self.plane, self.scene.loading
        ends = plane.means(self.patches)
        lone_force = self.scene.patches_alone and self.path.quantity == "force"
        if lone_force or self.scene.coupling.interface == "pointwise":
            ends = ends + 0.5 * float(np.abs(np.multiply(self.patches.size, plane.tilt)).sum())
        if loading.tilt == "free":
            ends = ends + (ends.max() - plane.approach)
        return ends + 0.15 * self.largest_interference
