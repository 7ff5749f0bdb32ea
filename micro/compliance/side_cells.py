"""What the free sides of a block add on the cells of a grid, by Fourier transforms along them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from micro.compliance.free_sides import FreeSides
from micro.compliance.side_waves import SideWaves, multiplied

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_NEAREST = 1.0 / 16.0
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

    def among(self, rows: Indices, columns: Indices) -> SomeCells:
        """Return the cells where some rows and columns of the grid cross.

        Args:
            rows: Indices of the rows, ascending, shape (r,).
            columns: Indices of the columns, ascending, shape (c,).
        """
        across_x, across_y = self._pairs
        return SomeCells(across_x.among(rows, columns), across_y.among(columns, rows))


@dataclass(frozen=True, slots=True, eq=False)
class SomeCells:
    """Cells under pressure, between the sides across x and those across y.

    Args:
        across_x: Sides across x.
        across_y: Sides across y.
    """

    across_x: _Lines
    across_y: _Lines

    def displacement(self, pressure: Array) -> Array:
        """Return the displacements of these cells by pressures on them, shape (r, c) [mm]."""
        found = self.across_x.displacement(pressure)
        return np.asarray(found + self.across_y.displacement(pressure.T).T)


class _Pair:
    """Two opposite sides; rows of cells lie along them."""

    def __init__(self, sides: FreeSides, axis: int, rows: int, cells: int) -> None:
        self._along = SideWaves(sides.lengths[axis], rows, cells, _NEAREST)
        self._compliance = np.sum(
            [
                shares[:, None, None] * sides.compliance(axis, self._along.nodes, np.abs(waves))
                for waves, shares in self._along.aliases()
            ],
            axis=0,
        )

    def among(self, rows: Indices, cells: Indices) -> _Lines:
        """Return some cells of some rows."""
        means = self._along.means
        near = means if len(rows) == means.shape[0] else means[rows]
        return _Lines(self, near, csr_array(near.T), cells - cells[0])

    def displaced(self, lines: Array) -> Array:
        """Return displacements at the nodes of both sides by loads at them, shape (2 a, n)."""
        found = multiplied(self._compliance, self._along.of(lines))
        return self._along.lines(found)[:, : lines.shape[1]]


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """Some cells of some rows along two sides.

    Args:
        sides: The sides.
        near: Means of the rows' cells from values at the nodes, shape (r, 2 a).
        loads: Its transpose.
        place: Places of the cells along the sides, shape (c,).
    """

    sides: _Pair
    near: csr_array
    loads: csr_array
    place: Indices

    def displacement(self, pressure: Array) -> Array:
        """Return displacements by pressures, shape (r, c)."""
        lines = np.zeros((self.near.shape[1], self.place[-1] + 1))
        lines[:, self.place] = self.loads @ pressure
        return np.asarray(self.near @ self.sides.displaced(lines)[:, self.place])


@lru_cache(maxsize=8)
def side_cells(sides: FreeSides, spacing: tuple[float, float]) -> SideCells:
    """Return the cells of some sides, kept for the next surface between them."""
    return SideCells(sides, spacing)
