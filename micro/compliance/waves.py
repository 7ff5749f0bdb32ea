"""Fields on the cells of a surface as waves, on a grid as coarse as products of them allow.

Heights times stresses make waves shorter than either. Cells hold waves of two cells and longer;
products that fall below come back as others, which makes the powers of heights in an expansion
unstable. Waves shorter than three of the coarse cells are therefore left out on the way in, and
on the way out, so that the map as a whole stays symmetric.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

Array = NDArray[np.float64]
Spectrum = NDArray[np.complex128]

_KEPT, _DROPPED = 0.6, 0.9
"""Of the shortest wave number of the coarse cells: kept whole below, left out above."""


class Waves:
    """Waves on a padded torus around a grid of cells.

    Args:
        grid: Cells (nx, ny) of the fields.
        spacing: Sides (dx, dy) of a cell [mm].
        periodic: Whether fields continue periodically. Otherwise the torus has twice the
            rectangle's sides, with zeros around it.
        ratio: Cells per coarse cell along either axis; it divides nx and ny.

    Attributes:
        coarse: Coarse cells (cx, cy) of the rectangle.
        padded: Coarse cells (mx, my) of the torus.
        spacing: Sides of a coarse cell [mm].
        wave_number: |k| of the waves, shape (mx, my // 2 + 1) [1/mm].
        directions: k_x²/|k|², k_y²/|k|² and k_x k_y/|k|², shape (3, mx, my // 2 + 1); their means
            over all directions where k = 0.
    """

    def __init__(
        self, grid: tuple[int, int], spacing: tuple[float, float], *, periodic: bool, ratio: int
    ) -> None:
        self.grid = grid
        self.coarse = grid[0] // ratio, grid[1] // ratio
        self.padded = self.coarse if periodic else _padded(self.coarse)
        self.spacing = spacing[0] * ratio, spacing[1] * ratio
        self._fine = self.padded[0] * ratio, self.padded[1] * ratio
        kx = 2.0 * np.pi * fft.fftfreq(self.padded[0], self.spacing[0])[:, None]
        ky = 2.0 * np.pi * fft.rfftfreq(self.padded[1], self.spacing[1])
        self.wave_number = np.hypot(kx, ky)
        self.directions = _directions(kx, ky)
        self._enter = _filter(kx * self.spacing[0], ky * self.spacing[1]) / ratio**2
        if ratio > 1:  # centres of coarse cells lie between those of cells
            back = 0.5 * (1.0 - 1.0 / ratio)
            self._enter = self._enter * np.exp(
                1j * back * (kx * self.spacing[0] + ky * self.spacing[1])
            )
        self._leave = np.conj(self._enter) * ratio**4

    def entering(self, field: Array) -> Spectrum:
        """Return the waves of a field on the cells, shape (nx, ny), those too short left out."""
        columns = self.padded[1] // 2 + 1
        rows = fft.rfft(field, n=self._fine[1], axis=1)[:, :columns]
        full = fft.fft(rows, n=self._fine[0], axis=0)
        half = (self.padded[0] + 1) // 2
        kept = np.concatenate([full[:half], full[full.shape[0] - self.padded[0] + half :]])
        return np.asarray(kept * self._enter)

    def leaving(self, waves: Spectrum) -> Array:
        """Return the field on the cells that waves make up, shape (nx, ny)."""
        half = (self.padded[0] + 1) // 2
        full = np.zeros((self._fine[0], waves.shape[1]), complex)
        kept = waves * self._leave
        full[:half] = kept[:half]
        full[self._fine[0] - self.padded[0] + half :] = kept[half:]
        rows = fft.ifft(full, axis=0, overwrite_x=True)[: self.grid[0]]
        return np.asarray(fft.irfft(rows, n=self._fine[1], axis=1)[:, : self.grid[1]])

    def fields(self, waves: Spectrum) -> Array:
        """Return fields on the coarse cells of the rectangle, shape (..., cx, cy)."""
        rows = fft.ifft(waves, axis=-2)[..., : self.coarse[0], :]
        return np.asarray(fft.irfft(rows, n=self.padded[1], axis=-1)[..., : self.coarse[1]])

    def of(self, fields: Array) -> Spectrum:
        """Return the waves of fields on the coarse cells, shape (..., cx, cy)."""
        rows = fft.rfft(fields, n=self.padded[1], axis=-1)
        return np.asarray(fft.fft(rows, n=self.padded[0], axis=-2, overwrite_x=True))


def _padded(coarse: tuple[int, int]) -> tuple[int, int]:
    mx, my = (int(fft.next_fast_len(2 * count, real=True)) for count in coarse)
    return mx, my


def _directions(kx: Array, ky: Array) -> Array:
    squared = kx**2 + ky**2
    inverse = np.divide(1.0, squared, out=np.zeros_like(squared), where=squared > 0.0)
    found = np.stack([kx * kx * inverse, ky * ky * inverse, kx * ky * inverse])
    found[:2, 0, 0] = 0.5
    return found


def _filter(x: Array, y: Array) -> Array:
    """Fall from one to zero between two radii; x and y are wave numbers times sides of cells."""
    radius = np.hypot(x, y) / np.pi
    return np.clip((_DROPPED - radius) / (_DROPPED - _KEPT), 0.0, 1.0)
