"""Compliance of a block's contact face, and the stresses in it, in Legendre modes."""

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
from macro.body.quarter import Parity, Quarter, Response
from macro.compliance_cache import Arrays, cached
from macro.elasticity import Material

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FaceCompliance:
    """Displacements and stresses of a contact face by pressures on it, in Legendre modes φ.

    Mode k K + l is P̂_k(x) P̂_l(y) (`geometry.legendre_modes`). A pressure p with the moments
    b_n = ∫ p φ_n dA displaces the face by Σ φ_m C_mn b_n.

    Args:
        normal: C, downwards, symmetric, shape (K², K²) [mm/N].
        growth: Derivative of C to the height of the block, symmetric, shape (K², K²) [1/N].
        stresses: The same of σ_xx, σ_yy and σ_xy in the face, which is pressed by −σ_zz, shape
            (3, K², K²) [1/mm²].
    """

    normal: Array
    growth: Array
    stresses: Array

    @property
    def count(self) -> int:
        """Modes K along a side."""
        return int(np.sqrt(len(self.normal)) + 0.5)


def face_compliance(
    shape: BlockShape, material: Material, sides: Sides, count: int, comm: Any
) -> FaceCompliance:
    """Solve for what every mode of pressure does to a block's contact face.

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
    families: list[Parity] = [(i, j) for i, j in product((0, 1), repeat=2) if max(i, j) < count]
    alike = shape.interface[0] == shape.interface[1]
    if alike and (1, 0) in families:
        families.remove((1, 0))

    def solved() -> dict[Parity, Response]:
        mine = families[comm.rank :: comm.size]
        return {parity: Quarter(parity=parity, **given).response(count) for parity in mine}

    found: dict[Parity, Response] = {}
    for part in comm.allgather(together(comm, solved)):
        found |= part
    if alike and (0, 1) in found:  # exchange x and y
        turned = Response(*(part.transpose(1, 0, 3, 2) for part in found[0, 1]))
        found[1, 0] = turned._replace(xx=turned.yy, yy=turned.xx)
    return _gathered(found, shape.interface, count, material)


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
        return {"normal": made.normal, "growth": made.growth, "stresses": made.stresses}

    block = shape.interface, shape.height, shape.margin
    return FaceCompliance(**cached("face", (block, material, sides, count), compute, comm))


def _gathered(
    found: dict[Parity, Response], lengths: tuple[float, float], count: int, material: Material
) -> FaceCompliance:
    """Put the modes of all parities together, per force."""
    area = lengths[0] * lengths[1]
    total = np.zeros((len(Response._fields), *4 * (count,)))
    for (odd_x, odd_y), response in found.items():
        for field, part in zip(total, response, strict=True):
            turn = part is response.xy
            seen_x, seen_y = (odd_x + turn) % 2, (odd_y + turn) % 2
            field[seen_x::2, seen_y::2, odd_x::2, odd_y::2] = part
    normal, xx, yy, xy, growth = total.reshape(-1, count**2, count**2) / area**2
    return FaceCompliance(
        normal=0.5 * (normal + normal.T),  # rounding apart it is symmetric
        growth=0.5 * (growth + growth.T),
        stresses=_stresses(xx, yy, xy, np.eye(count**2) / area, material),
    )


def _stresses(xx: Array, yy: Array, xy: Array, pressure: Array, material: Material) -> Array:
    """Return σ_xx, σ_yy, σ_xy where σ_zz = −p, by the strains in the face: Hooke's law."""
    nu = material.poisson_ratio
    modulus = material.young_modulus / (1.0 - nu**2)
    pushed = nu / (1.0 - nu) * pressure
    found = modulus * (xx + nu * yy) - pushed, modulus * (yy + nu * xx) - pushed
    return np.stack([*found, material.young_modulus / (1.0 + nu) * xy])
