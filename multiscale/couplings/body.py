"""What the block of a scene adds to the compliance of its contact: put together from both scales.

In Legendre modes of the block's top, the compliance of the block less that of the half-space, less
what free sides add where the micro model knows of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from micro import (
    BodyModes,
    BodyStresses,
    FreeSides,
    half_space_modes,
    half_space_stress_modes,
    side_modes,
    side_stress_modes,
)

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from geometry import BlockShape
    from macro import FaceCompliance, Material
    from macro.block import Sides

Array = NDArray[np.float64]

_CUBE = 8
"""Modes along a side of a cube whose free sides the half-space knows of. On Set 1's recipe (seed 1,
3 and 8 µm) 6, 8, 10 and 12 miss 0.12, 0.08, 0.00 and 0.03 % of the force that 20 give; on a ball in
the middle, near a side, cut by a side and by a corner 8 miss 0.03, 0.02, 0.00 and 0.1 %."""
_FLATNESS = 0.42
"""Power of the shape's width by its depth that modes grow with: a block 0.3, 0.1 and 0.05 mm high
and 1 mm wide needs 13, 21 and 28 for 0.1 to 0.2 %."""
_UNTOLD = 2.0
"""More modes where sides are not known: with 16 Set 1's recipe misses 0.4 %, a ball that a side
cuts in half 3 % (8: 1.7 and 14 %; 24: 0.15 and 0.6 %)."""
_MARGIN = 12
"""Modes at least where the block is wider than the contact: with a margin of 0.05 mm on a cube 8
miss up to 1.2 %, 12 up to 0.1 %; a corner 0.7 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """An elastic block under a contact.

    Args:
        shape: Size of the block; its cells do not matter.
        material: Elastic constants.
        sides: Support of its sides.
        known: Free sides that the contact's compliance has as a term of its own; None where the
            body's term is to have them.
    """

    shape: BlockShape
    material: Material
    sides: Sides
    known: FreeSides | None = None

    @property
    def lengths(self) -> tuple[float, float]:
        """Sides of the top, margin included [mm]."""
        x, y = (length + 2.0 * self.shape.margin for length in self.shape.interface)
        return x, y

    @property
    def modes(self) -> int:
        """Modes along a side that resolve what the block adds; see the constants above."""
        flatness = max(self.lengths) / min(*self.lengths, self.shape.height)
        count = _CUBE * flatness**_FLATNESS
        if self.shape.margin:
            count = max(count, _MARGIN)
        elif self.known is None:
            count *= _UNTOLD
        return math.ceil(round(count, 6))

    def face(self, comm: Any, *, modes: int | None = None, coarse: bool = False) -> FaceCompliance:
        """Return what pressures on the top do to it, from finite elements.

        Args:
            comm: MPI communicator; None for this process alone.
            modes: Modes along a side; by default those of the shape.
            coarse: Whether to take coarser elements, whose difference bounds the error.

        Note:
            Collective.
        """
        from mpi4py import MPI

        from macro import cached_face_compliance

        return cached_face_compliance(
            self.lengths,
            self.shape.height,
            self.material,
            self.sides,
            modes or self.modes,
            comm or MPI.COMM_SELF,
            coarse=coarse,
        )

    def term(self, face: FaceCompliance, *, higher: float = 0.0) -> BodyModes:
        """Return the body's term of the contact's compliance.

        Args:
            face: What pressures do to its top.
            higher: Height that is added to the block, to first order [mm].
        """
        half_space = half_space_modes(self.lengths, face.count)
        if self.known is not None:
            half_space = half_space + side_modes(self.known, face.count)
        whole = face.normal + higher * face.growth
        compliance = whole - half_space / self.material.contact_modulus
        return BodyModes(self.lengths, compliance, self._origin)

    def stresses(self, face: FaceCompliance, grid: tuple[int, int]) -> BodyStresses:
        """Return the stresses in the contact face that the half-space and its sides do not have.

        Args:
            face: What pressures do to the top.
            grid: Cells that fill the contact face.
        """
        nu = self.material.poisson_ratio
        known = half_space_stress_modes(self.lengths, nu, face.count)
        if self.known is not None:
            known = known + side_stress_modes(self.known, face.count)
        borders = [
            np.linspace(0.0, length, cells + 1) + self.shape.margin
            for length, cells in zip(self.shape.interface, grid, strict=True)
        ]
        return BodyStresses(self.lengths, (borders[0], borders[1]), face.stresses - known)

    @property
    def _origin(self) -> tuple[float, float]:
        return -self.shape.margin, -self.shape.margin
