"""Fields on the cells of a surface by their waves, on a grid as coarse as products of them allow.

Heights times stresses make waves shorter than either. Cells hold waves of two cells and longer.
Shorter products alias to longer waves, which makes the powers of heights in an expansion unstable.
Waves shorter than about three of the coarse cells are therefore left out on the way in and on the
way out, so that the map as a whole stays symmetric.

Theory: docs/theory.md, section 7.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy import fft

from patchlaw.support.arrays import Array
from patchlaw.support.parallel import BLOCK, blocks, cores, in_threads
from patchlaw.support.small_caches import cached_where_small

Around = Literal["copies", "mirrored", "nothing"]


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
        wave_number: |k| of the waves, each for its real and its imaginary part: a product of reals
            is quicker than one with complex numbers. Shape (mx, 2 (my // 2 + 1)) [1/mm].
        directions: k_x²/|k|², k_y²/|k|² and k_x k_y/|k|² likewise, shape (3, mx, 2 (my // 2 + 1));
            their means over all directions where k = 0.
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
        self.wave_number = np.repeat(np.hypot(kx, ky), 2, axis=-1)
        products = np.stack(np.broadcast_arrays(kx * kx, ky * ky, kx * ky))
        trace = products[0] + products[1]
        directions = np.divide(products, trace, out=products, where=trace > 0.0)
        directions[:2, 0, 0] = 0.5
        for axis, count in enumerate(self.padded):
            if count % 2 == 0:  # waves of two cells run either way
                directions[2].swapaxes(0, axis)[count // 2] = 0.0
        self.directions = np.repeat(directions, 2, axis=-1)
        # falls from one to zero between 0.6 and 0.9 of the shortest wave number of coarse cells
        x, y = (np.arange(count) / count for count in coarse)
        radius = np.hypot(x[:, None], y)
        self._filter = np.clip((0.9 - radius) / (0.9 - 0.6), 0.0, 1.0)

    def coarsened(self, field: Array) -> Array:
        """Return a field on the coarse cells, without waves that are too short.

        Waves are those of cosines, so that nothing gets across the rectangle's sides.

        Args:
            field: On the cells of the rectangle, shape (nx, ny).

        Returns:
            Shape (cx, cy).
        """
        (cx, cy), everywhere = self.coarse, self._threads
        rows = fft.dct(field, axis=1, norm="ortho", workers=everywhere)[:, :cy]
        cosines = fft.dct(rows, axis=0, norm="ortho", workers=everywhere)[:cx]
        return np.asarray(fft.idctn(cosines * (self._filter * self._scale), norm="ortho"))

    def refined(self, field: Array) -> Array:
        """Return fields on the cells of the rectangle by those on the coarse cells, (…, cx, cy).

        It is the transpose of `coarsened`, times the number of cells per coarse cell.
        """
        (nx, ny), everywhere = self.grid, self._threads
        cosines = fft.dctn(field, axes=(-2, -1), norm="ortho") * (self._filter / self._scale)
        columns = fft.idct(cosines, n=nx, axis=-2, norm="ortho", workers=everywhere)
        return np.asarray(fft.idct(columns, n=ny, axis=-1, norm="ortho", workers=everywhere))

    @property
    def _threads(self) -> int:
        """Threads of a transform that gains by them."""
        return cores() if self.grid[0] * self.grid[1] > 2**16 else 1

    def continued(self, field: Array) -> Array:
        """Return a field on the coarse cells as it is continued around them, shape (sx, sy)."""
        return np.pad(field, self._beyond, mode="symmetric")

    def alone(self, field: Array) -> Array:
        """Return a field on the coarse cells with zeros around them, shape (sx, sy)."""
        return np.pad(field, self._beyond)

    def changed(
        self,
        fields: Array,
        change: Callable[[Array, slice], Array],
        count: int,
        *,
        inside: bool = False,
    ) -> Array:
        """Return fields whose waves are made of the waves of other fields.

        Waves are changed some columns at a time, in the cache and on all cores. The result does not
        depend on the number of threads.

        Args:
            fields: The other fields, shape (f, sx, sy).
            change: Returns the waves of the fields, shape (count, mx, 2 c), by those of the others,
                (f, mx, 2 c), and by which columns of `wave_number` they are; real and imaginary
                parts take turns. It may overwrite those of the others.
            count: Number of fields that are made.
            inside: Whether they are wanted on the coarse cells alone.

        Returns:
            Shape (count, sx, sy), or (count, cx, cy).
        """
        (mx, my), half = self.padded, self.padded[1] // 2 + 1
        given, high = fields.shape[:2]
        sx, sy = self.coarse if inside else self.shown
        loaded = np.empty((given, high, half), complex)
        made, result = np.empty((count, sx, half), complex), np.empty((count, sx, sy))

        def along_rows(here: slice) -> None:
            loaded[:, here] = fft.rfft(fields[:, here], n=my, axis=2)

        def along_columns(here: slice) -> None:
            waves = fft.fft(loaded[:, :, here], n=mx, axis=1).view(float)
            parts = change(waves, slice(2 * here.start, 2 * here.stop)).view(complex)
            made[:, :, here] = fft.ifft(parts, axis=1, overwrite_x=True)[:, :sx]

        def back_along_rows(here: slice) -> None:
            result[:, here] = fft.irfft(made[:, here], n=my, axis=2)[:, :, :sy]

        in_threads(along_rows, blocks(high, BLOCK // (8 * my * given)))
        in_threads(along_columns, blocks(half, BLOCK // (16 * mx * given)))
        in_threads(back_along_rows, blocks(sx, BLOCK // (8 * my * count)))
        return result


surface_waves = cached_where_small(
    lambda grid, spacing, *, coarse, around: coarse[0] * coarse[1] <= 2**16, most=8
)(Waves)
"""Waves on the cells of a surface, cached for the next surface of the same cells: 20 MB at most."""
