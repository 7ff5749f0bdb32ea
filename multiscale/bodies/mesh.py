"""A meshed body under a contact: its term in the contact problem.

Theory: docs/theory.md, sections 5 and 6.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from patchlaw.geometry import Material, PatchGrid
from patchlaw.micro import FreeSides, RectangleFields, TractionModes
from patchlaw.multiscale.bodies.face_terms import (
    LEAST_WITH_MARGIN,
    LEAST_WITH_SIDES,
    FiniteBody,
    free_sides,
    resolving_modes,
)
from patchlaw.multiscale.bodies.reader import SceneBody
from patchlaw.support import Array

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro import ContactFacets, FaceCompliance, MeshedBody
    from patchlaw.macro.compliance.surroundings import Surroundings


def mesh_term(
    scene_body: SceneBody,
    lengths: tuple[float, float],
    *,
    side_term: bool,
    opposite: FiniteBody | None = None,
) -> FiniteBody:
    """Return a scene's body under a contact, whose coordinates count from its surface's corner.

    Args:
        scene_body: The body on its mesh.
        lengths: Sides (Lx, Ly) of the surface [mm].
        side_term: Whether free sides that bound the surface are a term of their own.
        opposite: The first body where this one is the counter-body, in the coordinates of the first
            one. Its free sides are a term of their own where both bodies have the same ones and the
            same Poisson's ratio.

    Raises:
        InputError: When the surface reaches beyond the face.

    Note:
        Collective.
    """
    from patchlaw.macro.compliance.mesh_face import from_outside
    from patchlaw.macro.compliance.surroundings import surroundings

    rectangle, facets = PatchGrid(grid=(1, 1), lengths=lengths), scene_body.facets[0]
    if opposite is not None:
        facets = from_outside(facets, lengths[0])
    around = surroundings(scene_body.body, facets, rectangle)
    own = None
    if opposite is not None and _alike(opposite, around):
        own = opposite.side_term
    elif opposite is None and side_term and any(around.free_sides):
        own = free_sides(lengths, around.material, around.thickness, around.free_sides)
    return _MeshedBody(
        material=around.material,
        lengths=lengths,
        modes=_modes(around, lengths, own),
        side_term=own,
        held=around.held,
        body=scene_body,
        facets=facets,
        around=around,
        opposite=opposite is not None,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _MeshedBody(FiniteBody):
    """A body on a mesh under a contact.

    Args:
        body: The body on its mesh.
        facets: Facets of its contact face; the frame's origin is the rectangle's lower corner.
        around: What is around the rectangle.
        opposite: Whether it is the counter-body, seen from behind.
    """

    body: SceneBody
    facets: ContactFacets
    around: Surroundings
    opposite: bool

    def solve(self, comm: Any, count: int) -> FaceCompliance:
        from patchlaw.macro import FaceCompliance
        from patchlaw.macro.compliance import mesh_face

        count = _resolved(self.around, count)

        def compute() -> dict[str, Any]:
            loads = self._fields(count) if self.around.below else None

            def of(body: MeshedBody, facets: ContactFacets) -> FaceCompliance:
                moments = mesh_face.FaceMoments(body, facets, self._rectangle, count)
                return mesh_face.mesh_face_compliance(moments, self.material, loads)

            best = mesh_face.Discretised.of(self.body.body, self.facets)
            found = of(best.body, best.facets)
            off = best.off_by_error(found.normal, lambda *other: of(*other).normal)
            return replace(found, rough=off).arrays

        found = FaceCompliance(**self._cached("mesh-face", count, compute))
        return mesh_face.turned(found) if self.opposite else found

    def tractions(self, comm: Any) -> TractionModes:
        from patchlaw.macro.compliance import mesh_face

        count = max(self.modes, 2)

        def compute() -> dict[str, Any]:
            loads = [self._fields(count, axis) for axis in range(2)] if self.around.below else None

            def of(body: MeshedBody, facets: ContactFacets) -> Array:
                moments = mesh_face.FaceMoments(body, facets, self._rectangle, count)
                return mesh_face.mesh_face_tractions(moments, loads)

            best = mesh_face.Discretised.of(self.body.body, self.facets)
            found = of(best.body, best.facets)
            return {"tractions": found, "rough": best.off_by_error(found, of)}

        whole = self._cached("mesh-tractions", count, compute)
        matrix, rough = (
            self.beyond_half_space(whole[name], count) for name in ("tractions", "rough")
        )
        if self.opposite:
            matrix, rough = map(mesh_face.seen_from_behind, (matrix, rough))
        return TractionModes(self.lengths, matrix, rough=rough)

    @property
    def _rectangle(self) -> PatchGrid:
        return PatchGrid(grid=(1, 1), lengths=self.lengths)

    def _fields(self, count: int, axis: int = 2) -> RectangleFields:
        """Return the fields in a half-space under modes of loads along an axis."""
        return RectangleFields(
            lengths=self.lengths,
            count=count,
            material=self.material,
            extended=self.around.free_sides,
            axis=axis,
        )

    def _cached(
        self, kind: str, count: int, compute: Callable[[], Mapping[str, Any]]
    ) -> Mapping[str, Any]:
        """Return arrays that depend on the mesh and the modes, from the cache if they are there."""
        from patchlaw.macro.disk_caches import cached

        key = mesh_key(self.body, self.facets, self.around, self.lengths, count)
        return cached(kind, key, compute, self.body.body.comm)


def _alike(opposite: FiniteBody, around: Surroundings) -> bool:
    """Tell whether a counter-body has the free sides and the Poisson's ratio of the first body."""
    left, right, *others = around.free_sides
    same = opposite.side_term is not None and opposite.side_term.present == (right, left, *others)
    return same and abs(opposite.material.poisson_ratio - around.material.poisson_ratio) < 1e-9


def _modes(around: Surroundings, lengths: tuple[float, float], side_term: FreeSides | None) -> int:
    """Return the modes along a side that resolve the body correction."""
    least = 0 if all(around.free_sides) else LEAST_WITH_MARGIN
    if side_term is None and any(around.free_sides):
        least = LEAST_WITH_SIDES
    return _resolved(around, resolving_modes(lengths, around.thickness, least))


def _resolved(around: Surroundings, count: int) -> int:
    """Return as many modes along a side, or as many as the mesh itself resolves."""
    return count if around.below else min(count, 6)


def mesh_key(
    scene_body: SceneBody,
    facets: ContactFacets,
    around: Surroundings,
    lengths: tuple[float, float],
    count: int,
) -> tuple[object, ...]:
    """Return what the compliance in so many modes along a side depends on.

    Args:
        scene_body: The body. The digest of its file, its cells once they are refined, and its size
            tell its mesh from others.
        facets: Facets of its contact face; the frame's origin is the rectangle's lower corner.
        around: What is around the rectangle.
        lengths: Sides of the rectangle [mm].
        count: Modes along a side.
    """
    body, frame, facts = scene_body.body, facets.frame, scene_body.facts
    materials = body.materials
    return (
        (facts.digest, facts.cells, facts.lengths),
        materials if isinstance(materials, Material) else tuple(sorted(materials.items())),
        tuple(body.supports),
        body.degree,
        (*frame.origin.tolist(), *frame.axes.ravel().tolist()),
        lengths,
        count,
        around.free_sides,
        around.below,
    )
