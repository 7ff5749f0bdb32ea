"""Cells between two opposite free sides as waves along them, at nodes of the distance from each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.sparse import csr_array, hstack

from micro.compliance.distance_nodes import distance_nodes, means_over

Array = NDArray[np.float64]
Waves = NDArray[np.complex128]
Numbers = NDArray[np.intp]


class SideWaves:
    """Two opposite sides; rows of cells lie along them, and continue by zeros to twice the length.

    Args:
        length: Distance of the sides [mm].
        rows: Rows of cells between the sides.
        cells: Cells in a row.
        nearest: First node of the distance from a side, in rows.

    Attributes:
        nodes: Distances from a side, shape (a,) [mm].
        means: Means of the rows' cells from values at the nodes of both sides, shape (rows, 2 a).
    """

    def __init__(self, length: float, rows: int, cells: int, nearest: float) -> None:
        self._step, self._period = length / rows, 2 * cells
        self.nodes = distance_nodes(nearest * self._step, length)
        lower = means_over(self.nodes, np.linspace(0.0, length, rows + 1))
        self.means = csr_array(hstack([lower, lower[::-1]]))

    def aliases(self) -> Iterator[tuple[Numbers, Array]]:
        """Yield the waves on twice the length of a side that cells take for the same.

        Yields:
            Numbers of waves, shape (cells + 1,), negative where they run backwards; and what of a
            kernel per length [mm] between the nodes, averaged over cells, goes to each of them.
        """
        waves = np.arange(self._period // 2 + 1)
        for shift in (-self._period, 0, self._period):
            yield waves + shift, self._step * np.sinc((waves + shift) / self._period) ** 2

    def of(self, lines: Array) -> Waves:
        """Return the waves of lines at the nodes of both sides.

        Args:
            lines: Shape (2 a, n), n cells at most.

        Returns:
            Shape (waves, a, 2), the sides last.
        """
        waves = fft.rfft(lines, self._period, axis=1)
        return np.ascontiguousarray(waves.reshape(2, len(self.nodes), -1).transpose(2, 1, 0))

    def lines(self, waves: Waves) -> Array:
        """Return lines at the nodes of both sides, shape (2 a, cells), by waves as of `of`."""
        by_side = waves.transpose(2, 1, 0).reshape(2 * len(self.nodes), -1)
        return np.asarray(fft.irfft(by_side, self._period, axis=1)[:, : self._period // 2])


def multiplied(kernels: Array, waves: Waves) -> Waves:
    """Multiply waves by real matrices, shapes (waves, b, a) and (waves, a, 2), contiguous."""
    return np.matmul(kernels, waves.view(np.float64)).view(np.complex128)
