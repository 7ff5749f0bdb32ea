"""Cubic pieces of a patch law over its local approach, and their inversion for closure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]

ROOT, CLOSURE, AREA, RELIEF = range(4)
"""Columns of the pieces: p^(2/3), closure, area fraction, relief."""

_MOST_STEPS = 60
_ROUNDING = 1e-14
_LEAST_SLOPE = 1e-6  # of closure over approach


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
        pieces: Pieces of the closure, that after row `last` straight, shape (4, n + 1).
        approach: Approaches of the rows, shape (n,) [mm].
        closure: Closures of the rows, increasing up to row `last`, shape (n,) [mm].
        last: Row beyond which the tangent there goes on.
        asked: Closures of any shape [mm].

    Returns:
        Pieces and distances from their first rows [mm]. Newton's steps, halved
        where they would leave the bracket, end at rounding.
    """
    piece = np.searchsorted(closure[: last + 1], asked, side="right")
    start = closure[np.maximum(piece - 1, 0)]
    width = np.concatenate(([np.inf], np.diff(approach), [np.inf]))
    width[last + 1] = np.inf
    c3, c2, c1 = pieces[:3]
    rise = np.concatenate(([0.0], np.diff(closure), [0.0]))
    straight = np.isinf(width) | (rise <= 0.0)
    first = np.where(
        straight, 1.0 / np.maximum(c1, _LEAST_SLOPE), width / np.where(straight, 1.0, rise)
    )
    excess = np.asarray(asked - start)
    cubic = c3[piece], c2[piece], c1[piece]
    low = np.where(piece > 0, 0.0, -np.inf)
    step = _solved(cubic, excess, excess * first[piece], low, width[piece])
    return piece, step


def _solved(
    cubic: tuple[Array, Array, Array], excess: Array, step: Array, low: Array, high: Array
) -> Array:
    """Solve ((c3 x + c2) x + c1) x = excess for x in [low, high], where it grows."""
    c3, c2, c1 = cubic
    for _ in range(_MOST_STEPS):
        miss = ((c3 * step + c2) * step + c1) * step - excess
        slope = (3.0 * c3 * step + 2.0 * c2) * step + c1
        low, high = np.where(miss < 0.0, step, low), np.where(miss > 0.0, step, high)
        better = step - miss / np.maximum(slope, _LEAST_SLOPE)
        outside = (better < low) | (better > high)
        if outside.any():
            better = np.where(outside, 0.5 * (low + high), better)
        change = np.abs(better - step)
        step = better
        if np.all(change <= _ROUNDING * np.abs(step)):
            break
    return np.asarray(step)
