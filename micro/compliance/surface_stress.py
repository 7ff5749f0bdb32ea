"""Stresses in a loaded surface, as a linear map of the pressures on it."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class SurfaceStress(Protocol):
    """Stresses in a flat surface, or a part of them, under pressures on a grid of cells."""

    def stresses(self, pressure: Array) -> Array:
        """Return the stresses in the surface, positive in tension.

        Args:
            pressure: Pressures on the cells, shape (nx, ny) [MPa].

        Returns:
            σ_xx, σ_yy and σ_xy at the centres of the cells, shape (3, nx, ny) [MPa].
        """

    def adjoint(self, fields: Array) -> Array:
        """Apply the transpose of `stresses`.

        Args:
            fields: What σ_xx, σ_yy and σ_xy are multiplied by, shape (3, nx, ny).

        Returns:
            What the pressures are multiplied by, with the same sum, shape (nx, ny).
        """
