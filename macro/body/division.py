"""How a quarter of a block is divided for the modes of pressure on its contact face."""

from __future__ import annotations

from geometry.meshes import BlockShape
from macro.body.line import Line

_LAYER = 1.5  # width of the elements along the sides, in heights of the block
_NARROW = 0.4  # sides get elements of their own if these are narrower, in half-widths
_TOP = 0.64  # height of the topmost element, in wave lengths of the finest modes
_GROWTH = 3.6
"""Height of an element relative to the one above."""
_BOTTOM = 0.1
"""Height of the lowest element, of the block's height or a third of its width."""
_IN_DEPTH = 4


def division(shape: BlockShape, count: int) -> tuple[Line, Line, Line]:
    """Return elements along x and y, from the middle to the sides, and along z.

    Args:
        shape: The block; its cells do not matter.
        count: Modes along a side of the contact face.
    """
    x, y = (_across(length, shape, count) for length in shape.interface)
    return x, y, Line(ticks=tuple(_depths(shape, count)), degree=_IN_DEPTH)


def _across(length: float, shape: BlockShape, count: int) -> Line:
    half, layer = 0.5 * length, _LAYER * shape.height
    ticks = [half, length]
    if not shape.margin:
        if layer < _NARROW * half:
            ticks.insert(1, length - layer)
        return Line(ticks=tuple(ticks), degree=-(-(count + 2) // (len(ticks) - 1)))
    edge = 0.15 * min(half, shape.margin)
    ticks = [half, length - edge, length, length + edge, length + shape.margin]
    return Line(ticks=tuple(ticks), degree=max(5, -(-(count + 2) // 2)))


def _depths(shape: BlockShape, count: int) -> list[float]:
    width, height = max(shape.interface), shape.height
    low = _BOTTOM * min(height, 3.0 * width)
    depths, step = [0.0], _TOP * width / count
    while step < 0.6 * (height - low):
        depths.append(step)
        step *= _GROWTH
    if height - low > 1.6 * depths[-1]:
        depths.append(height - low)
    return [-depth for depth in reversed([*depths, height])]
