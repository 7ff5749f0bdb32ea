"""What the free sides of a block add on the cells of a grid: displacements, and surface stresses.

Pressures are uniform on the cells, and displacements and stresses are their means over them. Along
a side, Fourier's transform takes cells to waves, which do not mix. Across it, sparse matrices take
cells to values at nodes of the distance from the side (`micro.compliance.distance_nodes`).

Theory: demos/theory.md, section 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.sparse import csr_array, hstack

from micro.compliance.distance_nodes import distance_nodes, means_over
from micro.compliance.free_sides import FreeSides

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Waves = NDArray[np.complex128]

_NEAREST = 1.0 / 16.0
"""First node of the distance from a side, in cells."""
_NEAREST_STRESS = 1.0 / 256.0
"""That for stresses: the mean over the cell in a corner of constant pressure then errs by 0.4 % of
the largest stress, with 1/16 by 8 %."""
_SWAPPED = [1, 0, 2]
"""Of σ_xx, σ_yy, σ_xy, those normal to the sides across y, along them and in shear."""
_SHEAR = np.array([-1j, 1j])
"""Shear ~ sin by loads ~ cos; it changes its sign from a side to the opposite one."""


class _SidePair:
    """Two opposite sides; rows of cells lie along them, and continue by zeros to twice the length.

    Args:
        sides: The free sides.
        axis: 0 for the sides across x, 1 across y.
        grid: Cells (nx, ny) between the sides.
        stress: Whether to prepare stresses, three kernels below each other, or displacements.

    Attributes:
        means: Means of the rows' cells from values at the nodes of both sides, shape (rows, 2 a).
        loads: Its transpose.
        kernels: For each wave what loads at the nodes do at the nodes, (waves, a or 3 a, a).
    """

    def __init__(self, sides: FreeSides, axis: int, grid: tuple[int, int], *, stress: bool) -> None:
        length, rows, cells = sides.lengths[axis], grid[axis], grid[1 - axis]
        step, self._period = length / rows, 2 * cells
        nodes = distance_nodes((_NEAREST_STRESS if stress else _NEAREST) * step, length)
        lower = means_over(nodes, np.linspace(0.0, length, rows + 1))
        self.means = csr_array(hstack([lower, lower[::-1]]))
        self.loads = csr_array(self.means.T)
        self._nodes = len(nodes)
        parts = []
        # waves on twice the length of a side that cells take for the same, some running backwards
        for shift in (-self._period, 0, self._period):
            waves = np.arange(cells + 1) + shift
            if stress:
                kernels = sides.stresses(axis, nodes, np.abs(waves))
                kernels[2] *= np.sign(waves)[:, None, None]
                kernel = np.concatenate(kernels, axis=1)
            else:
                kernel = sides.compliance(axis, nodes, np.abs(waves))
            parts.append((step * np.sinc(waves / self._period) ** 2)[:, None, None] * kernel)
        self.kernels = np.sum(parts, axis=0)

    def waves(self, lines: Array) -> Waves:
        """Return the waves of lines (2 a, n) at the nodes of both sides, shape (waves, a, 2)."""
        waves = fft.rfft(lines, self._period, axis=1)
        return np.ascontiguousarray(waves.reshape(2, self._nodes, -1).transpose(2, 1, 0))

    def lines(self, waves: Waves) -> Array:
        """Return lines at the nodes of both sides by their waves, shape (2 a, cells)."""
        by_side = waves.transpose(2, 1, 0).reshape(2 * self._nodes, -1)
        return np.asarray(fft.irfft(by_side, self._period, axis=1)[:, : self._period // 2])


def _multiplied(kernels: Array, waves: Waves) -> Waves:
    """Multiply waves by real matrices, shapes (waves, b, a) and (waves, a, 2), contiguous."""
    return np.matmul(kernels, waves.view(np.float64)).view(np.complex128)


def _pairs(
    sides: FreeSides, spacing: tuple[float, float], *, stress: bool
) -> tuple[_SidePair, _SidePair]:
    """Return the sides across x and those across y, around cells that fill the rectangle."""
    nx, ny = (round(length / step) for length, step in zip(sides.lengths, spacing, strict=True))
    across_x, across_y = (_SidePair(sides, axis, (nx, ny), stress=stress) for axis in (0, 1))
    return across_x, across_y


class SideCells:
    """Compliance that free sides add to the cells where rows and columns cross, for E* = 1.

    Args:
        pairs: The sides across x and those across y.
        rows: Indices of the rows, ascending, shape (r,).
        columns: Indices of the columns, ascending, shape (c,).
    """

    def __init__(self, pairs: tuple[_SidePair, _SidePair], rows: Indices, columns: Indices) -> None:
        self._pairs, self._rows, self._columns = pairs, rows, columns
        self._across_x = _Lines.of(pairs[0], rows, columns)
        self._across_y = _Lines.of(pairs[1], columns, rows)

    def displacement(self, pressure: Array) -> Array:
        """Return the displacements of these cells by pressures on them, shape (r, c) [mm]."""
        found = self._across_x.displacement(pressure)
        return np.asarray(found + self._across_y.displacement(pressure.T).T)

    def among(self, rows: Indices, columns: Indices) -> SideCells:
        """Return some of these rows and columns, by ascending indices among them."""
        return SideCells(self._pairs, self._rows[rows], self._columns[columns])


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """Some cells of some rows along two sides.

    Args:
        pair: The sides.
        near: Means of the rows' cells from values at the nodes, shape (r, 2 a).
        loads: Its transpose.
        place: Places of the cells along the sides, shape (c,).
    """

    pair: _SidePair
    near: csr_array
    loads: csr_array
    place: Indices

    @classmethod
    def of(cls, pair: _SidePair, rows: Indices, cells: Indices) -> _Lines:
        if len(rows) == pair.means.shape[0]:
            return cls(pair, pair.means, pair.loads, cells - cells[0])
        near = pair.means[rows]
        return cls(pair, near, csr_array(near.T), cells - cells[0])

    def displacement(self, pressure: Array) -> Array:
        """Return displacements by pressures, shape (r, c)."""
        lines = np.zeros((self.near.shape[1], self.place[-1] + 1))
        lines[:, self.place] = self.loads @ pressure
        found = self.pair.lines(_multiplied(self.pair.kernels, self.pair.waves(lines)))
        return np.asarray(self.near @ found[:, self.place])


class SideStresses:
    """What free sides add to σ_xx, σ_yy and σ_xy in the surface, by pressures on its cells.

    Args:
        sides: The free sides.
        spacing: Sides (dx, dy) of a cell [mm]; the cells fill the rectangle between the sides.
    """

    def __init__(self, sides: FreeSides, spacing: tuple[float, float]) -> None:
        self._pairs = _pairs(sides, spacing, stress=True)

    def stresses(self, pressure: Array) -> Array:
        """Return σ_xx, σ_yy and σ_xy on the cells, shape (3, nx, ny) [MPa].

        Args:
            pressure: On all cells of the grid, shape (nx, ny) [MPa].
        """
        across_x, across_y = self._pairs
        total = _stresses(across_x, pressure)
        total += _stresses(across_y, pressure.T)[_SWAPPED].transpose(0, 2, 1)
        return total

    def adjoint(self, fields: Array) -> Array:
        """Apply the transpose of `stresses`.

        Args:
            fields: Weights of σ_xx, σ_yy and σ_xy on the cells, shape (3, nx, ny).

        Returns:
            Weights of the pressures, shape (nx, ny).
        """
        across_x, across_y = self._pairs
        turned = fields[_SWAPPED].transpose(0, 2, 1)
        return np.asarray(_adjoint(across_x, fields) + _adjoint(across_y, turned).T)


def _stresses(pair: _SidePair, pressure: Array) -> Array:
    """Return stresses normal to two sides, along them and in shear, shape (3, rows, cells)."""
    found = _multiplied(pair.kernels, pair.waves(pair.loads @ pressure))
    normal, parallel, shear = np.split(found, 3, axis=1)
    return np.stack([pair.means @ pair.lines(part) for part in (normal, parallel, shear * _SHEAR)])


def _adjoint(pair: _SidePair, fields: Array) -> Array:
    """Apply the transpose of `_stresses`, shape (rows, cells)."""
    normal, parallel, shear = (pair.waves(pair.loads @ field) for field in fields)
    waves = np.concatenate([normal, parallel, shear * _SHEAR.conj()], axis=1)
    found = _multiplied(pair.kernels.transpose(0, 2, 1), waves)
    return np.asarray(pair.means @ pair.lines(found))


@lru_cache(maxsize=8)
def side_cells(sides: FreeSides, spacing: tuple[float, float]) -> SideCells:
    """Return all cells between free sides, cached for the next surface between them.

    Args:
        sides: The free sides.
        spacing: Sides (dx, dy) of a cell [mm]; the cells fill the rectangle between the sides.
    """
    pairs = _pairs(sides, spacing, stress=False)
    return SideCells(pairs, *(np.arange(pair.means.shape[0]) for pair in pairs))


side_stresses = lru_cache(maxsize=8)(SideStresses)
