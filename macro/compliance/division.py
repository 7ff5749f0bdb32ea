"""How a quarter of a block is divided for the modes of pressure on its top."""

from __future__ import annotations

from dataclasses import dataclass

from macro.compliance.line import Line

_MORE = 6
"""Degree across the top beyond the number of modes. With 4, 6, 8 the free cube's compliance lacks
0.0024, 0.0011 and 0.0009 of its mean, summed over 8 × 8 modes; nearly all of it in the finest."""

_TOP = 2.4
"""Height of the topmost element, in widths of the top by modes."""
_LOW = 0.05
"""Height of the lowest element, of the block's height or width: the bottom's edges are singular.
With 0.15 the mean compliance of a cube lacks 1.9e-4 at ν = 0.3 and 1.3e-3 at 0.45, with this 0.9e-4
and 4.9e-4."""
_GROWTH = 4.0
"""Height of an element relative to the one above."""
_END = 0.75
"""What a clamped end disturbs of a long block, of its width."""
_AT_TOP, _BETWEEN, _AT_BOTTOM = 9, 6, 4
"""Degrees along z."""
_COARSER = 2
"""Degrees less, across and along z, in a division that tells the error of the usual one."""


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


def division(
    lengths: tuple[float, float], height: float, count: int, *, coarse: bool = False
) -> Division:
    """Return elements for modes of pressure: polynomials across the whole top, graded in depth.

    Args:
        lengths: Sides of the top [mm].
        height: Height of the block [mm].
        count: Modes along a side of the top.
        coarse: Whether to take lower degrees, to tell the error of the usual ones.
    """
    less = _COARSER if coarse else 0
    x, y = (
        Line(ticks=(0.5 * length, length), degrees=(count + _MORE - less,), parity=0)
        for length in lengths
    )
    ticks = _levels(lengths, height, count)
    degrees = [_AT_BOTTOM, *(_BETWEEN,) * (len(ticks) - 3), _AT_TOP][-(len(ticks) - 1) :]
    return Division(
        x=x, y=y, z=Line(ticks=ticks, degrees=tuple(degree - less for degree in degrees))
    )


def _levels(lengths: tuple[float, float], height: float, count: int) -> tuple[float, ...]:
    """Return the borders of the elements along z, ascending [mm]."""
    width, step = max(lengths), _TOP * min(lengths) / count
    low = height - _LOW * min(height, width)
    depths = [0.0]
    while step < 0.6 * low and depths[-1] < 0.5 * width:
        depths.append(step)
        step *= _GROWTH
    if low - depths[-1] > 2.0 * _END * width:
        depths.append(low - _END * width)
    if len(depths) > 1 or height > step:
        depths.append(low)
    return tuple(-depth for depth in reversed([*depths, height]))
