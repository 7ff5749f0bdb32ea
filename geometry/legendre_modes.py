"""Legendre modes on a rectangle: what smooth fields on the contact face are expanded in.

On an interval of length L the modes are P_k(2x/L − 1) √(2k + 1): orthogonal, with mean square 1.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

from support.arrays import Array


def mode_values(points: ArrayLike, length: float, count: int) -> Array:
    """Return the modes at points.

    Args:
        points: Abscissae on [0, L], shape (n,) [mm].
        length: L [mm].
        count: Number of modes.

    Returns:
        Shape (count, n).
    """
    t = 2.0 * np.asarray(points, float) / length - 1.0
    return np.asarray(legendre.legvander(t, count - 1).T * _norms(count))


def mode_slopes(points: ArrayLike, length: float, count: int) -> Array:
    """Return the derivatives of the modes at points.

    Args:
        points: Abscissae on [0, L], shape (n,) [mm].
        length: L [mm].
        count: Number of modes.

    Returns:
        Shape (count, n) [1/mm]; from P_{k+1}' = P_{k−1}' + (2k + 1) P_k.
    """
    t = 2.0 * np.asarray(points, float) / length - 1.0
    values = legendre.legvander(t, count - 1).T * (2.0 * np.arange(count) + 1.0)[:, None]
    slopes = np.zeros_like(values)
    for k in range(1, count):
        slopes[k] = values[k - 1] + (slopes[k - 2] if k > 1 else 0.0)
    return np.asarray(slopes * _norms(count) * (2.0 / length))


def mode_means(borders: ArrayLike, length: float, count: int) -> Array:
    """Return the means of the modes over intervals.

    Args:
        borders: Borders of adjoining intervals on [0, L], ascending, shape (n + 1,) [mm].
        length: L [mm].
        count: Number of modes.

    Returns:
        Shape (count, n); from ∫ P_k = (P_{k+1} − P_{k−1}) / (2k + 1).
    """
    t = 2.0 * np.asarray(borders, float) / length - 1.0
    values = legendre.legvander(t, count).T
    integrals = np.empty((count, t.size))
    integrals[0] = t
    k = np.arange(1, count)[:, None]
    integrals[1:] = (values[2:] - values[: count - 1]) / (2.0 * k + 1.0)
    return np.asarray(np.diff(integrals, axis=1) / np.diff(t) * _norms(count))


def _norms(count: int) -> Array:
    return np.asarray(np.sqrt(2.0 * np.arange(count) + 1.0)[:, None])
