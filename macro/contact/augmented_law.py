"""The augmented law p = ⟨p₀ + k d⟩ of the quadrature points of a rough top."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class AugmentedLaw:
    """Pressures of this rank's quadrature points over their closures; a `ContactLaw`.

    Args:
        rest: Distances of the points from the plane at no approach and no tilt, shape (n,) [mm].

    Attributes:
        rest: As given.
        slope: Stiffness k of the points, shape (n,) [MPa/mm].
        multiplier: Pressures p₀ where they are just touched, shape (n,) [MPa].
    """

    def __init__(self, rest: Array) -> None:
        self.rest = rest
        self.slope, self.multiplier = np.zeros_like(rest), np.zeros_like(rest)

    def pressure(self, closure: Array) -> Array:
        """Return the pressures, shape (n,) [MPa]."""
        return np.maximum(self.multiplier + self.slope * (closure - self.rest), 0.0)

    def stiffness(self, closure: Array) -> Array:
        """Return their derivatives, shape (n,) [MPa/mm]."""
        return np.where(self.pressure(closure) > 0.0, self.slope, 0.0)


def facet_sizes(cell: NDArray[np.int32], weight: Array) -> Array:
    """Return the size of the facet that every point lies on, shape (n,) [mm].

    Args:
        cell: Cell behind each point, which has one facet on the top, shape (n,).
        weight: Weights of the points, shape (n,) [mm²].
    """
    _, at = np.unique(cell, return_inverse=True)
    return np.sqrt(np.bincount(at, weights=weight))[at] if len(at) else np.empty(0)
