"""Surfaces made from others: the sums of the heights of two that face each other, mirror images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from patchlaw.geometry.materials import Material, MaterialPair
from patchlaw.geometry.plausibility import check_slopes
from patchlaw.geometry.surface import Surface
from patchlaw.support.errors import InputError

_ROUNDING = 1e-9
"""Relative difference of two sides that is rounding."""


def turned_over(surface: Surface) -> Surface:
    """Return a surface as it lies on another one: turned about the y axis.

    Args:
        surface: Heights as measured, facing up.

    Returns:
        Heights at Lx − x, still counted out of the body.
    """
    return replace(surface, heights=surface.heights[::-1])


def laid_on(
    first: Surface, second: Surface, *, shift: tuple[float, float] = (0.0, 0.0), angle: float = 0.0
) -> Surface:
    """Return a surface turned about its middle, then moved, on the cells of another one.

    A quarter of a turn, and a shift of a periodic surface by whole cells, move the heights as they
    are. Else they are those of the interpolant.

    Args:
        first: The surface below, middle on middle without a shift.
        second: The surface that is moved, as it lies on the first, see `turned_over`.
        shift: Way along x and y [mm].
        angle: Turn from x to y, as seen from above [degrees].

    Returns:
        Heights on the grid and sides of ``first``; periodic where the turned surface has its sides
        and is.

    Raises:
        InputError: When a surface that is not periodic does not cover the other one.
    """
    turns = round(angle / 90.0)
    left = np.radians(angle - 90.0 * turns)
    if turns % 4:
        lengths = second.lengths if turns % 2 == 0 else second.lengths[::-1]
        second = replace(second, heights=np.rot90(second.heights, turns), lengths=lengths)
    fits = left == 0.0 and np.allclose(second.lengths, first.lengths, rtol=_ROUNDING, atol=0.0)
    if fits and second.grid == first.grid:
        cells = np.divide(shift, first.spacing)
        whole = np.rint(cells)
        if not whole.any() and not cells.any():
            return second
        if second.periodic and np.allclose(cells, whole, rtol=0.0, atol=_ROUNDING):
            return second.shifted(int(whole[0]), int(whole[1]))
    x = first.x[:, None] - 0.5 * first.lengths[0] - shift[0]
    y = first.y - 0.5 * first.lengths[1] - shift[1]
    along, across = np.cos(left) * x + np.sin(left) * y, np.cos(left) * y - np.sin(left) * x
    heights = second.height_at(along + 0.5 * second.lengths[0], across + 0.5 * second.lengths[1])
    periodic = second.periodic and fits
    return replace(second, heights=heights, lengths=first.lengths, periodic=periodic)


def facing(first: Surface, second: Surface) -> Surface:
    """Return the sum of the heights of two surfaces, which is what closes as they approach.

    Args:
        first: Heights of the lower side.
        second: Heights of the upper side as it lies on the first, see `turned_over`.

    Returns:
        The surface of h(x, y) = h1(x, y) + h2(x, y), periodic where both are.

    Raises:
        InputError: When they have not the same grid and sides, or are too steep together.
    """
    if first.grid != second.grid:
        raise InputError(
            "has not the heights of the surface that it faces",
            value=list(second.grid),
            allowed=f"{list(first.grid)}, by grid or resample",
        )
    if not np.allclose(first.lengths, second.lengths, rtol=_ROUNDING, atol=0.0):
        raise InputError(
            "has not the sides of the surface that it faces",
            value=list(second.lengths),
            allowed=f"{list(first.lengths)} mm, by lengths or crop",
        )
    both = Surface(
        heights=first.heights + second.heights,
        lengths=first.lengths,
        periodic=first.periodic and second.periodic,
        source=f"{first.source}; facing {second.source}",
        notes=(*first.notes, *(f"counter-surface: {note}" for note in second.notes)),
    )
    check_slopes(both, ": these are both sides together")
    return both


def rough_sides(
    surface: Surface, above: Surface | None, materials: MaterialPair
) -> list[tuple[Surface, Material]]:
    """Return the rough sides of elastic bodies, whose slopes count, with their materials.

    Args:
        surface: The heights of both sides together, on any grid.
        above: What of them is the upper side's; None where that is smooth.
        materials: The materials of the lower and of the upper body.
    """
    if above is None:
        return [(surface, materials.first)]
    above = above.on_grid(surface.grid)
    below = replace(surface, heights=surface.heights - above.heights)
    sides = [(below, materials.first)]
    return sides if materials.second is None else [*sides, (above, materials.second)]


def mirrored(surface: Surface) -> Surface:
    """Return a surface with its mirror images beside it, twice as long and wide, periodic.

    A map that is continued as it is has a step all around it, whose ridge carries load. Mirrored
    heights continue without a step; all they have is a crease where the map slopes at its border.

    Args:
        surface: The surface.
    """
    lx, ly = surface.lengths
    row = np.concatenate((surface.heights, surface.heights[::-1]))
    heights = np.concatenate((row, row[:, ::-1]), axis=1)
    source = f"{surface.source}, mirrored" if surface.source else "mirrored"
    return replace(surface, heights=heights, lengths=(2 * lx, 2 * ly), periodic=True, source=source)
