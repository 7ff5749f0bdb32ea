"""The smooth correction of a block, solved for once and kept on disk."""

from __future__ import annotations

from typing import Any

from geometry.meshes import BlockShape
from geometry.partition import Partition
from geometry.smooth_shape import smooth_shape
from macro.block import Sides
from macro.compliance_cache import Arrays, cached, is_kept
from macro.condense import HalfSpaceField, make_correction
from macro.correction import Correction
from macro.elasticity import Material


def cached_correction(
    shape: BlockShape,
    material: Material,
    sides: Sides,
    loads: Partition,
    half_space: HalfSpaceField,
    comm: Any,
) -> Correction:
    """Return `make_correction` of the same arguments, from the cache where it was made before.

    Args:
        shape: The block and its division.
        material: Elastic constants.
        sides: Support of the block's sides.
        loads: Rectangles under pressure, on the interface.
        half_space: The half-space of the same material, which the key therefore leaves out.
        comm: MPI communicator.

    Raises:
        InputError: When a rectangle reaches beyond the block's top.

    Note:
        Collective.
    """

    def compute() -> Arrays:
        made = make_correction(shape, material, sides, loads, half_space, comm)
        return {"x": made.x, "y": made.y, "values": made.values}

    key = _key(shape, material, sides, loads)
    return Correction(loads=loads, **cached("correction", key, compute, comm))


def correction_is_kept(
    shape: BlockShape, material: Material, sides: Sides, loads: Partition
) -> bool:
    """Tell whether `cached_correction` would find the correction on this process' disk.

    Args:
        shape: The block and its division.
        material: Elastic constants.
        sides: Support of the block's sides.
        loads: Rectangles under pressure, on the interface.
    """
    return is_kept("correction", _key(shape, material, sides, loads))


def _key(
    shape: BlockShape, material: Material, sides: Sides, loads: Partition
) -> tuple[object, ...]:
    return smooth_shape(shape), material, sides, loads
