"""Stresses in the surface that the free sides of a block add to the half-space's, cell by cell."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from micro.compliance.free_sides import FreeSides
from micro.compliance.side_waves import SideWaves, multiplied

Array = NDArray[np.float64]

_NEAREST = 1.0 / 256.0
"""First node of the distance from a side, in cells; the mean over the cell in a corner of constant
pressure then errs by 0.4 % of the largest stress, with 1/16 by 8 %."""
_SWAPPED = [1, 0, 2]
"""Of σ_xx, σ_yy, σ_xy, those normal to the sides across y, along them and in shear."""
_SHEAR = np.array([-1j, 1j])
"""Shear ~ sin by loads ~ cos; it changes its sign from a side to the opposite one."""


class SideStresses:
    """What free sides add to σ_xx, σ_yy and σ_xy in the surface, by pressures on its cells.

    Pressures are uniform on the cells, and stresses are their means over them.

    Args:
        sides: The free sides.
        spacing: Sides (dx, dy) of a cell [mm]; the cells fill the rectangle between the sides.
    """

    def __init__(self, sides: FreeSides, spacing: tuple[float, float]) -> None:
        nx, ny = (round(length / step) for length, step in zip(sides.lengths, spacing, strict=True))
        self._pairs = _Pair(sides, 0, nx, ny), _Pair(sides, 1, ny, nx)

    def stresses(self, pressure: Array) -> Array:
        """Return σ_xx, σ_yy and σ_xy on the cells, shape (3, nx, ny) [MPa].

        Args:
            pressure: On all cells of the grid, shape (nx, ny) [MPa].
        """
        across_x, across_y = self._pairs
        total = across_x.stresses(pressure)
        total += across_y.stresses(pressure.T)[_SWAPPED].transpose(0, 2, 1)
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
        return np.asarray(across_x.adjoint(fields) + across_y.adjoint(turned).T)


class _Pair:
    """Two opposite sides; rows of cells lie along them."""

    def __init__(self, sides: FreeSides, axis: int, rows: int, cells: int) -> None:
        self._along = SideWaves(sides.lengths[axis], rows, cells, _NEAREST)
        self._loads = csr_array(self._along.means.T)
        parts = []
        for waves, shares in self._along.aliases():
            kernels = shares[:, None, None] * sides.stresses(axis, self._along.nodes, np.abs(waves))
            kernels[2] *= np.sign(waves)[:, None, None]
            parts.append(np.concatenate(kernels, axis=1))
        self._kernels = np.sum(parts, axis=0)  # (waves, 3 a, a)

    def stresses(self, pressure: Array) -> Array:
        """Return stresses normal to the sides, along them and in shear, shape (3, rows, cells)."""
        found = multiplied(self._kernels, self._along.of(self._loads @ pressure))
        normal, parallel, shear = np.split(found, 3, axis=1)
        parts = normal, parallel, shear * _SHEAR
        return np.stack([self._along.means @ self._along.lines(part) for part in parts])

    def adjoint(self, fields: Array) -> Array:
        """Apply the transpose of `stresses`, shape (rows, cells)."""
        normal, parallel, shear = (self._along.of(self._loads @ field) for field in fields)
        waves = np.concatenate([normal, parallel, shear * _SHEAR.conj()], axis=1)
        found = multiplied(self._kernels.transpose(0, 2, 1), waves)
        return np.asarray(self._along.means @ self._along.lines(found))


@lru_cache(maxsize=8)
def side_stresses(sides: FreeSides, spacing: tuple[float, float]) -> SideStresses:
    """Return the stresses by some sides, kept for the next surface between them."""
    return SideStresses(sides, spacing)
