"""Displacements of a block's top by tractions in all three directions, in Legendre modes.

Tractions along the top load the block with the parities that its pressures do, see
`macro.compliance.face_compliance`: one solution of each parity serves all three directions.

Theory: sections 6 and 15 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.materials import Material
from macro.compliance.cache import cached
from macro.compliance.elements import block_lines
from macro.compliance.face_compliance import PARITIES, Parity, ParityBlock
from support.arrays import Array
from support.collective import shared

if TYPE_CHECKING:
    from macro.bodies import Sides


def face_tractions(
    lengths: tuple[float, float],
    height: float,
    material: Material,
    sides: Sides,
    count: int,
    comm: Any,
) -> Array:
    """Solve for the displacements of a block's top by every mode of traction, or read them.

    Args:
        lengths: Sides (Lx, Ly) of the block's top, all of which the modes cover [mm].
        height: Height of the block [mm].
        material: Elastic constants.
        sides: Support of the block's sides.
        count: Modes K along a side of the top, at least 2.
        comm: MPI communicator; None for this process alone.

    Returns:
        Displacements along x, along y and downwards by tractions likewise, in modes: symmetric,
        shape (3, 3, K², K²) [mm/N]; the same on every rank and for every number of ranks.

    Note:
        Collective. The ranks share the parities.
    """

    def compute() -> dict[str, Array]:
        lines = block_lines(lengths, height, count)

        def block(parity: Parity) -> ParityBlock:
            return ParityBlock(
                lines=lines, height=height, material=material, sides=sides, parity=parity
            )

        parts = shared(comm, 4, lambda index: block(PARITIES[index]).traction_response())
        total = np.zeros((3, 3, *4 * (count,)))
        for parity, response in zip(PARITIES, parts, strict=True):
            odd = [block(parity).parity_of(axis) for axis in range(3)]
            for seen, row in enumerate(response):
                for by, part in enumerate(row):
                    (a, b), (c, d) = odd[seen], odd[by]
                    total[seen, by, a::2, b::2, c::2, d::2] = part
        total = total.reshape(3, 3, count**2, count**2) / (lengths[0] * lengths[1]) ** 2
        return {"tractions": 0.5 * (total + total.transpose(1, 0, 3, 2))}

    block_key = (lengths, height, material, sides, count)
    return cached("tractions", block_key, compute, comm)["tractions"]
