"""Legendre modes on a rectangle, which expand smooth fields on the contact face; Gauss' rule.

On an interval of length L the modes are P_k(2x/L − 1) √(2k + 1): orthogonal, with mean square 1.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike

from patchlaw.support import Array


@cache
def gauss_rule(count: int) -> tuple[Array, Array]:
    """Return places on [−1, 1] and weights of Gauss' rule, not to be written to, shapes (count,).

    Its eigenvalue problem takes longer than most sums over the places, so it is solved once.

    Args:
        count: Number of places.
    """
    rule = legendre.leggauss(count)
    for values in rule:
        values.flags.writeable = False
    return rule


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


def modes_within(
    lengths: tuple[float, float],
    whole: tuple[float, float],
    origin: tuple[float, float],
    count: int,
) -> Array:
    """Return the modes of a rectangle in those of a part of it.

    On a part of the rectangle its modes are polynomials of the same degrees, so that nothing is
    lost.

    Args:
        lengths: Sides of the part, whose corner is the origin of the coordinates [mm].
        whole: Sides of the rectangle [mm].
        origin: Corner of the rectangle [mm].
        count: Number of modes K along a side.

    Returns:
        Means over the part of its modes times those of the rectangle, shape (K², K²).
    """
    nodes, weights = gauss_rule(count)
    share = 0.5 * (1.0 + nodes)
    along = [
        (0.5 * weights * mode_values(share * inner, inner, count))
        @ mode_values(share * inner - start, length, count).T
        for inner, start, length in zip(lengths, origin, whole, strict=True)
    ]
    return np.kron(*along)


def _norms(count: int) -> Array:
    return np.asarray(np.sqrt(2.0 * np.arange(count) + 1.0)[:, None])
