"""Convolution with an even kernel by real fast Fourier transforms in work arrays of its own."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray
from scipy import fft

Field = NDArray[Any]

_CHUNK = 2**15
"""Numbers in a block of rows that is transformed at a time: temporaries stay in the cache."""


class Convolution:
    """Multiplication by a real spectrum, in the precision of that spectrum.

    Rows are transformed block by block into one complex array, in which everything else happens in
    place: no large array is allocated per call. Rows of the padding are never transformed.

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
        self._spectrum, self._work = spectrum, work
        rows = max(1, _CHUNK // padded[1])
        self._blocks = [slice(i, min(i + rows, grid[0])) for i in range(0, grid[0], rows)]

    def __call__(self, field: Field, out: Field) -> Field:
        """Convolve a field.

        Args:
            field: Values on the cells, shape (nx, ny).
            out: Array for the result, shape (nx, ny); may be ``field``.

        Returns:
            ``out``.
        """
        for rows in self._blocks:
            self._work[rows] = fft.rfft(field[rows], n=self.padded[1], axis=1)
        self._work[self.grid[0] :] = 0.0
        work = fft.fft(self._work, axis=0, overwrite_x=True)
        work.real *= self._spectrum
        work.imag *= self._spectrum
        work = fft.ifft(work, axis=0, overwrite_x=True)
        for rows in self._blocks:
            back = fft.irfft(work[rows], n=self.padded[1], axis=1)
            out[rows] = back[:, : self.grid[1]]
        return out
