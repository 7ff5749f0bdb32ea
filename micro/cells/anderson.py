"""Anderson's mixing: fixed-point iterations that learn from the changes before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MEMORY = 3


class Anderson:
    """Fixed-point iteration x ← x + r(x), extrapolated from the last few residuals r.

    Source:
        Walker & Ni 2011, doi 10.1137/10078356X, eq. 2.1 in the form of differences.
    """

    def __init__(self) -> None:
        self._points: list[Array] = []
        self._residuals: list[Array] = []

    def next(self, point: Array, residual: Array) -> Array:
        """Return the next point.

        Args:
            point: Where the iteration is, of any shape.
            residual: What a plain step would change, of the same shape.
        """
        self._points = [*self._points, point][-_MEMORY:]
        self._residuals = [*self._residuals, residual][-_MEMORY:]
        if len(self._points) == 1:
            return point + residual
        changes = np.stack([residual - earlier for earlier in self._residuals[:-1]]).reshape(
            len(self._points) - 1, -1
        )
        share = np.linalg.lstsq(changes @ changes.T, changes @ residual.ravel(), rcond=1e-12)[0]
        moved = point + residual
        for part, earlier, change in zip(share, self._points, changes, strict=False):
            moved = moved - part * (point - earlier + change.reshape(point.shape))
        return moved
