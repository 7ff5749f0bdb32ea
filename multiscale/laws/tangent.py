"""The linear system of patches on a block, of which most may carry nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from multiscale.laws.patch_law import LawPoint

Array = NDArray[np.float64]
Patches = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Tangent:
    """Derivative of closures and displacements over the local approaches, shape (N, N).

    The closure of a patch without load follows its approach, and moves no other patch: its column
    is the identity's. The system is dense among the loaded patches alone. Of 64 × 64 patches a
    rough surface loads some hundred, and a solution takes milliseconds instead of seconds.

    Attributes:
        loaded: Patches whose pressure or closure answers otherwise, ascending, shape (L,).
        columns: Their columns, shape (N, L).
    """

    loaded: Patches
    columns: Array

    @classmethod
    def of(cls, point: LawPoint, slope: Callable[[Patches], Array]) -> Tangent:
        """Return the tangent of laws at a point.

        Args:
            point: The laws of N patches.
            slope: Returns the derivatives of the displacements over the local approaches of the
                patches it is given, shape (N, L).
        """
        answers = (point.pressure > 0.0) | (point.dpressure != 0.0) | (point.dclosure != 1.0)
        loaded = np.flatnonzero(answers)
        columns = slope(loaded)
        columns[loaded, np.arange(len(loaded))] += point.dclosure[loaded]
        return cls(loaded, columns)

    @property
    def steepest(self) -> float:
        """Largest sum of the magnitudes of a row."""
        sums = np.abs(self.columns).sum(axis=1)
        idle = np.ones(len(sums))
        idle[self.loaded] = 0.0
        return float((sums + idle).max())

    def solve(self, right: Array) -> Array:
        """Return what the tangent takes to the right-hand sides, shape (N,) or (N, k).

        Raises:
            numpy.linalg.LinAlgError: When it is singular.
        """
        found = np.linalg.solve(self.columns[self.loaded], right[self.loaded])
        result = right - self.columns @ found
        result[self.loaded] = found
        return np.asarray(result)
