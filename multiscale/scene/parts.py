"""What is known of a scene whose sections fit together: surface, materials, bodies, loads.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, NamedTuple, Self

from patchlaw.geometry import (
    Asperities,
    BlockShape,
    Material,
    MaterialPair,
    PatchGrid,
    Regions,
    Surface,
    find_asperities,
)
from patchlaw.geometry.meshes.block import BlockMeshing
from patchlaw.geometry.zero import Zero
from patchlaw.micro import HalfSpaceModel, MicroModel, micro_model
from patchlaw.multiscale.loading.load_history import LoadHistory
from patchlaw.multiscale.machine import ClusterNodes
from patchlaw.multiscale.readable import times
from patchlaw.multiscale.results.accuracy import Decision
from patchlaw.multiscale.scene.bodies import BlockSection
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene.surfaces import located
from patchlaw.support.fields import part_of

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


def stated_cells(scene: Scene, unstated: Cells) -> Cells:
    """Return the cells of the flat block's mesh.

    Args:
        scene: The scene.
        unstated: Cells where the scene states none: laws need a fine mesh under every patch, and
            contacts are to be seen in fields; the mean pressures of patches need less.
    """
    cells = block_section(scene).cells
    return cells or unstated


def block_unknowns(shape: BlockShape) -> int:
    """Return the degrees of freedom of a block's mesh of hexahedra or of what they are split into.

    Args:
        shape: Shape and cells of the block.
    """
    return 3 * math.prod(shape.degree * (len(ticks) - 1) + 1 for ticks in shape.ticks)


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
    def of_block(cls, scene: Scene, surface: Surface, unstated: Cells) -> Self:
        """Return what is known of a scene's block under its surface.

        Args:
            scene: The scene.
            surface: Its surface.
            unstated: Cells of the block where the scene states none.

        Raises:
            InputError: When shape and cells do not fit together; names file and key.
        """
        block = block_section(scene)
        lengths = block.lengths or surface.lengths
        with located(scene, "block"):
            shape = BlockShape(
                interface=lengths,
                height=block.height_under(lengths),
                cells=stated_cells(scene, unstated),
                **part_of(block, BlockMeshing),
            )
        x, y = (length + 2.0 * shape.margin for length in shape.interface)
        kind = "hexahedra" if shape.hexahedral else "tetrahedra"
        return cls(
            lengths=shape.interface,
            area=shape.interface[0] * shape.interface[1],
            depth=shape.height,
            cells=f"{times(shape.cells)} {kind}",
            unknowns=block_unknowns(shape),
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


class Source(NamedTuple):
    """What a coupling is made from.

    Attributes:
        scene: The scene, which leaves nothing open.
        facts: What is known of its bodies' meshes.
        nodes: The nodes of the run.
    """

    scene: Scene
    facts: Facts
    nodes: ClusterNodes

    def micro_model(self, surface: Surface, materials: MaterialPair) -> MicroModel:
        """Return the micro model that the scene states, on a half-space.

        Args:
            surface: The surface, or a sample of it.
            materials: The materials on both sides.
        """
        micro, periodic = self.scene.micro, self.scene.surface.periodic
        model = micro_model(micro.model, surface, contact_modulus=materials.contact_modulus)
        if isinstance(model, HalfSpaceModel):
            model = replace(model, periodic=periodic, hardness=micro.hardness)
            return model if micro.cells is None else model.resampled(micro.cells)
        return model


@dataclass(kw_only=True, eq=False)
class SceneParts:
    """What is made from a scene alone; it does not change.

    Attributes:
        scene: The scene, which leaves nothing open.
        surface: Its rough surface, with the heights of both sides where both are rough; under laws
            of samples the first sample.
        counter_surface: What of it is the counter-body's; None where that is smooth, and under laws
            of samples.
        patches: Partition of the interface.
        materials: The materials on both sides of the interface.
        body: What is known of the body below the surface.
        counter: The same of a counter-body on a mesh; None where that is rigid or a half-space.
        load_history: The loads, counted from first touch.
        seconds: Wall time of each part of making it [s].
    """

    has_body: ClassVar[bool] = True
    """Whether the surface is on a body instead of a half-space."""
    has_laws: ClassVar[bool] = False
    """Whether load steps use laws."""
    meshes_roughness: ClassVar[bool] = False
    """Whether the roughness is meshed, so that there is no micro model."""
    tolerance_by_accuracy: ClassVar[bool] = False
    """Whether the tolerance of laws, where it is open, follows from the accuracy of the scene."""
    shows_contacts: ClassVar[bool] = False
    """Whether fields of a block are those under its contacts, which take more cells."""
    patches_interact: ClassVar[bool] = True
    """Whether all patches interact in the compliance of the bodies."""
    laws_made_by: ClassVar[str] = ""
    """Which ranks make laws of patches, ``"shared"`` or ``"root_only"``; empty without."""

    scene: Scene
    surface: Surface
    counter_surface: Surface | None = None
    patches: PatchGrid
    materials: MaterialPair
    body: BodyFacts
    counter: BodyFacts | None = None
    load_history: LoadHistory
    seconds: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def unstated_cells(cls, scene: Scene) -> Cells:
        """Return the cells of a block that a scene states none for: more under laws on its mesh.

        Args:
            scene: The scene.
        """
        return LAW_BLOCK_CELLS if cls.shows_contacts or scene.on_mesh else FIELD_CELLS

    @classmethod
    def block_cells(cls, scene: Scene) -> Cells | None:
        """Return the cells of a flat block that is meshed: for laws, or for fields afterwards.

        Args:
            scene: The scene.
        """
        meshed = scene.on_mesh or (cls.has_body and bool(scene.output.fields))
        if scene.block is None or not meshed:
            return None
        return stated_cells(scene, cls.unstated_cells(scene))

    @classmethod
    def patch_limits(cls, scene: Scene, surface: Surface) -> dict[str, Sequence[int]]:
        """Return what limits the numbers of patches along x and y, each with these limits.

        Args:
            scene: The scene.
            surface: Its surface.
        """
        limits: dict[str, Sequence[int]] = {"heights of the surface": surface.grid}
        if scene.micro.cells:
            limits["cells of contacts (micro.cells)"] = scene.micro.cells
        if cells := cls.block_cells(scene):
            limits["cells of the interface (block.cells)"] = cells[:2]
        return limits

    @property
    def decision(self) -> Decision | None:
        """What was measured for the keys that an accuracy chose; None where it chose none."""
        return self.scene.decision

    @property
    def regions(self) -> Regions | None:
        """The regions of a face under laws of samples; None with other laws."""
        return None

    @property
    def area(self) -> float:
        """Nominal contact area [mm²]."""
        return self.patches.area * self.patches.count

    @property
    def rough_surfaces(self) -> tuple[Surface, ...]:
        """The surface, or all samples of all regions."""
        return (self.surface,)

    @property
    def shown_bodies(self) -> list[BodyFacts]:
        """What is known of the bodies that the record of a run tells: those loaded as meshes."""
        loaded = self.meshes if self.regions is None else [self.body, self.counter]
        return [one for one in loaded if one is not None]

    @property
    def both_elastic(self) -> bool:
        """Whether the counter-body is an elastic half-space."""
        return self.materials.second is not None and self.counter is None

    @property
    def zero(self) -> float:
        """Approach from first touch of the height that approaches are shown from [mm]."""
        return self.load_history.depth

    @cached_property
    def zero_error(self) -> float:
        """Error of that height [mm]."""
        return Zero(self.scene.loading.zero).error(self.surface)

    @cached_property
    def asperities(self) -> Asperities:
        """The surface's summits; found when first needed, which takes seconds on 4096² heights."""
        return find_asperities(self.surface)  # the block's sides are free

    @property
    def summits(self) -> Asperities | None:
        """The summits that the micro model consists of; None where it knows the whole surface."""
        return None

    @property
    def finite_slopes(self) -> bool:
        """Whether finite slopes of the surface count."""
        return False

    @property
    def meshes(self) -> list[BodyFacts]:
        """What is known of the bodies that are meshes of their own."""
        return [one for one in (self.body, self.counter) if one is not None and one.on_mesh]
