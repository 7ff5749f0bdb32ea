"""Compliances in Legendre modes as matrices, of pressures alone or of all directions of traction.

Their shape is (K², K²), or (3, 3, K², K²) by directions of displacements and tractions. Mode
k K + l varies as mode k along x and l along y.
"""

from __future__ import annotations

import numpy as np

from support.arrays import Array


def modes_along(matrix: Array) -> int:
    """Return the number K of modes along a side.

    Args:
        matrix: The compliance.
    """
    return round(matrix.shape[-1] ** 0.5)


def transposed(matrix: Array) -> Array:
    """Return a compliance with displacements and tractions exchanged.

    Args:
        matrix: The compliance.
    """
    swapped = matrix.swapaxes(-1, -2)
    return swapped if matrix.ndim == 2 else swapped.swapaxes(0, 1)


def first_modes(matrix: Array, count: int) -> Array:
    """Return the part of the first modes.

    Args:
        matrix: The compliance.
        count: Modes along a side, at most K.
    """
    return _of_modes(_by_modes(matrix)[..., :count, :count, :count, :count])


def in_other_modes(matrix: Array, change: Array) -> Array:
    """Return a symmetric compliance in other modes.

    Args:
        matrix: The compliance.
        change: Moments of the modes by those of others, shape (K'², K²).
    """
    found = change @ matrix @ change.T
    return np.asarray(0.5 * (found + transposed(found)))


def sum_of(one: Array, other: Array) -> Array:
    """Return the sum of two compliances, of which one may have fewer modes.

    Args:
        one: A compliance.
        other: Another one.
    """
    count = max(map(modes_along, (one, other)))
    total = np.zeros((*one.shape[:-2], *4 * (count,)))
    for part in (one, other):
        few = modes_along(part)
        total[..., :few, :few, :few, :few] += _by_modes(part)
    return _of_modes(total)


def _by_modes(matrix: Array) -> Array:
    """Return a compliance with an axis for the modes along each side."""
    return matrix.reshape(*matrix.shape[:-2], *4 * (modes_along(matrix),))


def _of_modes(by_modes: Array) -> Array:
    """Return the compliance of which `_by_modes` makes this."""
    count = by_modes.shape[-1]
    return by_modes.reshape(*by_modes.shape[:-4], *2 * (count**2,))
