"""Elements of high order along a line: integrated Legendre polynomials between the ticks.

On an element, t from −1 to 1, the shapes are (1 ∓ t)/2 and (P_k − P_{k−2}) / √(2(2k − 1)) for
k = 2 … p (Szabó & Babuška 1991, ch. 3): the slopes of the latter are orthogonal, and all matrices
are nearly diagonal. Where a line is symmetric about its start, functions on it are even or odd:
the first element goes on beyond the start, and its shapes are even or odd polynomials alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from geometry.legendre_modes import mode_values

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A line divided into elements.

    Args:
        ticks: Borders of the elements, ascending [mm].
        degrees: Degree of every element, at least 1.
        parity: 0 for functions even about the first tick, 1 for odd ones; None for any function
            that vanishes there.
    """

    ticks: tuple[float, ...]
    degrees: tuple[int, ...]
    parity: int | None = None

    @property
    def unknowns(self) -> NDArray[np.intp]:
        """Element and degree of the shapes, element by element, shape (n, 2).

        The first shape of an element is 1 at its far end and linear on the next; it counts as of
        degree 1.
        """
        found = []
        for element, degree in enumerate(self.degrees):
            inner = range(2, degree + 1)
            if element == 0 and self.parity is not None:
                inner = range(2 + self.parity, degree + 1, 2)
            found += [(element, order) for order in (1, *inner)]
        return np.array(found)

    @property
    def end(self) -> int:
        """The one shape that does not vanish at the last tick, where it is 1."""
        return int(np.flatnonzero(self.unknowns[:, 1] == 1)[-1])

    def sampled(self, points: int) -> Sampled:
        """Return the shapes at the points of Gauss' rule on every element.

        Args:
            points: Number of points on an element.
        """
        nodes, weights = legendre.leggauss(points)
        unknowns = self.unknowns
        first = np.flatnonzero(unknowns[:, 1] == 1)
        values, slopes = np.zeros((2, len(unknowns), len(self.degrees), points))
        places, spread = np.empty((2, len(self.degrees), points))
        for element, (low, high) in enumerate(zip(self.ticks, self.ticks[1:], strict=False)):
            half = 0.5 * (high - low)
            places[element], spread[element] = low + half * (1.0 + nodes), half * weights
            whole = element == 0 and self.parity is not None
            t, half = (0.5 * (1.0 + nodes), 2.0 * half) if whole else (nodes, half)
            shapes, rises = _shapes(t, self.degrees[element])
            if whole:  # 1, or t, goes through both ends
                sign = (1.0, -1.0)[self.parity or 0]
                shapes[1] += sign * shapes[0]
                rises[1] += sign * rises[0]
            elif element:
                values[first[element - 1], element] = shapes[0]
                slopes[first[element - 1], element] = rises[0] / half
            own = np.flatnonzero(unknowns[:, 0] == element)
            values[own, element] = shapes[unknowns[own, 1]]
            slopes[own, element] = rises[unknowns[own, 1]] / half
        flat = len(unknowns), -1
        return Sampled(places.ravel(), spread.ravel(), values.reshape(flat), slopes.reshape(flat))


class Sampled(NamedTuple):
    """Shapes at the points of a rule.

    Attributes:
        points: Shape (m,) [mm].
        weights: Shape (m,) [mm].
        values: Of n shapes at the points, shape (n, m).
        slopes: Shape (n, m) [1/mm].
    """

    points: Array
    weights: Array
    values: Array
    slopes: Array


def mode_integrals(line: Line, length: float, count: int, *, slopes: bool = False) -> Array:
    """Return the integrals of Legendre modes times shapes, shape (modes, n) [mm].

    Args:
        line: Elements from the middle to the end of the modes, its parity given.
        length: Length L of the modes, from 0 [mm].
        count: Modes K, of which those of the line's parity are taken.
        slopes: Whether the slopes of shapes are taken instead, whose parity is the other one.
    """
    rule = line.sampled((max(line.degrees) + count) // 2 + 1)
    parity = ((line.parity or 0) + slopes) % 2
    modes = mode_values(rule.points, length, count)[parity::2]
    return np.asarray((modes * rule.weights) @ (rule.slopes if slopes else rule.values).T)


def _shapes(t: Array, degree: int) -> tuple[Array, Array]:
    """Return shapes and their slopes at places t, by degree: (1 − t)/2, (1 + t)/2, and the rest."""
    polynomials = legendre.legvander(t, max(degree, 1)).T
    k = np.arange(2, degree + 1)[:, None]
    rest = (polynomials[2:] - polynomials[:-2]) / np.sqrt(2.0 * (2.0 * k - 1.0))
    slopes = np.sqrt(k - 0.5) * polynomials[1:-1]
    ends, even = np.stack([1.0 - t, 1.0 + t]) / 2.0, np.full_like(t, 0.5)
    return np.concatenate([ends, rest]), np.concatenate([[-even, even], slopes])
