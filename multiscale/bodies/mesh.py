"""A meshed body under a contact: its term in the contact problem.

Theory: docs/theory.md, sections 5 and 6.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from patchlaw.geometry import Material, PatchGrid
from patchlaw.micro import FreeSides, RectangleFields, TractionModes, half_space_traction_modes
from patchlaw.multiscale.bodies.face_terms import (
    LEAST_WITH_MARGIN,
    LEAST_WITH_SIDES,
    FiniteBody,
    free_sides,
    resolving_modes,
)
from patchlaw.multiscale.bodies.reader import SceneBody
from patchlaw.support.arrays import Array

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
    from patchlaw.macro.compliance import mesh_face
    from patchlaw.macro.compliance.surroundings import surroundings
    from patchlaw.macro.disk_caches import cached

    rectangle, body = PatchGrid(grid=(1, 1), lengths=lengths), scene_body.body
    facets = scene_body.facets[0]
    if opposite is not None:
        facets = mesh_face.from_outside(facets, lengths[0])
    around = surroundings(body, facets, rectangle)
    material, own = around.material, None
    if opposite is not None and _alike(opposite, around):
        own = opposite.side_term
    elif opposite is None and side_term and any(around.free_sides):
        own = free_sides(lengths, material, around.thickness, around.free_sides)
    modes = _modes(around, lengths, own)

    def fields(count: int, axis: int = 2) -> RectangleFields:
        return RectangleFields(
            lengths=lengths,
            count=count,
            material=material,
            extended=around.free_sides,
            axis=axis,
        )

    def solve(comm: Any, count: int) -> FaceCompliance:
        from patchlaw.macro import FaceCompliance

        count = _resolved(around, count)

        def compute() -> dict[str, Any]:
            loads = fields(count) if around.below else None

            def of(body: MeshedBody, facets: ContactFacets) -> FaceCompliance:
                rest = rectangle, material, count, loads
                return mesh_face.mesh_face_compliance(body, facets, *rest)

            best = mesh_face.Discretised.of(body, facets)
            found = of(best.body, best.facets)
            off = best.off_by_error(found.normal, lambda *other: of(*other).normal)
            return replace(found, rough=off).arrays

        key = mesh_key(scene_body, facets, around, lengths, count)
        found = FaceCompliance(**cached("mesh-face", key, compute, body.comm))
        return mesh_face.turned(found) if opposite is not None else found

    def tractions(comm: Any) -> TractionModes:
        count = max(modes, 2)

        def compute() -> dict[str, Any]:
            loads = [fields(count, axis) for axis in range(2)] if around.below else None

            def of(body: MeshedBody, facets: ContactFacets) -> Array:
                rest = rectangle, material, count, loads
                return mesh_face.mesh_face_tractions(body, facets, *rest)

            best = mesh_face.Discretised.of(body, facets)
            found = of(best.body, best.facets)
            return {"tractions": found, "rough": best.off_by_error(found, of)}

        key = mesh_key(scene_body, facets, around, lengths, count)
        whole = cached("mesh-tractions", key, compute, body.comm)
        without = half_space_traction_modes(lengths, material.poisson_ratio, count)
        matrix, rough = (
            whole[name] - without / material.contact_modulus for name in ("tractions", "rough")
        )
        if opposite is not None:
            matrix, rough = map(mesh_face.seen_from_behind, (matrix, rough))
        return TractionModes(lengths, matrix, rough=rough)

    return FiniteBody(
        material=material,
        lengths=lengths,
        modes=modes,
        side_term=own,
        held=around.held,
        solve=solve,
        tractions=tractions,
    )


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
