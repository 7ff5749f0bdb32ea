"""The body below a rough surface, as a program states it: a block by its material and height."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Annotated, Literal

from patchlaw.geometry import BlockShape, Material, PatchGrid
from patchlaw.multiscale.bodies.face_terms import FaceTerms, block_sides, block_term
from patchlaw.support.arguments import (
    Comm,
    Length,
    Limits,
    PositiveLength,
    check_fields,
    checked,
)
from patchlaw.support.arrays import Array

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
    margin: Annotated[Length, Limits(ge=0)] = 0.0

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
