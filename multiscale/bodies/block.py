"""A block under a contact: its terms in the contact problem.

Theory: docs/theory.md, sections 5, 6 and 11.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from geometry import InputError, Material
from micro import FreeSides
from multiscale.bodies.face_terms import (
    CUBE_MODES,
    DECAY_LENGTH,
    FLATNESS_POWER,
    LEAST_WITH_MARGIN,
    LEAST_WITH_SIDES,
    FaceTerms,
)
from support.checks import process_memory

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from geometry import BlockShape
    from macro import FaceCompliance
    from macro.block import Sides

_BYTES = 190.0
"""Memory of solving for K × K modes over K⁴: free blocks 100 and 200 times as wide as high, with 56
and 75 modes, take 1.8 and 5.8 GB (and 15 and 48 s)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockTerms(FaceTerms):
    """An elastic block under a contact.

    Args:
        shape: Size of the block; its cells do not matter.
        material: Elastic constants.
        sides: Support of its sides.
        side_term: Free sides that are a term of their own in the contact's compliance; None where
            the body correction includes them.
    """

    shape: BlockShape
    material: Material
    sides: Sides
    side_term: FreeSides | None = None

    @property
    def lengths(self) -> tuple[float, float]:
        """Sides of the top, margin included [mm]."""
        x, y = (length + 2.0 * self.shape.margin for length in self.shape.interface)
        return x, y

    @property
    def modes(self) -> int:
        """Modes along a side that resolve the body correction; see the constants above."""
        flatness = max(self.lengths) / min(*self.lengths, self.shape.height)
        count = CUBE_MODES * flatness**FLATNESS_POWER
        if self.shape.margin:
            count = max(count, LEAST_WITH_MARGIN)
        elif self.side_term is None:
            count = max(count, LEAST_WITH_SIDES)
        return math.ceil(round(count, 6))

    def face(self, comm: Any, *, modes: int | None = None) -> FaceCompliance:
        """Return the compliance of the top in modes, from finite elements.

        Args:
            comm: MPI communicator; None for this process alone.
            modes: Modes along a side; by default those of the shape.

        Raises:
            InputError: When the modes of so flat a block do not fit into memory.

        Note:
            Collective.
        """
        from mpi4py import MPI

        from macro import face_compliance

        count = modes or self.modes
        needed, memory = _BYTES * float(count) ** 4, process_memory()
        if needed > memory:
            ratio = ((memory / _BYTES) ** 0.25 / CUBE_MODES) ** (1.0 / FLATNESS_POWER)
            raise InputError(
                f"the compliance of so flat a block, in {count} modes a side, needs about "
                f"{needed / 1e9:.3g} GB of memory",
                key="block.margin" if self.shape.margin else "block.height",
                value=self.shape.margin or self.shape.height,
                allowed="blocks whose longest side is at most "
                f"{ratio:.3g} times the shortest or the height",
            )
        return face_compliance(
            self.lengths,
            self.shape.height,
            self.material,
            self.sides,
            count,
            comm or MPI.COMM_SELF,
            use_cache=True,
        )

    @property
    def margin(self) -> float:
        """Width by which the top exceeds the contact on every side [mm]."""
        return self.shape.margin


def block_terms(
    shape: BlockShape, material: Material, sides: Sides, *, side_term: bool
) -> BlockTerms:
    """Return the terms of a block.

    Args:
        shape: Its shape, with the contact as its interface.
        material: Elastic constants.
        sides: Support of its sides.
        side_term: Whether free sides that bound the interface are a term of their own.
    """
    own = None
    if side_term and sides == "free" and not shape.margin:
        own = FreeSides(
            lengths=shape.interface,
            poisson_ratio=material.poisson_ratio,
            decay_length=DECAY_LENGTH * min(*shape.interface, shape.height),
        )
    return BlockTerms(shape=shape, material=material, sides=sides, side_term=own)
