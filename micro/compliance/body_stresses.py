"""Stresses in its top that a finite body adds to those of the half-space, in modes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.legendre_modes import mode_means

Array = NDArray[np.float64]


class BodyStresses:
    """Smooth stresses in the top of a body, by moments of the pressures on cells of it.

    Pressures with the moments b_n = ∫ p φ_n dA add the stresses Σ φ_m S_mn b_n, of which the cells
    have the means.

    Args:
        lengths: Sides (Lx, Ly) of the top [mm].
        grid: Cells (nx, ny), which fill the top but a margin all around.
        matrix: S of σ_xx, σ_yy and σ_xy; mode k K + l varies as mode k along x and l along y, shape
            (3, K², K²) [1/mm²].
        margin: Width of the margin [mm].

    Raises:
        InputError: When the matrix is not one of K² modes, or not finite.
    """

    def __init__(
        self,
        lengths: tuple[float, float],
        grid: tuple[int, int],
        matrix: ArrayLike,
        margin: float = 0.0,
    ) -> None:
        self._matrix = np.asarray(matrix, float)
        count = int(np.sqrt(self._matrix.shape[-1]) + 0.5)
        if not count or self._matrix.shape != (3, count**2, count**2):
            raise InputError(
                "the stresses are not those of K × K modes",
                value=self._matrix.shape,
                allowed="(3, K², K²), K ≥ 1",
            )
        if not np.all(np.isfinite(self._matrix)):
            raise InputError("the stresses are not finite", value="nan or inf", allowed="numbers")
        borders = [
            np.linspace(margin, length - margin, cells + 1)
            for length, cells in zip(lengths, grid, strict=True)
        ]
        self._x, self._y = (
            mode_means(ticks, length, count) for ticks, length in zip(borders, lengths, strict=True)
        )
        self._cell = float(np.prod([ticks[1] - ticks[0] for ticks in borders]))

    def stresses(self, pressure: Array) -> Array:
        """Return σ_xx, σ_yy and σ_xy on the cells, shape (3, nx, ny) [MPa].

        Args:
            pressure: On all cells, shape (nx, ny) [MPa].
        """
        moments = self._x @ pressure @ self._y.T * self._cell
        amplitudes = (self._matrix @ moments.ravel()).reshape(3, *moments.shape)
        return np.asarray(self._x.T @ amplitudes @ self._y)

    def adjoint(self, fields: Array) -> Array:
        """Apply the transpose of `stresses`.

        Args:
            fields: Weights of σ_xx, σ_yy and σ_xy on the cells, shape (3, nx, ny).

        Returns:
            Weights of the pressures, shape (nx, ny).
        """
        amplitudes = self._x @ fields @ self._y.T
        moments = np.tensordot(amplitudes.reshape(3, -1), self._matrix, axes=2)
        return np.asarray(self._x.T @ moments.reshape(amplitudes.shape[1:]) @ self._y * self._cell)
