"""What the free sides of a block add on the cells of a grid, by Fourier transforms along them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.sparse import csr_array, hstack

from micro.distance_nodes import distance_nodes, means_over
from micro.free_sides import FreeSides

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_NEAREST = 0.25
"""First node of the distance from a side, in cells."""


class SideCells:
    """Compliance of cells that free sides add, for E* = 1.

    Pressures are uniform on the cells and displacements are their means over them, so that the
    compliance is symmetric.

    Args:
        sides: The free sides.
        spacing: Sides (dx, dy) of a cell [mm]; the cells fill the rectangle between the sides.
    """

    def __init__(self, sides: FreeSides, spacing: tuple[float, float]) -> None:
        nx, ny = (round(length / step) for length, step in zip(sides.lengths, spacing, strict=True))
        self._pairs = _Pair(sides, 0, nx, ny), _Pair(sides, 1, ny, nx)

    def displacement(self, pressure: Array, rows: Indices, columns: Indices) -> Array:
        """Return displacements of cells by pressures on them, shape (r, c) [mm].

        Args:
            pressure: Pressures on some rows and columns of the grid, shape (r, c).
            rows: Indices of these rows, ascending, shape (r,).
            columns: Indices of the columns, ascending, shape (c,).
        """
        across_x, across_y = self._pairs
        found = across_x.displacement(pressure, rows, columns)
        return np.asarray(found + across_y.displacement(pressure.T, columns, rows).T)


class _Pair:
    """Two opposite sides; rows of cells lie along them."""

    def __init__(self, sides: FreeSides, axis: int, rows: int, cells: int) -> None:
        length = sides.lengths[axis]
        step = length / rows
        nodes = distance_nodes(_NEAREST * step, length)
        lower = means_over(nodes, np.linspace(0.0, length, rows + 1))
        self._rows = csr_array(hstack([lower, lower[::-1]]))
        self._period, self._nodes = 2 * cells, len(nodes)
        waves = np.arange(self._period // 2 + 1)
        self._compliance = np.zeros((len(waves), len(nodes), len(nodes)))
        for shift in (-self._period, 0, self._period):  # short waves that cells take for long ones
            shares = np.sinc((waves + shift) / self._period) ** 2
            seen = sides.compliance(axis, nodes, np.abs(waves + shift))
            self._compliance += step * shares[:, None, None] * seen

    def displacement(self, pressure: Array, rows: Indices, cells: Indices) -> Array:
        """Return displacements by pressures on some cells of some rows."""
        near = self._rows if len(rows) == self._rows.shape[0] else self._rows[rows]
        place = cells - cells[0]
        lines = np.zeros((near.shape[1], place[-1] + 1))
        lines[:, place] = near.T @ pressure
        waves = fft.rfft(lines, self._period, axis=1)
        lines = fft.irfft(self._displaced(waves), self._period, axis=1)
        return np.asarray(near @ lines[:, place])

    def _displaced(self, waves: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Multiply the waves of loads at the nodes of both sides, shape (2 a, w)."""
        by_wave = waves.reshape(2, self._nodes, -1).transpose(2, 1, 0)
        parts = np.ascontiguousarray(by_wave).view(np.float64)  # of both sides, real and imaginary
        found = np.matmul(self._compliance, parts).view(np.complex128)
        return found.transpose(2, 1, 0).reshape(waves.shape)


@lru_cache(maxsize=8)
def side_cells(sides: FreeSides, spacing: tuple[float, float]) -> SideCells:
    """Return the cells of some sides, kept for the next surface between them."""
    return SideCells(sides, spacing)
