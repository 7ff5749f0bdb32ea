"""Convolution with an even kernel by real fast Fourier transforms in work arrays of its own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

Field = NDArray[Any]
Rows = NDArray[np.intp]

_CHUNK = 2**15
"""Numbers in a block of rows that is transformed at a time: temporaries stay in the cache."""


class Convolution:
    """Multiplication by a real spectrum, in the precision of that spectrum.

    Rows are transformed block by block into one complex array, in which everything else happens in
    place: no large array is allocated per call. Rows that are empty, or not asked for, are never
    transformed.

    Args:
        spectrum: Real half spectrum of the kernel, shape (mx, my // 2 + 1).
        grid: Cells (nx, ny) of the fields.
        padded: Cells (mx, my) of the grid on which the convolution is circular.
        work: Complex array of the spectrum's shape and precision; overwritten by every call.
    """

    def __init__(
        self, spectrum: Field, grid: tuple[int, int], padded: tuple[int, int], work: Field
    ) -> None:
        self.grid, self.padded = grid, padded
        self._factors = np.repeat(spectrum, 2, axis=1)  # of real and imaginary parts
        self._work = work

    def __call__(self, field: Field, rows: Rows | None = None) -> Field:
        """Convolve a field in place.

        Args:
            field: Values on the cells of some rows of the grid, shape (r, ny); overwritten.
            rows: Indices of these rows, shape (r,), zeros being on all others; all rows of the
                grid when not given.

        Returns:
            ``field``, holding the result on the same rows.
        """
        blocks = list(self._blocks(rows))
        self._work[self.grid[0] if rows is None else 0 :] = 0.0
        for here, there in blocks:
            self._work[there] = fft.rfft(field[here], n=self.padded[1], axis=1)
        work = fft.fft(self._work, axis=0, overwrite_x=True)
        parts = work.view(self._factors.dtype)
        np.multiply(parts, self._factors, out=parts)
        work = fft.ifft(work, axis=0, overwrite_x=True)
        for here, there in blocks:
            back = fft.irfft(work[there], n=self.padded[1], axis=1)
            field[here] = back[:, : self.grid[1]]
        return field

    def _blocks(self, rows: Rows | None) -> Iterator[tuple[slice, slice | Rows]]:
        """Yield blocks of rows: where they are in the field and where in the grid."""
        size = max(1, _CHUNK // self.padded[1])
        count = self.grid[0] if rows is None else len(rows)
        for first in range(0, count, size):
            here = slice(first, min(first + size, count))
            yield here, here if rows is None else rows[here]
