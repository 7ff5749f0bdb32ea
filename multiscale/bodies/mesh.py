"""A meshed body under a contact: its terms in the contact problem.

Theory: docs/theory.md, sections 5 and 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from patchlaw.geometry import Material, PatchGrid
from patchlaw.micro import (
    BodyModes,
    FreeSides,
    RectangleFields,
    TractionModes,
    half_space_traction_modes,
)
from patchlaw.multiscale.bodies.face_terms import (
    LEAST_WITH_MARGIN,
    LEAST_WITH_SIDES,
    FaceTerms,
    free_sides,
)
from patchlaw.multiscale.inputs.bodies import SceneBody
from patchlaw.support.arrays import Array

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro import ContactFacets, FaceCompliance, MeshedBody
    from patchlaw.macro.compliance.surroundings import Surroundings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeshTerms(FaceTerms):
    """A meshed body under a contact on a rectangle of its face.

    Args:
        body: The body.
        facets: Facets of its contact face; the frame's origin is the rectangle's lower corner.
        rectangle: The rectangle.
        around: What is around it.
        origin: What tells the mesh from others: the digest of its file, its cells once they are
            refined, and its size in mm.
        side_term: Free sides that are a term of their own; None where there is none.
        behind: Whether the body lies on the other side, in a frame turned about the y axis.
    """

    body: MeshedBody
    facets: ContactFacets
    rectangle: PatchGrid
    around: Surroundings
    origin: tuple[object, ...]
    side_term: FreeSides | None = None
    behind: bool = False

    @classmethod
    def of(
        cls,
        scene_body: SceneBody,
        lengths: tuple[float, float],
        *,
        side_term: bool,
        behind: bool = False,
    ) -> MeshTerms:
        """Return the terms of a scene's body, whose coordinates count from its surface's corner.

        Args:
            scene_body: The body on its mesh.
            lengths: Sides (Lx, Ly) of the surface [mm].
            side_term: Whether free sides that bound the surface are a term of their own.
            behind: Whether it is the counter-body, in the coordinates of the first one.

        Raises:
            InputError: When the surface reaches beyond the face.

        Note:
            Collective.
        """
        from patchlaw.macro.compliance.mesh_face import from_outside
        from patchlaw.macro.compliance.surroundings import surroundings

        rectangle = PatchGrid(grid=(1, 1), lengths=lengths)
        facets, facts = scene_body.facets[0], scene_body.facts
        if behind:
            facets = from_outside(facets, lengths[0])
        around = surroundings(scene_body.body, facets, rectangle)
        sides = None
        if side_term and any(around.free_sides):
            sides = free_sides(lengths, around.material, around.thickness, around.free_sides)
        return cls(
            body=scene_body.body,
            facets=facets,
            rectangle=rectangle,
            around=around,
            origin=(facts.digest, facts.cells, facts.lengths),
            side_term=sides,
            behind=behind,
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
    def held(self) -> list[tuple[float, float] | None]:
        """The part of each side that is held across the face; see `FaceTerms`."""
        return list(self.around.held)

    @property
    def modes(self) -> int:
        """Modes along a side that resolve the body correction; see `FaceTerms`."""
        free = self.around.free_sides
        least = 0 if all(free) else LEAST_WITH_MARGIN
        if self.side_term is None and any(free):
            least = LEAST_WITH_SIDES
        return self._resolved(self.resolving_modes(self.around.thickness, least))

    def _solved_face(self, comm: Any, count: int) -> FaceCompliance:
        """Solve for the compliance of the rectangle in modes on the mesh; see `FaceTerms.face`."""
        from patchlaw.macro import FaceCompliance
        from patchlaw.macro.compliance.mesh_face import Discretised, mesh_face_compliance, turned
        from patchlaw.macro.disk_caches import cached

        count = self._resolved(count)

        def compute() -> dict[str, Any]:
            loads = self._fields(count) if self.around.below else None

            def of(body: MeshedBody, facets: ContactFacets) -> FaceCompliance:
                rest = self.rectangle, self.material, count, loads
                return mesh_face_compliance(body, facets, *rest)

            best = Discretised.of(self.body, self.facets)
            found = of(best.body, best.facets)
            off = best.off_by_error(found.normal, lambda *other: of(*other).normal)
            return replace(found, rough=off).arrays

        found = FaceCompliance(**cached("mesh-face", self._key(count), compute, self.body.comm))
        return turned(found) if self.behind else found

    def traction_term(self, comm: Any) -> TractionModes:
        """Return what the body adds to a half-space under tractions; see `FaceTerms`."""
        from patchlaw.macro.compliance.mesh_face import (
            Discretised,
            mesh_face_tractions,
            seen_from_behind,
        )
        from patchlaw.macro.disk_caches import cached

        lengths, material = self.lengths, self.material
        count = max(self.modes, 2)

        def compute() -> dict[str, Any]:
            fields = [self._fields(count, axis) for axis in range(2)]
            loads = fields if self.around.below else None

            def of(body: MeshedBody, facets: ContactFacets) -> Array:
                return mesh_face_tractions(body, facets, self.rectangle, material, count, loads)

            best = Discretised.of(self.body, self.facets)
            found = of(best.body, best.facets)
            return {"tractions": found, "rough": best.off_by_error(found, of)}

        whole = cached("mesh-tractions", self._key(count), compute, self.body.comm)
        without = half_space_traction_modes(lengths, material.poisson_ratio, count)
        matrix, rough = (
            seen_from_behind(one) if self.behind else one
            for one in (
                whole[name] - without / material.contact_modulus for name in ("tractions", "rough")
            )
        )
        return TractionModes(lengths, matrix, rough=rough)

    def _fields(self, count: int, axis: int = 2) -> RectangleFields:
        """Return the fields of a half-space under tractions along an axis."""
        return RectangleFields(
            lengths=self.lengths,
            count=count,
            material=self.material,
            extended=self.around.free_sides,
            axis=axis,
        )

    def _resolved(self, count: int) -> int:
        """Return as many modes along a side, or as many as the mesh itself resolves."""
        return count if self.around.below else min(count, 6)

    def _key(self, count: int) -> tuple[object, ...]:
        """Return what the compliance in so many modes along a side depends on."""
        body, frame = self.body, self.facets.frame
        materials = body.materials
        return (
            self.origin,
            materials if isinstance(materials, Material) else tuple(sorted(materials.items())),
            tuple(body.supports),
            body.degree,
            (*frame.origin.tolist(), *frame.axes.ravel().tolist()),
            self.lengths,
            count,
            self.around.free_sides,
            self.around.below,
        )


@dataclass(frozen=True, slots=True, eq=False)
class BothFaces:
    """Compliances of the faces of two bodies in modes.

    Args:
        first: That of the body.
        second: That of the counter-body, in the coordinates of the first one.
    """

    first: FaceCompliance
    second: FaceCompliance

    @property
    def count(self) -> int:
        """Modes K along a side."""
        return max(self.first.count, self.second.count)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairTerms(FaceTerms):
    """A body and a meshed counter-body on the other side of the contact.

    Free sides are a term of their own only where those of the first body are, or where both bodies
    have the same ones and the same Poisson's ratio.

    Args:
        first: The first body.
        second: The counter-body, whose free sides are not a term of their own.
    """

    first: FaceTerms
    second: MeshTerms

    @property
    def material(self) -> Material:  # type: ignore[override]
        """Elastic constants of the first body under the contact."""
        return self.first.material

    @property
    def side_term(self) -> FreeSides | None:  # type: ignore[override]
        """Free sides that are a term of their own."""
        return self.first.side_term

    @property
    def lengths(self) -> tuple[float, float]:
        """Sides of the contact, which the modes of both together cover [mm]."""
        return self.second.lengths

    @property
    def held(self) -> list[tuple[float, float] | None]:
        """The part of each side that is held across the face, of both bodies."""
        return [*self.first.held, *self.second.held]

    @property
    def modes(self) -> int:
        """Modes along a side that resolve both body corrections."""
        return max(self.first.modes, self._behind.modes)

    def side_share(self, contact_modulus: float) -> float:
        """Return the share of the contact modulus over that of what has the free sides."""
        share = self.first.side_share(contact_modulus)
        if self._alike:
            share += contact_modulus / self.second.material.contact_modulus
        return share

    def each(self, face: Any) -> list[tuple[FaceTerms, FaceCompliance]]:
        """Return the terms of both bodies, see `FaceTerms.each`."""
        return [(self.first, face.first), (self._behind, face.second)]

    def term(self, face: Any, *, higher: Sequence[float] = ()) -> BodyModes:
        """Return the body correction of both, in modes of the contact.

        Args:
            face: Compliance of both faces.
            higher: Height that is added to each body, see `FaceTerms.term`.
        """
        own = self.first.term(face.first, higher=higher[:1]).within(self.lengths)
        return own.plus(self._behind.term(face.second, higher=higher[1:]))

    def _solved_face(self, comm: Any, count: int) -> Any:
        """Solve for the compliances of both faces."""
        first = self.first.face(comm, modes=count)
        return BothFaces(first, self._behind.face(comm, modes=count))

    def traction_term(self, comm: Any) -> TractionModes:
        """Return what both bodies add to half-spaces under tractions; see `FaceTerms`."""
        own = self.first.traction_term(comm).within(self.lengths)
        return own.plus(self.second.traction_term(comm))

    @property
    def _alike(self) -> bool:
        """Whether both bodies have the same free sides and the same Poisson's ratio."""
        own, around = self.first.side_term, self.second.around
        left, right, *others = around.free_sides
        same = own is not None and own.present == (right, left, *others)
        apart = self.first.material.poisson_ratio - self.second.material.poisson_ratio
        return same and abs(apart) < 1e-9

    @property
    def _behind(self) -> MeshTerms:
        return replace(self.second, side_term=self.first.side_term) if self._alike else self.second
