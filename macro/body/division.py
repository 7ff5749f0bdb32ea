"""How a quarter of a block is divided for the modes of pressure on its contact face."""

from __future__ import annotations

from dataclasses import dataclass

from geometry.meshes import BlockShape
from macro.body.line import Line

_MORE = 6
"""Degree across the face beyond the number of modes. With 4, 6, 8 the free cube's compliance lacks
0.0024, 0.0011 and 0.0009 of its mean, summed over 8 × 8 modes; nearly all of it in the finest."""

_TOP = 2.4
"""Height of the topmost element, in lengths of the face by modes."""
_LOW = 0.05
"""Height of the lowest element, of the block's height or width: the bottom's edges are singular.
With 0.15 the mean compliance of a cube lacks 1.9e-4 at ν = 0.3 and 1.3e-3 at 0.45, with this 0.9e-4
and 4.9e-4."""
_GROWTH = 4.0
"""Height of an element relative to the one above."""
_AT_TOP, _BETWEEN, _AT_BOTTOM = 9, 6, 4
"""Degrees along z."""
_END = 0.75
"""What a clamped end disturbs of a long block, of its width."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Division:
    """Elements of a quarter of a block.

    Args:
        x: Along x, from the middle to the side; its parity does not matter.
        y: Along y.
        z: From the bottom up.
    """

    x: Line
    y: Line
    z: Line


def division(shape: BlockShape, count: int) -> Division:
    """Return elements for modes of pressure.

    Args:
        shape: The block; its cells do not matter.
        count: Modes along a side of the contact face.
    """
    x, y = (_across(length, shape.margin, count) for length in shape.interface)
    return Division(x=x, y=y, z=_upwards(shape, count))


def _across(length: float, margin: float, count: int) -> Line:
    half = 0.5 * length
    if not margin:
        return Line(ticks=(half, length), degrees=(count + _MORE,), parity=0)
    edge = 0.15 * min(half, margin)
    ticks = (half, length - edge, length, length + edge, length + margin)
    return Line(ticks=ticks, degrees=(count + _MORE, 4, 4, 6), parity=0)


def _upwards(shape: BlockShape, count: int) -> Line:
    width, height = max(shape.interface) + 2.0 * shape.margin, shape.height
    step = _TOP * min(shape.interface) / count
    low = height - _LOW * min(height, width)
    depths = [0.0]
    while step < 0.6 * low and depths[-1] < 0.5 * width:
        depths.append(step)
        step *= _GROWTH
    if low - depths[-1] > 2.0 * _END * width:
        depths.append(low - _END * width)
    if len(depths) > 1 or height > step:
        depths.append(low)
    ticks = tuple(-depth for depth in reversed([*depths, height]))
    if len(ticks) == 2:
        return Line(ticks=ticks, degrees=(_AT_TOP,))
    between = (_BETWEEN,) * (len(ticks) - 3)
    return Line(ticks=ticks, degrees=(_AT_BOTTOM, *between, _AT_TOP))
