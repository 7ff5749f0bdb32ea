"""The bodies of a scene that come from meshes, and what is known of them without the meshes.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from geometry import Material, MaterialPair
from geometry.face_frame import FaceFrame
from multiscale.scene.scene import Scene
from multiscale.setup.surface_and_block import block_material

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import ContactFacets, MeshedBody


@dataclass(frozen=True, slots=True, kw_only=True)
class FaceFacts:
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

    @property
    def degree(self) -> int:
        """Degree of the displacements."""
        return int(self.element[1])


Faces = tuple[FaceFacts | None, FaceFacts | None]
"""What is known of the meshes of a body and of its counter-body."""


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
    facts: FaceFacts

    def placed(self, place: tuple[float, float]) -> SceneBody:
        """Return the body with its coordinates counted from a point of the contact face.

        Args:
            place: The point in the present coordinates [mm].
        """
        frame = self.frame.moved(*place)
        facets = tuple(
            replace(part, frame=frame, corners=part.corners - np.asarray(place))
            for part in self.facets
        )
        return replace(self, frame=frame, facets=facets)


@dataclass(eq=False)
class SceneBodies:
    """The bodies of a scene that come from meshes.

    Attributes:
        first: The body below the surface; None for a block.
        counter: The body on the other side; None where that is rigid or a half-space.
    """

    first: SceneBody | None = None
    counter: SceneBody | None = None

    @property
    def facts(self) -> Faces:
        """What is known of the body and of the counter-body."""
        first, counter = (one.facts if one else None for one in (self.first, self.counter))
        return first, counter

    def place(self, place: tuple[float, float]) -> None:
        """Count the coordinates of both contact faces from a point of the first one.

        Args:
            place: The point [mm].
        """
        self.first = self.first and self.first.placed(place)
        self.counter = self.counter and self.counter.placed(place)

    def release(self) -> None:
        """Let go of the bodies, whose matrices stay in memory as long as they are held."""
        self.first = self.counter = None


def materials_in_contact(scene: Scene, faces: Faces) -> MaterialPair:
    """Return the materials on both sides of a scene's interface; the second may be rigid.

    Args:
        scene: The scene.
        faces: What is known of its meshes.
    """
    face, counter = faces
    first = block_material(scene) if face is None else face.materials[0]
    return MaterialPair(first=first, second=second_material(scene, counter))


def second_material(scene: Scene, counter: FaceFacts | None) -> Material | None:
    """Return the material of a scene's counter-body at the interface; None where it is rigid.

    Args:
        scene: The scene.
        counter: What is known of its mesh; None of a half-space.
    """
    if counter is not None:
        return counter.materials[0]
    return None if scene.counter_body is None else scene.counter_body.whole_material
