"""Fixed-point iterations x ← x + part · change, the part chosen from the last two changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_FIRST = 0.6
_LEAST, _MOST = 0.2, 1.0


class Relaxation:
    """Damping after Irons and Tuck: the secant through the last two changes.

    Source:
        Irons & Tuck, Int. J. Numer. Meth. Eng. 1 (1969) 275, doi 10.1002/nme.1620010306.
    """

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Start anew, where the iteration has become another one."""
        self._part = _FIRST
        self._last: NDArray[np.float64] = np.empty(0)

    def next(self, point: Array, change: Array) -> Array:
        """Return the next point.

        Args:
            point: Where the iteration is, shape (n,).
            change: What a full step would change, shape (n,).
        """
        if self._last.size == change.size:
            difference = change - self._last
            scale = float(difference @ difference)
            part = -self._part * float(self._last @ difference) / scale if scale > 0.0 else _FIRST
            self._part = float(np.clip(part, _LEAST, _MOST))
        self._last = change
        return point + self._part * change
