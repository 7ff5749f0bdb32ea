"""Fields on the cells of a surface as waves, on a grid as coarse as products of them allow.

Heights times stresses make waves shorter than either. Cells hold waves of two cells and longer.
Shorter products alias to longer waves, which makes the powers of heights in an expansion unstable.
Waves shorter than about three of the coarse cells are therefore left out on the way in and on the
way out, so that the map as a whole stays symmetric.

Theory: demos/theory.md, section 7.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from geometry.small_caches import cached_where_small

Array = NDArray[np.float64]
Spectrum = NDArray[np.complex128]
Around = Literal["copies", "mirrored", "nothing"]

_KEPT, _DROPPED = 0.6, 0.9
"""Of the shortest wave number of the coarse cells: kept whole below, left out above."""
_FEW_CELLS = 2**16
"""Coarse cells up to which what belongs to their waves is cached, with 10 MB then."""


class Waves:
    """Waves on a torus of which a rectangle of coarse cells is the whole or a quarter.

    Args:
        grid: Cells (nx, ny) of the rectangle.
        spacing: Sides (dx, dy) of a cell [mm].
        coarse: Coarse cells (cx, cy) that fill the rectangle, nx and ny at most.
        around: What is around the rectangle on the torus: its ``"copies"``, ``"mirrored"`` ones,
            which makes the torus twice as long and wide and continuous, or ``"nothing"``: fields
            of the same torus are zero there.

    Attributes:
        coarse: Coarse cells (cx, cy).
        spacing: Sides of a coarse cell [mm].
        padded: Coarse cells (mx, my) of the torus.
        shown: Coarse cells (sx, sy) that fields have: those of the torus, or of the rectangle with
            nothing around it.
        wave_number: |k| of the waves, shape (mx, my // 2 + 1) [1/mm].
        directions: k_x²/|k|², k_y²/|k|² and k_x k_y/|k|², shape (3, mx, my // 2 + 1); their means
            over all directions where k = 0.
    """

    def __init__(
        self,
        grid: tuple[int, int],
        spacing: tuple[float, float],
        *,
        coarse: tuple[int, int],
        around: Around,
    ) -> None:
        self.grid, self.coarse = grid, coarse
        self.spacing = spacing[0] * grid[0] / coarse[0], spacing[1] * grid[1] / coarse[1]
        self._scale = float(np.sqrt(np.prod(coarse) / np.prod(grid)))  # of orthonormal cosines
        self.padded = coarse if around == "copies" else (2 * coarse[0], 2 * coarse[1])
        self.shown = coarse if around == "nothing" else self.padded
        self._beyond = [(0, more - own) for more, own in zip(self.shown, coarse, strict=True)]
        kx = 2.0 * np.pi * fft.fftfreq(self.padded[0], self.spacing[0])[:, None]
        ky = 2.0 * np.pi * fft.rfftfreq(self.padded[1], self.spacing[1])
        self.wave_number = np.hypot(kx, ky)
        products = np.stack(np.broadcast_arrays(kx * kx, ky * ky, kx * ky))
        trace = products[0] + products[1]
        self.directions = np.divide(products, trace, out=products, where=trace > 0.0)
        self.directions[:2, 0, 0] = 0.5
        for axis, count in enumerate(self.padded):
            if count % 2 == 0:  # waves of two cells run either way
                self.directions[2].swapaxes(0, axis)[count // 2] = 0.0
        # falls from one to zero between two radii of the plane of wave numbers
        x, y = (np.arange(count) / count for count in coarse)
        radius = np.hypot(x[:, None], y)
        self._filter = np.clip((_DROPPED - radius) / (_DROPPED - _KEPT), 0.0, 1.0)

    def coarsened(self, field: Array) -> Array:
        """Return a field on the coarse cells, without waves that are too short.

        Waves are those of cosines, so that nothing gets across the rectangle's sides.

        Args:
            field: On the cells of the rectangle, shape (nx, ny).

        Returns:
            Shape (cx, cy).
        """
        rows = fft.dct(field, axis=1, norm="ortho")[:, : self.coarse[1]]
        cosines = fft.dct(rows, axis=0, norm="ortho")[: self.coarse[0]] * self._filter
        return np.asarray(fft.idctn(cosines * self._scale, norm="ortho"))

    def refined(self, field: Array) -> Array:
        """Return a field on the cells of the rectangle by one on the coarse cells, (cx, cy).

        It is the transpose of `coarsened`, times the number of cells per coarse cell.
        """
        cosines = fft.dctn(field, norm="ortho") * (self._filter / self._scale)
        columns = fft.idct(cosines, n=self.grid[0], axis=0, norm="ortho")
        return np.asarray(fft.idct(columns, n=self.grid[1], axis=1, norm="ortho"))

    def continued(self, field: Array) -> Array:
        """Return a field on the coarse cells as it is continued around them, shape (sx, sy)."""
        return np.pad(field, self._beyond, mode="symmetric")

    def alone(self, field: Array) -> Array:
        """Return a field on the coarse cells with zeros around them, shape (sx, sy)."""
        return np.pad(field, self._beyond)

    def of(self, fields: Array) -> Spectrum:
        """Return the waves of fields, shape (..., sx, sy)."""
        rows = fft.rfft(fields, n=self.padded[1], axis=-1)
        return np.asarray(fft.fft(rows, n=self.padded[0], axis=-2))

    def fields(self, waves: Spectrum) -> Array:
        """Return fields by their waves, shape (..., sx, sy)."""
        rows = fft.ifft(waves, axis=-2)[..., : self.shown[0], :]
        return np.asarray(fft.irfft(rows, n=self.padded[1], axis=-1)[..., : self.shown[1]])


surface_waves = cached_where_small(
    lambda grid, spacing, *, coarse, around: coarse[0] * coarse[1] <= _FEW_CELLS, most=8
)(Waves)
"""Waves on the cells of a surface, cached for the next surface of the same cells."""
