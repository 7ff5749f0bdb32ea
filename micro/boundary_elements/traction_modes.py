"""What a finite body adds to a half-space under tractions in all directions, in smooth modes.

Directions are x, y and z, into the body. Modes are those of `micro.boundary_elements.body_modes`,
which has the part of pressures alone.

Theory: docs/theory.md, sections 6 and 15.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from geometry.legendre_modes import mode_means, modes_within
from micro.boundary_elements.mode_matrices import (
    first_modes,
    in_other_modes,
    modes_along,
    sum_of,
    transposed,
)
from micro.boundary_elements.rectangle_modes import direction_modes, half_space_modes
from support.arrays import Array, Indices
from support.errors import InputError


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
class TractionModes:
    """Compliance of the top of a body under tractions, in its Legendre modes.

    Args:
        lengths: Sides (Lx, Ly) of the top [mm].
        matrix: Displacements along x, y and into the body by moments of tractions likewise,
            symmetric, shape (3, 3, K², K²) [mm/N].
        origin: Corner of the top, where the contact face does not start with it [mm].

    Raises:
        InputError: When the matrix is not one of K² modes, not finite or not symmetric.
    """

    lengths: tuple[float, float]
    matrix: Array
    origin: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        matrix, allowed = self.matrix, "finite, symmetric, (3, 3, K², K²), K ≥ 1"
        if matrix.shape != (3, 3, self.count**2, self.count**2):
            problem = "the compliance is not one of K × K modes"
            raise InputError(problem, value=matrix.shape, allowed=allowed)
        apart = float(np.abs(matrix - transposed(matrix)).max())
        if not apart <= 1e-9 * float(np.abs(matrix).max()):
            problem = "the compliance is not finite and symmetric"
            raise InputError(problem, value=apart, allowed=allowed)

    @property
    def count(self) -> int:
        """Modes K along a side."""
        return modes_along(self.matrix)

    def fewer(self, count: int) -> TractionModes:
        """Return the compliance of the first modes alone, which shows how well K modes resolve it.

        Args:
            count: Modes along a side, at most K.
        """
        return TractionModes(self.lengths, first_modes(self.matrix, count), self.origin)

    def within(self, lengths: tuple[float, float]) -> TractionModes:
        """Return the compliance of a rectangle of the top, in modes of its own.

        Args:
            lengths: Sides of the rectangle, whose corner is the origin of the coordinates [mm].
        """
        if lengths == self.lengths and self.origin == (0.0, 0.0):
            return self
        change = modes_within(lengths, self.lengths, self.origin, self.count)
        return TractionModes(lengths, in_other_modes(self.matrix, change))

    def plus(self, other: TractionModes) -> TractionModes:
        """Return the compliance of this body and of another one on the same rectangle.

        Args:
            other: That of the other body, whose modes may be more or fewer.
        """
        return TractionModes(self.lengths, sum_of(self.matrix, other.matrix), self.origin)

    def on(self, borders_x: ArrayLike, borders_y: ArrayLike, *, modulus: float) -> TractionsOnCells:
        """Return the compliance of cells of uniform tractions, by means over the cells.

        Args:
            borders_x: Borders of the cells along x, ascending within the top, (nx + 1,) [mm].
            borders_y: Borders along y, shape (ny + 1,) [mm].
            modulus: Unit of the tractions [MPa].
        """
        x, y = (
            np.asarray(borders, float) - start
            for borders, start in zip((borders_x, borders_y), self.origin, strict=True)
        )
        means = (
            mode_means(at, length, self.count)
            for at, length in zip((x, y), self.lengths, strict=True)
        )
        force = modulus * (x[1] - x[0]) * (y[1] - y[0])
        return TractionsOnCells(self.matrix * force, *means)


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
