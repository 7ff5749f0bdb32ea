"""A meshed body under a contact: its terms in the contact problem.

Theory: demos/theory.md, sections 5 and 6.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from geometry import Material, PatchGrid
from micro import FreeSides, RectangleFields
from multiscale.couplings.face_terms import (
    CUBE_MODES,
    DECAY_LENGTH,
    FLATNESS_POWER,
    LEAST_WITH_MARGIN,
    LEAST_WITH_SIDES,
    FaceTerms,
)
from multiscale.setup.mesh_bodies import SceneBody

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import ContactFacets, ElasticBody, FaceCompliance
    from macro.compliance.surroundings import Surroundings

_ON_MESH = 6
"""Modes at most where they load the mesh itself: finer ones are those of its elements."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeshTerms(FaceTerms):
    """A meshed body under a contact on a rectangle of its face.

    Args:
        body: The body.
        facets: Facets of its contact face; the frame's origin is the rectangle's lower corner.
        rectangle: The rectangle.
        around: What is around it.
        side_term: Free sides that are a term of their own; None where there is none.
    """

    body: ElasticBody
    facets: ContactFacets
    rectangle: PatchGrid
    around: Surroundings
    side_term: FreeSides | None = None

    @classmethod
    def of(cls, scene_body: SceneBody, lengths: tuple[float, float], *, side_term: bool) -> Any:
        """Return the terms of a scene's body, whose coordinates count from its surface's corner.

        Args:
            scene_body: The body on its mesh.
            lengths: Sides (Lx, Ly) of the surface [mm].
            side_term: Whether free sides that bound the surface are a term of their own.

        Raises:
            InputError: When the surface reaches beyond the face.

        Note:
            Collective.
        """
        from macro.compliance.surroundings import surroundings

        rectangle = PatchGrid(grid=(1, 1), lengths=lengths)
        facets = scene_body.facets[0]
        around = surroundings(scene_body.body, facets, rectangle)
        sides = None
        if side_term and any(around.free_sides):
            sides = FreeSides(
                lengths=lengths,
                poisson_ratio=around.material.poisson_ratio,
                decay_length=DECAY_LENGTH * min(*lengths, around.thickness),
                present=around.free_sides,
            )
        return cls(
            body=scene_body.body,
            facets=facets,
            rectangle=rectangle,
            around=around,
            side_term=sides,
        )

    @property
    def material(self) -> Material:  # type: ignore[override]
        """Elastic constants under the contact."""
        return self.around.material

    @property
    def lengths(self) -> tuple[float, float]:
        """Sides of the rectangle that the modes cover [mm]."""
        return self.rectangle.lengths

    @property
    def modes(self) -> int:
        """Modes along a side that resolve the body correction; see `FaceTerms`."""
        flatness = max(self.lengths) / min(*self.lengths, self.around.thickness)
        count = CUBE_MODES * flatness**FLATNESS_POWER
        if self.side_term is None and any(self.around.free_sides):
            count = max(count, LEAST_WITH_SIDES)
        elif not all(self.around.free_sides):
            count = max(count, LEAST_WITH_MARGIN)
        return math.ceil(round(count if self.around.below else min(count, _ON_MESH), 6))

    def face(self, comm: Any, *, modes: int | None = None) -> FaceCompliance:
        """Return the compliance of the rectangle in modes, from the mesh.

        Args:
            comm: MPI communicator; ranks are those of the mesh.
            modes: Modes along a side; by default those of the shape.

        Note:
            Collective.
        """
        from macro import FaceCompliance
        from macro.compliance.cache import cached
        from macro.compliance.mesh_digest import body_digest
        from macro.compliance.mesh_face import mesh_face_compliance, raised

        count, body = modes or self.modes, raised(self.body)
        if not self.around.below:
            count = min(count, _ON_MESH)

        def compute() -> dict[str, Any]:
            fields = RectangleFields(
                lengths=self.lengths,
                count=count,
                material=self.material,
                extended=self.around.free_sides,
            )
            on_one_side = fields if self.around.below else None
            return asdict(
                mesh_face_compliance(
                    body, self.facets, self.rectangle, self.material, count, on_one_side
                )
            )

        frame = self.facets.frame
        key = (
            body_digest(body),
            (*frame.origin.tolist(), *frame.axes.ravel().tolist()),
            self.lengths,
            count,
            self.around.free_sides,
            self.around.below,
        )
        return FaceCompliance(**cached("mesh-face", key, compute, self.body.comm))
