"""Elements of high order for a block: Legendre polynomials along every axis, graded in depth.

On an element, t from −1 to 1, the shape functions are (1 ∓ t)/2 and
(P_k − P_{k−2}) / √(2(2k − 1)) for k = 2 … p (Szabó & Babuška 1991, ch. 3). The slopes of the latter
are orthogonal, so that all matrices are nearly diagonal. Functions on a line that is symmetric
about its start are even or odd: its first element extends beyond the start, and has even or odd
polynomials only.

Theory: section 6 of ``demos/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from geometry.legendre_modes import mode_values

Array = NDArray[np.float64]

_MORE = 6
"""Degree across the top beyond the number of modes. With 4, 6 and 8 the compliance of a free cube
was too small by 0.0024, 0.0011 and 0.0009 of its mean, summed over 8 × 8 modes; nearly all of it in
the finest modes."""

_TOP = 2.4
"""Height of the topmost element, relative to the shorter side of the top over the number of
modes."""

_LOW = 0.05
"""Height of the lowest element, relative to the block's height or width; displacements are singular
at the edges of the clamped bottom. With 0.15 the mean compliance of a cube was too small by 1.9e-4
at ν = 0.3 and 1.3e-3 at 0.45, with 0.05 by 0.9e-4 and 4.9e-4."""

_GROWTH = 4.0
"""Height of an element relative to that of the one above."""

_END = 0.75
"""Distance from the clamped bottom within which a tall block needs finer elements, in widths."""

_AT_TOP, _BETWEEN, _AT_BOTTOM = 9, 6, 4
"""Degrees along z."""

_COARSER = 2
"""Degrees less, across and along z, in the division that estimates the error of the usual one."""


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
        """Element and degree of the shape functions, element by element, shape (n, 2).

        The first function of an element is 1 at its far end and linear on the next; it counts as of
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
        """Index of the one shape function that does not vanish at the last tick, where it is 1."""
        return int(np.flatnonzero(self.unknowns[:, 1] == 1)[-1])

    def sampled(self, points: int) -> Sampled:
        """Return the shape functions at the points of Gauss' rule on every element.

        Args:
            points: Number of points on an element.
        """
        nodes, weights = legendre.leggauss(points)
        unknowns = self.unknowns
        first = np.flatnonzero(unknowns[:, 1] == 1)
        values, slopes = np.zeros((2, len(unknowns), len(self.degrees), points))
        at, width = np.empty((2, len(self.degrees), points))
        for element, (low, high) in enumerate(zip(self.ticks, self.ticks[1:], strict=False)):
            half = 0.5 * (high - low)
            at[element], width[element] = low + half * (1.0 + nodes), half * weights
            symmetric = element == 0 and self.parity is not None
            t, half = (0.5 * (1.0 + nodes), 2.0 * half) if symmetric else (nodes, half)
            shapes, rises = _shape_functions(t, self.degrees[element])
            if symmetric:  # the linear function is 1 or t over both halves
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
        return Sampled(at.ravel(), width.ravel(), values.reshape(flat), slopes.reshape(flat))


class Sampled(NamedTuple):
    """Shape functions at the points of a quadrature rule.

    Attributes:
        points: Shape (m,) [mm].
        weights: Shape (m,) [mm].
        values: Values of n functions at the points, shape (n, m).
        slopes: Their slopes, shape (n, m) [1/mm].
    """

    points: Array
    weights: Array
    values: Array
    slopes: Array


def mode_integrals(line: Line, length: float, count: int, *, slopes: bool = False) -> Array:
    """Return the integrals of Legendre modes times shape functions, shape (modes, n) [mm].

    Args:
        line: Elements from the middle to the end of the modes, with a parity.
        length: Length L of the modes, from 0 [mm].
        count: Modes K, of which those of the line's parity are taken.
        slopes: Whether the slopes of the shape functions are taken, whose parity is the opposite.
    """
    rule = line.sampled((max(line.degrees) + count) // 2 + 1)
    parity = ((line.parity or 0) + slopes) % 2
    modes = mode_values(rule.points, length, count)[parity::2]
    return np.asarray((modes * rule.weights) @ (rule.slopes if slopes else rule.values).T)


def _shape_functions(t: Array, degree: int) -> tuple[Array, Array]:
    """Return (1 − t)/2, (1 + t)/2 and the functions of degree 2 and more at t, and their slopes."""
    polynomials = legendre.legvander(t, max(degree, 1)).T
    k = np.arange(2, degree + 1)[:, None]
    rest = (polynomials[2:] - polynomials[:-2]) / np.sqrt(2.0 * (2.0 * k - 1.0))
    slopes = np.sqrt(k - 0.5) * polynomials[1:-1]
    ends, even = np.stack([1.0 - t, 1.0 + t]) / 2.0, np.full_like(t, 0.5)
    return np.concatenate([ends, rest]), np.concatenate([[-even, even], slopes])


class Division(NamedTuple):
    """Elements of a quarter of a block.

    Attributes:
        x: Along x, from the middle to the side; its parity is not used.
        y: Along y.
        z: From the bottom up.
    """

    x: Line
    y: Line
    z: Line


def division(
    lengths: tuple[float, float], height: float, count: int, *, coarse: bool = False
) -> Division:
    """Return elements for modes of pressure: one across the whole top, graded in depth.

    Args:
        lengths: Sides of the top [mm].
        height: Height of the block [mm].
        count: Modes along a side of the top.
        coarse: Whether to take lower degrees, to estimate the error of the usual ones.
    """
    less = _COARSER if coarse else 0
    x, y = (
        Line(ticks=(0.5 * length, length), degrees=(count + _MORE - less,), parity=0)
        for length in lengths
    )
    ticks = _levels(lengths, height, count)
    degrees = [_AT_BOTTOM, *(_BETWEEN,) * (len(ticks) - 3), _AT_TOP][-(len(ticks) - 1) :]
    return Division(x, y, Line(ticks=ticks, degrees=tuple(degree - less for degree in degrees)))


def _levels(lengths: tuple[float, float], height: float, count: int) -> tuple[float, ...]:
    """Return the borders of the elements along z, ascending [mm]."""
    width, step = max(lengths), _TOP * min(lengths) / count
    low = height - _LOW * min(height, width)
    depths = [0.0]
    while step < 0.6 * low and depths[-1] < 0.5 * width:
        depths.append(step)
        step *= _GROWTH
    if low - depths[-1] > 2.0 * _END * width:
        depths.append(low - _END * width)
    if len(depths) > 1 or height > step:
        depths.append(low)
    return tuple(-depth for depth in reversed([*depths, height]))
