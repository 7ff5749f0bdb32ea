"""What is known of the bodies of a scene: sections of blocks, and meshes with their contact faces.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

from patchlaw.geometry import BlockShape, Material, PatchGrid, Surface
from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.geometry.meshes.block import BlockMeshing
from patchlaw.multiscale.inputs.surfaces import located
from patchlaw.multiscale.readable import times
from patchlaw.multiscale.scene.bodies import BlockSection
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support.arguments import part_of
from patchlaw.support.errors import InputError

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro import ContactFacets, MeshedBody

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


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneBody:
    """A body of a scene on its mesh, on every rank.

    Attributes:
        body: The elastic body.
        facets: Facets of the contact face, by region, in `frame`.
        frame: Coordinates of the contact face. Their origin is the lower corner of the bounding
            rectangle, or of the rectangle of the surface once it is placed.
        facts: What is known of it without the mesh.
    """

    body: MeshedBody
    facets: tuple[ContactFacets, ...]
    frame: FaceFrame
    facts: BodyFacts

    def placed(self, place: tuple[float, float]) -> SceneBody:
        """Return the body with its coordinates counted from a point of the contact face.

        Args:
            place: The point in the present coordinates [mm].
        """
        facets = tuple(part.moved(*place) for part in self.facets)
        return replace(self, frame=self.frame.moved(*place), facets=facets)

    def check_covers(self, lengths: tuple[float, float]) -> None:
        """Refuse a surface that does not lie on the contact face of the placed body.

        Args:
            lengths: Sides of the surface [mm].

        Raises:
            InputError: When it does not.

        Note:
            Collective.
        """
        from patchlaw.macro import LoadedFace

        whole = PatchGrid(grid=(1, 1), lengths=lengths)
        try:
            face = LoadedFace(self.body, self.facets[0], whole)
            covered = float(face.areas[0]) / whole.area
        except InputError:  # no facet lies in it
            covered = 0.0
        if covered < 1.0 - 1e-6:  # rounding
            x, y = self.facts.lengths
            raise InputError(
                f"the surface's rectangle, {lengths[0]:g} × {lengths[1]:g} mm, does not lie on the "
                f"contact face, which covers {100.0 * covered:.3g} % of it and is {x:.6g} × "
                f"{y:.6g} mm large",
                allowed="a rectangle on the face; or law.kind = 'representative', where the "
                "surface is a sample and the face may have any size and outline",
            )
