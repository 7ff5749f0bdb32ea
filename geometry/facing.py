"""Two rough surfaces that face each other, as one surface of the sums of their heights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from geometry.errors import InputError
from geometry.surface import Surface

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


def facing(first: Surface, second: Surface) -> Surface:
    """Return the sum of the heights of two surfaces, which is what closes as they approach.

    Args:
        first: Heights of the lower side.
        second: Heights of the upper side as it lies on the first, see `turned_over`.

    Returns:
        The surface of h(x, y) = h1(x, y) + h2(x, y), periodic where both are.

    Raises:
        InputError: When they have not the same grid and sides.
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
    return Surface(
        heights=first.heights + second.heights,
        lengths=first.lengths,
        periodic=first.periodic and second.periodic,
        source=f"{first.source}; facing {second.source}",
        notes=(*first.notes, *(f"counter-surface: {note}" for note in second.notes)),
    )
