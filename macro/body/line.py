"""Elements of high order along a line: integrated Legendre polynomials between the ticks.

On an element, t from −1 to 1, the shapes are (1 ∓ t)/2 and (P_k − P_{k−2}) / √(2(2k − 1)) for
k = 2 … p (Szabó & Babuška 1991, ch. 3): the slopes of the latter are orthogonal, and all matrices
are nearly diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from geometry.legendre_modes import mode_values

Array = NDArray[np.float64]

_NOUGHT = 1e-13
"""Entries below this share of the largest are rounding of integrals that vanish."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A line divided into elements; unknown e p is the value at tick e.

    Args:
        ticks: Borders of the elements, ascending [mm].
        degree: p, at least 1.
    """

    ticks: tuple[float, ...]
    degree: int

    @property
    def count(self) -> int:
        """Number of unknowns."""
        return self.degree * (len(self.ticks) - 1) + 1

    def matrices(self) -> dict[str, csr_matrix]:
        """Return the integrals of products of shapes and slopes, by rows i and columns j.

        ``mass``: N_i N_j [mm]; ``stiffness``: N_i' N_j' [1/mm]; ``slopes of rows``: N_i' N_j, and
        ``slopes of columns``: N_i N_j'.
        """
        points, weights = legendre.leggauss(self.degree + 1)
        values, slopes = self._shapes(points)
        mass, stiffness, mixed = np.zeros((3, self.count, self.count))
        for element, length in enumerate(np.diff(self.ticks)):
            own = np.ix_(*2 * (self._unknowns(element),))
            mass[own] += 0.5 * length * (values * weights) @ values.T
            stiffness[own] += 2.0 / length * (slopes * weights) @ slopes.T
            mixed[own] += (slopes * weights) @ values.T
        return {
            "mass": _sparse(mass),
            "stiffness": _sparse(stiffness),
            "slopes of rows": _sparse(mixed),
            "slopes of columns": _sparse(mixed.T),
        }

    def mode_integrals(self, length: float, count: int) -> Array:
        """Return the integrals of Legendre modes times shapes, shape (modes, unknowns) [mm].

        Args:
            length: Length L of the modes [mm]; elements beyond 0 … L do not count.
            count: Number of modes.
        """
        points, weights = legendre.leggauss((self.degree + count) // 2 + 1)
        values, _ = self._shapes(points)
        found = np.zeros((count, self.count))
        for element, (low, high) in enumerate(zip(self.ticks, self.ticks[1:], strict=False)):
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            if 0.0 < middle < length:
                modes = mode_values(middle + half * points, length, count)
                found[:, self._unknowns(element)] += (modes * (half * weights)) @ values.T
        return found

    def _unknowns(self, element: int) -> NDArray[np.intp]:
        """Return the unknowns of an element: both ticks, then those between."""
        first, last = element * self.degree, (element + 1) * self.degree
        return np.array([first, last, *range(first + 1, last)])

    def _shapes(self, points: Array) -> tuple[Array, Array]:
        """Return shapes and their slopes at points of an element, shape (p + 1, points)."""
        polynomials = legendre.legvander(points, self.degree).T
        k = np.arange(2, self.degree + 1)[:, None]
        rest = (polynomials[2:] - polynomials[:-2]) / np.sqrt(2.0 * (2.0 * k - 1.0))
        slopes = np.sqrt(k - 0.5) * polynomials[1:-1]
        ends, even = np.stack([1.0 - points, 1.0 + points]) / 2.0, np.full_like(points, 0.5)
        return np.concatenate([ends, rest]), np.concatenate([[-even, even], slopes])


def _sparse(matrix: Array) -> csr_matrix:
    large = np.abs(matrix) > _NOUGHT * np.abs(matrix).max()
    return csr_matrix(np.where(large, matrix, 0.0))
