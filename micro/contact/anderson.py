"""Anderson's mixing: fixed-point iterations that learn from the changes before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MEMORY = 2
_NOISE = 2.0
"""Change of a residual over the step: more is not the step's doing."""
_DEPENDENT = 1e-2
"""Changes that differ less in direction, times their length, are taken for one."""


class Anderson:
    """Fixed-point iteration x ← x + r(x), extrapolated from the last few residuals r.

    Source:
        Walker & Ni 2011, doi 10.1137/10078356X, eq. 2.1 in the form of differences.
    """

    def __init__(self) -> None:
        self._last: tuple[Array, Array] | None = None
        self._steps: list[tuple[Array, Array]] = []

    def next(self, point: Array, residual: Array) -> Array:
        """Return the next point.

        Args:
            point: Where the iteration is, of any shape.
            residual: What a plain step would change, of the same shape.
        """
        if self._last is not None:
            step, change = point - self._last[0], residual - self._last[1]
            size = float(np.linalg.norm(change))
            if 0.0 < size <= _NOISE * float(np.linalg.norm(step)):
                pair = step / size, change / size  # they shrink by orders of magnitude
                self._steps = [*self._steps, pair][-_MEMORY:]
        self._last = point, residual
        moved = point + residual
        if not self._steps:
            return moved
        changes = np.stack([change.ravel() for _, change in self._steps])
        shares = np.linalg.lstsq(changes.T, residual.ravel(), rcond=_DEPENDENT)[0]
        for share, (moving, changing) in zip(shares, self._steps, strict=True):
            moved = moved - share * (moving + changing)
        return moved
