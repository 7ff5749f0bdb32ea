"""A body of a scene on its mesh.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from geometry.face_frame import FaceFrame
from multiscale.inputs.body_facts import BodyFacts

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import ContactFacets, MeshedBody


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
