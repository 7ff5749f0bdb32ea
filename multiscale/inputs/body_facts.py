"""What is known of the bodies of a scene without their finite elements.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from geometry import BlockShape, Material
from multiscale.inputs.block import block_material
from multiscale.inputs.reference_meshes import mesh_unknowns
from multiscale.scene.scene import Scene

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    pass


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
    def of_block(cls, scene: Scene, shape: BlockShape) -> Self:
        """Return what is known of a block.

        Args:
            scene: The scene.
            shape: Shape and cells of its block.
        """
        x, y = (length + 2.0 * shape.margin for length in shape.interface)
        material = block_material(scene)
        kind = "hexahedra" if shape.hexahedral else "tetrahedra"
        return cls(
            lengths=shape.interface,
            area=shape.interface[0] * shape.interface[1],
            depth=shape.height,
            cells=f"{' × '.join(map(str, shape.cells))} {kind}",
            unknowns=mesh_unknowns(shape),
            element=shape.element,
            materials=(material,),
            poisson_ratio=material.poisson_ratio,
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


def second_material(scene: Scene, counter: BodyFacts | None) -> Material | None:
    """Return the material of a scene's counter-body at the interface; None where it is rigid.

    Args:
        scene: The scene.
        counter: What is known of its mesh; None of a half-space.
    """
    if counter is not None:
        return counter.materials[0]
    return None if scene.counter_body is None else scene.counter_body.whole_material
