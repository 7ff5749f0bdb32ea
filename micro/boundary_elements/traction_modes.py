"""What a finite body adds to a half-space under tractions in all directions, in smooth modes.

Directions are x, y and z, into the body. Modes are those of `micro.boundary_elements.body_modes`,
which has the part of pressures alone.

Theory: docs/theory.md, sections 6 and 15.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from micro.boundary_elements.face_modes import FaceModes
from micro.boundary_elements.rectangle_modes import direction_modes, half_space_modes
from support.arrays import Array, Indices


def half_space_traction_modes(
    lengths: tuple[float, float], poisson_ratio: float, count: int
) -> Array:
    """Return the displacements of a half-space by modes of traction, in modes, for E* = 1.

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        poisson_ratio: ν.
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        Displacements along x, y and into the body by tractions likewise, as in
        `micro.boundary_elements.rectangle_modes.half_space_modes`, shape (3, 3, K², K²) [1/mm].

    Source:
        Johnson, Contact Mechanics (1985), eqs. 3.19 and 3.75.
    """
    kappa = poisson_ratio / (1.0 - poisson_ratio)
    beta = (1.0 - 2.0 * poisson_ratio) / (2.0 * (1.0 - poisson_ratio))
    total = np.zeros((3, 3, count**2, count**2))
    total[2, 2] = half_space_modes(lengths, count)

    def modes(powers: tuple[int, int]) -> Array:
        return direction_modes(lengths, powers, count)

    total[0, 0] = total[2, 2] + kappa * modes((2, 0))
    total[1, 1] = total[2, 2] + kappa * modes((0, 2))
    total[0, 1] = total[1, 0] = kappa * modes((1, 1))
    total[2, 0], total[2, 1] = beta * modes((1, 0)), beta * modes((0, 1))
    total[0, 2], total[1, 2] = -total[2, 0], -total[2, 1]
    return total


@dataclass(frozen=True, slots=True, eq=False)
class TractionModes(FaceModes):
    """Compliance of the top of a body under tractions, in its Legendre modes; see `FaceModes`.

    Its matrix has displacements along x, y and into the body by moments of tractions likewise.
    """

    directions: ClassVar[tuple[int, ...]] = (3, 3)

    def on(self, borders_x: ArrayLike, borders_y: ArrayLike, *, modulus: float) -> TractionsOnCells:
        """Return the compliance of cells of uniform tractions, by means over the cells.

        Args:
            borders_x: Borders of the cells along x, ascending within the top, (nx + 1,) [mm].
            borders_y: Borders along y, shape (ny + 1,) [mm].
            modulus: Unit of the tractions [MPa].
        """
        x, y = self.placed(borders_x, borders_y)
        force = modulus * (x[1] - x[0]) * (y[1] - y[0])
        return TractionsOnCells(self.matrix * force, *self.means(x, y))


@dataclass(frozen=True, slots=True, eq=False)
class TractionsOnCells:
    """A compliance under tractions, in modes, on equal cells of a grid.

    Args:
        matrix: Displacements in modes by forces on cells, shape (3, 3, K², K²) [mm].
        means_x: Means of the modes along x over the cells, shape (K, nx).
        means_y: Means along y, shape (K, ny).
    """

    matrix: Array
    means_x: Array
    means_y: Array

    def displacement(self, tractions: Array) -> Array:
        """Return the displacements along the surface by tractions along it, shape (2, nx, ny) [mm].

        Args:
            tractions: In the unit chosen, shape (2, nx, ny).
        """
        return self._by(tractions, slice(0, 2), slice(0, 2))

    def sideways(self, pressure: Array) -> Array:
        """Return the displacements along the surface by pressures (nx, ny), (2, nx, ny) [mm]."""
        return self._by(pressure[None], slice(0, 2), slice(2, 3))

    def across(self, tractions: Array) -> Array:
        """Return the displacements into the body by tractions (2, nx, ny), shape (nx, ny) [mm]."""
        return self._by(tractions, slice(2, 3), slice(0, 2))[0]

    def among(self, rows: Indices, columns: Indices) -> TractionsOnCells:
        """Return the cells where some rows and columns of the grid cross.

        Args:
            rows: Indices of the rows, shape (r,).
            columns: Indices of the columns, shape (c,).
        """
        return TractionsOnCells(self.matrix, self.means_x[:, rows], self.means_y[:, columns])

    def _by(self, loads: Array, seen: slice, by: slice) -> Array:
        moments = self.means_x @ loads @ self.means_y.T
        flat = moments.reshape(len(loads), -1)
        amplitudes = np.einsum("abmn,bn->am", self.matrix[seen, by], flat, optimize=True)
        amplitudes = amplitudes.reshape(-1, *moments.shape[1:])
        return np.asarray(self.means_x.T @ amplitudes @ self.means_y)
