"""Missing heights, filled by the membrane that hangs between the measured ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

from support.errors import InputError

Array = NDArray[np.float64]


def filled(heights: ArrayLike, spacing: tuple[float, float]) -> tuple[Array, float]:
    """Replace missing heights by a membrane that hangs between the others.

    The filled heights minimise ∫ |∇h|² (Laplace's equation, five-point differences), free on the
    border of the grid. They lie between the lowest and the highest of the heights around them, so
    that no summit is invented; a summit that was not measured stays unknown.

    Args:
        heights: Heights, shape (nx, ny) [mm]; missing where not a number.
        spacing: Sides (dx, dy) of a cell [mm].

    Returns:
        The heights, and the share of them that was missing.

    Raises:
        InputError: When all are missing.
    """
    whole = np.array(heights, dtype=np.float64)
    missing = np.isnan(whole)
    if missing.all():
        raise InputError("all heights are missing", allowed="heights to fill gaps from")
    if missing.any():
        whole[missing] = _membrane(whole, missing, spacing)
    return whole, float(missing.mean())


def _membrane(heights: Array, missing: NDArray[np.bool_], spacing: tuple[float, float]) -> Array:
    """Return the heights at the gaps, in the order of the array."""
    number = np.full(heights.shape, -1)
    number[missing] = np.arange(np.count_nonzero(missing))
    ends, others, weights = [], [], []
    for axis, step in enumerate(spacing):
        one = np.moveaxis(np.arange(heights.size).reshape(heights.shape), axis, 0)
        for here, there in ((one[:-1], one[1:]), (one[1:], one[:-1])):
            gap = missing.ravel()[here]
            ends.append(here[gap])
            others.append(there[gap])
            weights.append(np.full(int(gap.sum()), (min(spacing) / step) ** 2))
    cell, other, weight = np.concatenate(ends), np.concatenate(others), np.concatenate(weights)
    row, column, count = number.ravel()[cell], number.ravel()[other], int(missing.sum())
    inside = column >= 0
    right = np.bincount(
        row[~inside],
        weights=weight[~inside] * heights.ravel()[other[~inside]],
        minlength=count,
    )
    diagonal = np.bincount(row, weights=weight, minlength=count)
    entries = np.concatenate((-weight[inside], diagonal))
    rows = np.concatenate((row[inside], np.arange(count)))
    columns = np.concatenate((column[inside], np.arange(count)))
    matrix = coo_matrix((entries, (rows, columns)), shape=(count, count)).tocsc()
    return np.asarray(spsolve(matrix, right))
