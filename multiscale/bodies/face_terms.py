"""The terms of a finite body in the contact problem, from the compliance of its face in modes.

The body correction is what the body adds to the compliance of a half-space. In Legendre modes of
its face it is the compliance of the body, less that of the half-space, and less the effect of free
sides where they are a term of their own.

Theory: docs/theory.md, sections 5, 6 and 11.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from patchlaw.geometry import BlockShape, Material, PatchGrid, Surface
from patchlaw.micro import (
    BodyModes,
    BodyStresses,
    FreeSides,
    RectangleFields,
    SurfaceStress,
    TractionModes,
    coarse_grid,
    half_space_modes,
    half_space_stress_modes,
    half_space_traction_modes,
    influence_matrix,
    side_modes,
    side_stress_modes,
    side_stresses,
)
from patchlaw.multiscale.bodies.reader import SceneBody
from patchlaw.support import Array, InputError, process_memory
from patchlaw.support.arguments import Comm, Distance, PositiveLength, check_fields, checked

if TYPE_CHECKING:
    from patchlaw.macro import ContactFacets, FaceCompliance, MeshedBody
    from patchlaw.macro.bodies import Sides
    from patchlaw.macro.compliance.surroundings import Surroundings


_CUBE_MODES = 8
"""Modes along a side of a cube whose free sides are a term of their own. On Set 1's recipe (seed 1,
8 µm) the force with 6, 8, 10 and 14 differs by 0.04, 0.012, 0.009 and 0.005 % from that with 20. On
a ball in the middle, near a side, cut by a side and by a corner 8 are within 0.003, 0.002, 0.02 and
0.1 %, 6 within 3 %."""

_FLATNESS_POWER = 0.42
"""Power of the shape's width by its depth that modes grow with: a block 0.3, 0.1 and 0.05 mm high
and 1 mm wide needs 13, 21 and 28 for 0.1 to 0.2 %."""

LEAST_WITH_SIDES = 16
"""Modes at least where they describe free sides too: with 16 on a cube Set 1's recipe is 0.4 % off,
a ball that a side cuts in half 3 % (with 8: 1.7 and 14 %; with 24: 0.15 and 0.6 %)."""

LEAST_WITH_MARGIN = 12
"""Modes at least where the block is wider than the contact: with a margin of 0.05 mm on a cube 8
are up to 1.2 % off, 12 up to 0.1 %; a corner 0.7 %."""


_BYTES = 190.0
"""Memory of solving for K × K modes over K⁴: free blocks 100 and 200 times as wide as high, with 56
and 75 modes, take 1.8 and 5.8 GB (and 15 and 48 s)."""


def free_sides(
    lengths: tuple[float, float],
    material: Material,
    depth: float,
    present: tuple[bool, bool, bool, bool] = (True, True, True, True),
) -> FreeSides:
    """Return free sides of a body that are a term of their own.

    Args:
        lengths: Sides of the contact [mm].
        material: Elastic constants of the body.
        depth: Its extent below the contact [mm].
        present: Which sides are free.
    """
    return FreeSides(
        lengths=lengths,
        poisson_ratio=material.poisson_ratio,
        decay_length=0.25 * min(*lengths, depth),
        present=present,
    )


_KEPT_MODES = 24
"""Modes along a side up to which a solution is kept: 13 MB."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FiniteBody(ABC):
    """A finite body under a contact.

    Attributes:
        material: Elastic constants under the contact.
        lengths: Sides of the rectangle that the modes cover [mm].
        modes: Modes along a side that resolve the body correction.
        side_term: Free sides that are a term of their own in the contact's compliance; None where
            the body correction includes them.
        margin: Width by which the modes' rectangle exceeds the contact on every side [mm].
        held: The part of each side along which supports hold the body in the normal direction [mm]:
            low x, high x, low y and high y side of the rectangle.
    """

    material: Material
    lengths: tuple[float, float]
    modes: int
    side_term: FreeSides | None
    margin: float = 0.0
    held: Sequence[tuple[float, float] | None] = ()

    @abstractmethod
    def solve(self, comm: Any, count: int, normal_alone: bool = False) -> FaceCompliance:
        """Return the compliance of the face in modes.

        Args:
            comm: MPI communicator; None for this process alone.
            count: Modes K along a side.
            normal_alone: Whether its displacements alone are wanted; a block then takes half the
                time.

        Note:
            Collective.
        """

    @abstractmethod
    def tractions(self, comm: Any) -> TractionModes:
        """Return what the body adds to a half-space under tractions; free sides are part of it.

        Args:
            comm: MPI communicator; None for this process alone.

        Note:
            Collective.
        """

    def beyond_half_space(self, tractions: Array, count: int) -> Array:
        """Return the compliance under tractions less that of the half-space, in modes.

        Args:
            tractions: Displacements by tractions in modes, shape (3, 3, K², K²) [mm/N].
            count: Modes K along a side.
        """
        without = half_space_traction_modes(self.lengths, self.material.poisson_ratio, count)
        return np.asarray(tractions - without / self.material.contact_modulus)

    def correction(self, face: FaceCompliance, higher: float | None = None) -> BodyModes:
        """Return the body correction.

        Args:
            face: Compliance of the face.
            higher: Height that is added under the contact, to first order [mm].
        """
        half_space = half_space_modes(self.lengths, face.count)
        if self.side_term is not None:
            half_space = half_space + side_modes(self.side_term, face.count)
        without = half_space / self.material.contact_modulus
        if higher:
            without = without - higher * face.growth
        rough = None if face.rough is None else face.rough - without
        origin = -self.margin, -self.margin
        return BodyModes(self.lengths, face.normal - without, origin, rough)

    def stresses(self, face: FaceCompliance, surface: Surface) -> list[SurfaceStress]:
        """Return the stresses in the contact face beyond those of the half-space.

        Args:
            face: Compliance of the face.
            surface: The rough surface, whose cells fill the contact face.
        """
        grid, count = coarse_grid(surface), face.count
        without = half_space_stress_modes(self.lengths, self.material.poisson_ratio, count)
        found: list[SurfaceStress] = []
        if self.side_term is not None:
            spacing = surface.lengths[0] / grid[0], surface.lengths[1] / grid[1]
            found.append(side_stresses(self.side_term, spacing))
            without = without + side_stress_modes(self.side_term, count)
        own = BodyStresses(self.lengths, grid, face.stresses - without, self.margin)
        return [*found, own]


@dataclass(frozen=True, eq=False)
class FaceTerms:
    """The finite bodies under a contact: one, or a second one on the other side of it.

    Args:
        bodies: The bodies. Free sides are a term of their own only where those of the first one
            are; the second one has the same term or none.
    """

    bodies: tuple[FiniteBody, ...]
    _faces: dict[int, tuple[FaceCompliance, ...]] = field(default_factory=dict, init=False)
    """What has been solved for, by the number of modes along a side."""

    @property
    def side_term(self) -> FreeSides | None:
        """Free sides that are a term of their own in the contact's compliance."""
        return self.bodies[0].side_term

    @property
    def held(self) -> list[tuple[float, float] | None]:
        """The part of each side that is held across the face, for one body after the other."""
        return [part for one in self.bodies for part in one.held]

    @property
    def modes(self) -> int:
        """Modes along a side that resolve the body corrections."""
        return max(one.modes for one in self.bodies)

    def side_share(self, contact_modulus: float) -> float:
        """Return the share of the contact modulus over that of what has the free sides.

        Args:
            contact_modulus: E* of the contact [MPa].
        """
        with_sides = [one for one in self.bodies if one.side_term is not None]
        return sum(contact_modulus / one.material.contact_modulus for one in with_sides)

    def face(self, comm: Any, *, modes: int | None = None) -> tuple[FaceCompliance, ...]:
        """Return the compliances of the faces in modes, which are kept where they are small.

        Args:
            comm: MPI communicator; None for this process alone. Where a body is a mesh its ranks
                are those of the mesh.
            modes: Modes along a side; by default those that the bodies need.

        Note:
            Collective.
        """
        count = modes or self.modes
        found = self._faces.get(count) or tuple(one.solve(comm, count) for one in self.bodies)
        if count <= _KEPT_MODES:
            self._faces[count] = found
        return found

    def term(self, faces: Sequence[FaceCompliance], *, higher: Sequence[float] = ()) -> BodyModes:
        """Return the body correction, of two bodies in modes of the contact.

        Args:
            faces: Compliances of the faces.
            higher: Height that is added under the contact to each body, to first order [mm].
        """
        each = zip_longest(self.bodies, faces, higher[: len(faces)])
        found: BodyModes = self._together([one.correction(face, more) for one, face, more in each])
        return found

    def traction_term(self, comm: Any) -> TractionModes:
        """Return what the bodies add to half-spaces under tractions; free sides are part of it.

        Args:
            comm: MPI communicator; None for this process alone.

        Note:
            Collective.
        """
        found: TractionModes = self._together([one.tractions(comm) for one in self.bodies])
        return found

    def _together(self, terms: list[Any]) -> Any:
        """Return the sum of what both bodies add; the modes of the second are the contact's."""
        first, *others = terms
        return first.within(others[0].lengths).plus(others[0]) if others else first

    def patch_compliance(self, patches: PatchGrid, comm: Any) -> Array:
        """Return the whole compliance of the bodies under patches.

        Args:
            patches: N patches of the contact face; free sides with a term of their own bound it.
            comm: MPI communicator; None for this process alone.

        Returns:
            Mean displacement of patch i by unit pressure on patch j, shape (N, N) [mm/MPa].

        Note:
            Collective. On 1 to 256 patches of a free cube entries are within 0.1 % of the largest
            one's limit.
        """
        modulus, count = self.bodies[0].material.contact_modulus, self.modes
        half_space = influence_matrix(patches) / (np.pi * modulus)
        if self.side_term is not None:
            half_space += self.side_term.patch_compliance(patches) * self.side_share(1.0)
            # of 16 × 16 patches the one in the corner is 0.3 % off with 8 modes, < 0.1 % with 12
            count = max(count, min(max(patches.grid), 12))
        else:
            # of 4 × 4, 8 × 8 and 16 × 16 patches 16, 16 and 24 modes leave 0.01, 0.07 and 0.3 %
            count = max(count, min(2 * max(patches.grid), 32))
        if count == self.modes:
            faces = self.face(comm)
        else:
            faces = tuple(one.solve(comm, count, normal_alone=True) for one in self.bodies)
        correction = self.term(faces)
        return np.asarray(half_space + correction.patch_compliance(patches))


def resolving_modes(lengths: tuple[float, float], depth: float, least: int) -> int:
    """Return the modes along a side that resolve a body correction; see the constants above.

    Args:
        lengths: Sides of the rectangle that they cover [mm].
        depth: Extent of the body below the contact [mm].
        least: Their least number.
    """
    flatness = max(lengths) / min(*lengths, depth)
    count = max(_CUBE_MODES * flatness**_FLATNESS_POWER, least)
    return math.ceil(round(count, 6))


def block_sides(shape: BlockShape, material: Material, sides: Sides) -> FreeSides | None:
    """Return the sides of a block as a term of their own; None where they do not bound the contact.

    Args:
        shape: Size of the block, with the contact as its interface.
        material: Elastic constants.
        sides: Support of its sides.
    """
    if sides != "free" or shape.margin:
        return None
    return free_sides(shape.interface, material, shape.height)


def block_term(
    shape: BlockShape, material: Material, sides: Sides, side_term: FreeSides | None = None
) -> FiniteBody:
    """Return an elastic block under a contact.

    Args:
        shape: Size of the block, with the contact as its interface; its cells do not matter.
        material: Elastic constants.
        sides: Support of its sides.
        side_term: Free sides that are a term of their own in the contact's compliance; None where
            the body correction includes them.
    """
    return _BlockBody(
        material=material,
        lengths=shape.widths,
        modes=_block_modes(shape, side_term),
        side_term=side_term,
        margin=shape.margin,
        shape=shape,
        sides=sides,
    )


def _block_modes(shape: BlockShape, side_term: FreeSides | None) -> int:
    """Return the modes along a side that resolve the body correction of a block."""
    least = 0 if side_term is not None else LEAST_WITH_SIDES
    return resolving_modes(shape.widths, shape.height, LEAST_WITH_MARGIN if shape.margin else least)


@dataclass(frozen=True, kw_only=True, eq=False)
class _BlockBody(FiniteBody):
    """A block under a contact."""

    shape: BlockShape
    sides: Sides

    def solve(self, comm: Any, count: int, normal_alone: bool = False) -> FaceCompliance:
        from patchlaw.macro import face_compliance

        _check_fits(self.shape, count)
        whole = self.lengths, self.shape.height, self.material, self.sides, count, comm
        return face_compliance(*whole, normal_alone=normal_alone, use_cache=True)

    def tractions(self, comm: Any) -> TractionModes:
        from patchlaw.macro import face_tractions

        count = min(_block_modes(self.shape, None), _KEPT_MODES)
        whole = self.lengths, self.shape.height, self.material, self.sides, count, comm
        matrix = self.beyond_half_space(face_tractions(*whole), count)
        return TractionModes(self.lengths, matrix, (-self.margin, -self.margin))


def _check_fits(shape: BlockShape, count: int) -> None:
    """Refuse a block so flat that its modes do not fit into memory."""
    needed, memory = _BYTES * float(count) ** 4, process_memory()
    if needed > memory:
        ratio = ((memory / _BYTES) ** 0.25 / _CUBE_MODES) ** (1.0 / _FLATNESS_POWER)
        raise InputError(
            f"the compliance of so flat a block, in {count} modes a side, needs about "
            f"{needed / 1e9:.3g} GB of memory",
            key="block.margin" if shape.margin else "block.height",
            value=shape.margin or shape.height,
            allowed="blocks whose longest side is at most "
            f"{ratio:.3g} times the shortest or the height",
        )


_ANY_CELLS = (1, 1, 1)
"""Cells of a shape that is solved for in modes, which do not matter."""


@dataclass(frozen=True, slots=True)
class ElasticBlock:
    """An elastic block on a rigid ground, with the rough surface in the middle of its top.

    `ElasticBlock(Material(young_modulus=210e3, poisson_ratio=0.3), height=1.0)` is a whole example.

    Args:
        material: Elastic constants.
        height: Height of the block [mm].
        sides: Its four sides: ``"free"`` of traction, or ``"roller"``, held in their normal
            direction.
        margin: Width of the block beyond the rough surface, on all sides [mm].

    Raises:
        InputError: When a value is out of its range.
    """

    material: Material
    _: KW_ONLY
    height: PositiveLength
    sides: Literal["free", "roller"] = "free"
    margin: Distance = 0.0

    def __post_init__(self) -> None:
        check_fields(self)

    @checked
    def terms(self, lengths: tuple[float, float], *, side_term: bool = True) -> FaceTerms:
        """Return the block's terms in contact problems of a surface.

        Args:
            lengths: Sides of the surface [mm].
            side_term: Whether free sides that bound the surface are a term of their own.
        """
        shape = BlockShape(
            interface=lengths, height=self.height, cells=_ANY_CELLS, margin=self.margin
        )
        own = block_sides(shape, self.material, self.sides) if side_term else None
        return FaceTerms((block_term(shape, self.material, self.sides, own),))

    @checked
    def compliance(self, patches: PatchGrid, comm: Comm | None = None) -> Array:
        """Return the mean displacement of patch i by unit pressure on patch j.

        Args:
            patches: N patches, which cover the rough surface.
            comm: MPI communicator; None for this process alone.

        Returns:
            Shape (N, N) [mm/MPa].

        Note:
            Collective.
        """
        return self.terms(patches.lengths).patch_compliance(patches, comm)


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

    def solve(self, comm: Any, count: int, normal_alone: bool = False) -> FaceCompliance:
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
