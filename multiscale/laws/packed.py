"""The laws of all patches at once, packed into arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from multiscale.laws.interpolation import Curves
from multiscale.laws.patch_law import LawPoint, PatchLaw

Array = NDArray[np.float64]

_POINT = slice(0, 2)  # closure and p^(2/3) among the curves


class PatchLaws:
    """N patch laws, evaluated together at one local approach each.

    Args:
        laws: The laws, in the order of the flat patch index.

    Attributes:
        touch: Closures at first touch, infinite where there is nothing to touch, shape (N,) [mm].
        end: Local approaches up to which the laws are valid, shape (N,) [mm].
    """

    def __init__(self, laws: Sequence[PatchLaw]) -> None:
        self._curves = Curves.packed([law.curves for law in laws])
        self._contacts = np.zeros((len(laws), self._curves.left.shape[1]), dtype=np.int64)
        for counts, law in zip(self._contacts, laws, strict=True):
            counts[1 : len(law.contacts) + 1] = law.contacts
        self._reach = np.array([law.reach for law in laws])
        self.touch = np.array([law.touch for law in laws])
        # without rows the local approach is the closure
        self.end = np.array([law.touch if law.is_open else law.approach[-1] for law in laws])

    def along(self, approach: Array) -> LawPoint:
        """Return closures, pressures and their derivatives at local approaches, shape (N,)."""
        return LawPoint.of(*self._curves.at(approach, _POINT))

    def area_fraction(self, approach: Array) -> Array:
        """Return real over nominal contact areas at local approaches, shape (N,)."""
        return np.asarray(np.clip(self._curves.at(approach)[0][2], 0.0, 1.0))

    def separation(self, approach: Array) -> Array:
        """Return mean gaps between plane and displaced surface at local approaches, (N,) [mm]."""
        values, _ = self._curves.at(approach)
        return np.asarray(self._reach - values[0] + values[3])

    def contacts(self, approach: Array) -> NDArray[np.int64]:
        """Return numbers of contacts of the rows at or before local approaches, shape (N,)."""
        return self._contacts[np.arange(len(approach)), self._curves.rows_passed(approach)]
