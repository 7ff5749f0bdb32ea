"""Cubic pieces of a patch law over its local approach, and their inversion for closure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]

ROOT, CLOSURE, AREA, RELIEF = range(4)
"""Columns of the pieces: p^(2/3), closure, area fraction, relief."""

_NEWTON_STEPS = 4


def pieces_of(approach: Array, columns: Array) -> Array:
    """Return monotone cubic pieces, the tangent beyond the end and what holds before the touch.

    Args:
        approach: Rows' approaches, increasing, shape (n,) [mm]; n is 0 or at least 2.
        columns: Values in the order of the columns above, shape (n, 4).

    Returns:
        Coefficients, highest power first, over the distance from the piece's first row (the first
        piece, before the touch: from row 0), shape (4, n + 1, 4).
    """
    rows = len(approach)
    pieces = np.zeros((4, rows + 1, 4))
    pieces[2, 0, CLOSURE] = 1.0
    if rows:
        interpolant = PchipInterpolator(approach, columns)
        pieces[:, 1:-1] = interpolant.c
        pieces[2, -1] = interpolant(approach[-1], 1)
        pieces[3, -1] = columns[-1]
        pieces[3, 0, CLOSURE:] = columns[0, CLOSURE:]
    return pieces


def inverted(
    pieces: Array, approach: Array, closure: Array, last: int, asked: Array
) -> tuple[NDArray[np.intp], Array]:
    """Find where the closure takes given values.

    Args:
        pieces: Pieces of the closure, shape (4, n + 1).
        approach: Approaches of the rows, shape (n,) [mm].
        closure: Closures of the rows, increasing up to row `last`, shape (n,) [mm].
        last: Row beyond which the tangent there goes on.
        asked: Closures of any shape [mm].

    Returns:
        Pieces and distances from their first rows [mm]. Newton's steps start from the inverse
        interpolant of third order; bracketed, they end at rounding.
    """
    piece = np.searchsorted(closure[: last + 1], asked, side="right")
    start = closure[np.maximum(piece - 1, 0)]
    width = np.append(np.inf, np.append(np.diff(approach), np.inf))
    width[last + 1] = np.inf
    c3, c2, c1, c0 = np.array(pieces)
    if last + 1 < len(c3) - 1:  # the table turns: go on straight
        c3[last + 1] = c2[last + 1] = 0.0
    a3, a2, a1, wide = c3[piece], c2[piece], c1[piece], width[piece]
    rise = asked - start
    secant = np.append(1.0, np.append(np.diff(closure) / np.diff(approach), 1.0))[piece]
    straight = (a3 == 0.0) & (a2 == 0.0)
    step = rise / np.where(straight, np.maximum(a1, 1e-6), secant)
    for _ in range(_NEWTON_STEPS):
        value = ((a3 * step + a2) * step + a1) * step - rise
        slope = (3.0 * a3 * step + 2.0 * a2) * step + a1
        step = step - value / np.maximum(slope, 1e-6)
        np.minimum(step, wide, out=step)
        np.maximum(step, np.where(piece > 0, 0.0, -np.inf), out=step)
    return piece, step
