"""What a finite body adds to the half-space at its contact face, as a matrix over smooth modes.

The body's displacement under pressures p on its face is that of the half-space and a smooth rest

    u_c(x) = Σ_mn φ_m(x) D_mn ∫ p φ_n dA,

φ the products of Legendre modes along both sides of the face (`geometry.legendre_modes`) and D
small and symmetric. On cells it is two thin products along each axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.legendre_modes import mode_means, mode_values

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyModes:
    """The smooth rest of a body in K × K modes of its contact face.

    Args:
        lengths: Sides (Lx, Ly) of the face [mm].
        matrix: D, displacement in mode m by a unit moment of the pressures in mode n, the mode
            (k, l) along x and y at k K + l, symmetric, shape (K², K²) [mm/N].

    Raises:
        InputError: When the matrix is not of this shape, finite and symmetric.
    """

    lengths: tuple[float, float]
    matrix: Array

    def __post_init__(self) -> None:
        matrix = self.matrix
        count = int(round(np.sqrt(len(matrix))))
        if matrix.shape != (count**2, count**2) or not np.isfinite(matrix).all():
            raise InputError(
                "the modes of a body need a finite square matrix",
                value=matrix.shape,
                allowed="(K², K²)",
            )
        if not np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-12 * np.abs(matrix).max()):
            raise InputError("the matrix over the modes is not symmetric", value="asymmetric")

    @cached_property
    def count(self) -> int:
        """Number K of modes along each side."""
        return int(round(np.sqrt(len(self.matrix))))

    def on(self, borders_x: Array, borders_y: Array) -> ModesOnCells:
        """Return the rest on cells, loaded and displaced in their means.

        Args:
            borders_x: Borders of the cells along x, shape (nx + 1,) [mm].
            borders_y: Borders along y, shape (ny + 1,) [mm].
        """
        over_x = mode_means(borders_x, self.lengths[0], self.count)
        over_y = mode_means(borders_y, self.lengths[1], self.count)
        area = float((borders_x[1] - borders_x[0]) * (borders_y[1] - borders_y[0]))
        return ModesOnCells(over_x, over_y, self.matrix * area)

    def between(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the displacements of points by unit forces at points, shape (n, n) [mm/N].

        Args:
            x: Abscissae, shape (n,) [mm].
            y: Ordinates, shape (n,) [mm].
        """
        values = self._at(x, y)
        return np.asarray(values.T @ self.matrix @ values)

    def _at(self, x: ArrayLike, y: ArrayLike) -> Array:
        along_x = mode_values(x, self.lengths[0], self.count)
        along_y = mode_values(y, self.lengths[1], self.count)
        return np.asarray((along_x[:, None] * along_y[None]).reshape(self.count**2, -1))


@dataclass(frozen=True, slots=True, eq=False)
class ModesOnCells:
    """The smooth rest on equal cells.

    Args:
        over_x: Means of the modes over the cells along x, shape (K, nx).
        over_y: Means along y, shape (K, ny).
        matrix: D times the area of a cell, shape (K², K²) [mm/MPa].
    """

    over_x: Array
    over_y: Array
    matrix: Array

    def displacement(self, pressure: Array, rows: Indices | None = None) -> Array:
        """Return the mean displacements of cells by pressures on them.

        Args:
            pressure: Pressures on all cells of some rows, shape (r, ny) [MPa].
            rows: Indices of these rows, zeros being on all others; all rows when not given.

        Returns:
            Displacements of the cells of these rows, shape (r, ny) [mm].
        """
        over_x = self.over_x if rows is None else self.over_x[:, rows]
        moments = over_x @ (pressure @ self.over_y.T)
        modes = (self.matrix @ moments.ravel()).reshape(moments.shape)
        return np.asarray((over_x.T @ modes) @ self.over_y)
