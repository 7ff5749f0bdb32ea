"""Compliance of a block's contact face, in Legendre modes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import together
from geometry.errors import InputError
from geometry.meshes import BlockShape
from macro.block import Sides
from macro.body.division import division
from macro.body.quarter import Parity, Quarter
from macro.compliance_cache import Arrays, cached
from macro.elasticity import Material

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FaceCompliance:
    """Displacements of a contact face by pressures on it, both in Legendre modes φ.

    Mode k K + l is P̂_k(x) P̂_l(y) (`geometry.legendre_modes`). A pressure p with the moments
    b_n = ∫ p φ_n dA displaces the face by Σ φ_m C_mn b_n.

    Args:
        normal: C, downwards, symmetric, shape (K², K²) [mm/N].
        tangential: The same along x and y, shape (2, K², K²) [mm/N].
    """

    normal: Array
    tangential: Array


def face_compliance(
    shape: BlockShape, material: Material, sides: Sides, count: int, comm: Any
) -> FaceCompliance:
    """Solve for the displacements of a block's contact face by every mode of pressure.

    The modes are smooth, and so are the displacements but at the edges of the bottom: few elements
    of high order do. Modes of different parity do not mix: they are solved for apart, on a quarter
    of the block, by the ranks in turn.

    Args:
        shape: The block; its cells do not matter.
        material: Elastic constants.
        sides: Support of the block's sides.
        count: Modes K along a side of the contact face.
        comm: MPI communicator.

    Raises:
        InputError: When there is no mode.

    Note:
        Collective. The result does not depend on the number of ranks.
    """
    if count < 1:
        raise InputError("a face has one mode at least", value=count, allowed="K ≥ 1")
    given: dict[str, Any] = {
        "division": division(shape, count),
        "lengths": shape.interface,
        "material": material,
        "sides": sides,
    }
    families = [parity for parity in product((0, 1), repeat=2) if max(parity) < count]
    alike = shape.interface[0] == shape.interface[1]
    if alike and (1, 0) in families:
        families.remove((1, 0))

    def solved() -> dict[Parity, tuple[Array, Array, Array]]:
        mine = families[comm.rank :: comm.size]
        return {parity: Quarter(parity=parity, **given).displacements(count) for parity in mine}

    found: dict[Parity, tuple[Array, Array, Array]] = {}
    for part in comm.allgather(together(comm, solved)):
        found |= part
    if alike and (0, 1) in found:  # exchange x and y
        x, y, z = (part.transpose(1, 0, 3, 2) for part in found[0, 1])
        found[1, 0] = y, x, z
    return _gathered(found, shape.interface, count)


def cached_face_compliance(
    shape: BlockShape, material: Material, sides: Sides, count: int, comm: Any
) -> FaceCompliance:
    """Return `face_compliance` of the same arguments, from the cache where it was made before.

    Args:
        shape: The block; its cells do not matter.
        material: Elastic constants.
        sides: Support of the block's sides.
        count: Modes K along a side of the contact face.
        comm: MPI communicator.

    Note:
        Collective.
    """

    def compute() -> Arrays:
        made = face_compliance(shape, material, sides, count, comm)
        return {"normal": made.normal, "tangential": made.tangential}

    block = shape.interface, shape.height, shape.margin
    return FaceCompliance(**cached("face", (block, material, sides, count), compute, comm))


def _gathered(
    found: dict[Parity, tuple[Array, Array, Array]], lengths: tuple[float, float], count: int
) -> FaceCompliance:
    """Put the modes of all parities together, per force."""
    total = np.zeros((3, *4 * (count,)))
    for (odd_x, odd_y), displacements in found.items():
        for axis, part in enumerate(displacements):
            seen_x, seen_y = (odd_x + (axis == 0)) % 2, (odd_y + (axis == 1)) % 2
            total[axis, seen_x::2, seen_y::2, odd_x::2, odd_y::2] = part
    total = total.reshape(3, count**2, count**2) / (lengths[0] * lengths[1]) ** 2
    normal = 0.5 * (total[2] + total[2].T)  # rounding apart it is symmetric
    return FaceCompliance(normal=normal, tangential=total[:2])
