"""Functions along the axes of a block, whose products are its elements.

Elements of high order are Legendre polynomials along every axis, graded in depth; `nodal` are those
of hexahedra.

On an element, t from −1 to 1, the shape functions are (1 ∓ t)/2 and
(P_k − P_{k−2}) / √(2(2k − 1)) for k = 2 … p (Szabó & Babuška 1991, ch. 3). The slopes of the latter
are orthogonal, so that all matrices are nearly diagonal. Across the top there is one element, with
1 and t in place of the first two: its functions are even and odd in turn, as the modes are.

Theory: section 6 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from scipy import linalg

from patchlaw.geometry.legendre_modes import gauss_rule, mode_values
from patchlaw.support.arrays import Array

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

_END = 0.75
"""Distance from the clamped bottom within which a tall block needs finer elements, in widths."""

_AT_TOP, _BETWEEN, _AT_BOTTOM = 9, 6, 4
"""Degrees along z."""


class Line(NamedTuple):
    """Shape functions along one axis, at the points of Gauss' rule on every element.

    Attributes:
        weights: Weights of the points, shape (m,) [mm].
        values: Values of n functions at the points, shape (n, m).
        slopes: Their slopes, shape (n, m) [1/mm].
        last: Their values at the last point of the line, shape (n,).
        modes: Integrals of modes times the functions, shape (modes, n) [mm]; none along z.
        mode_slopes: Integrals of the modes times the slopes of the functions, shape (modes, n).
    """

    weights: Array
    values: Array
    slopes: Array
    last: Array
    modes: Array
    mode_slopes: Array

    def of_parity(self, odd: int) -> Line:
        """Return the even (0) or the odd (1) functions of a line across the top."""
        return self.combined(np.eye(len(self.values))[:, odd::2])

    def held(self) -> Line:
        """Return the functions of one parity that vanish at both ends."""
        return self.combined(np.eye(len(self.values))[:, self.last == 0.0])

    def combined(self, weights: Array) -> Line:
        """Return other functions, sums of these.

        Args:
            weights: Weights of the functions in every sum, shape (n, sums).
        """
        values, slopes, last = (weights.T @ part for part in (self.values, self.slopes, self.last))
        modes, mode_slopes = self.modes @ weights, self.mode_slopes @ weights
        return Line(self.weights, values, slopes, last, modes, mode_slopes)

    def diagonalised(self) -> tuple[Line, Array]:
        """Return functions that are orthonormal, as are their slopes up to length, and its square.

        Returns:
            Functions f with ∫ f_i f_j = δ_ij and ∫ f_i' f_j' = κ_i δ_ij, and κ, shape (n,) [1/mm²].
        """
        if not len(self.values):
            return self, np.zeros(0)
        squares = [(part * self.weights) @ part.T for part in (self.slopes, self.values)]
        stiffness, vectors = linalg.eigh(*squares)
        return self.combined(vectors), np.maximum(stiffness, 0.0)


def across(length: float, degree: int, count: int) -> Line:
    """Return the functions of one element across the whole top, even and odd in turn.

    Args:
        length: Length of the top [mm].
        degree: Degree of the element, larger than the number of modes.
        count: Number of Legendre modes to integrate.
    """
    t, weights = gauss_rule(degree + 1)
    half = 0.5 * length
    values, slopes = _shape_functions(t, degree)
    values[:2], slopes[:2] = [np.ones_like(t), t], [np.zeros_like(t), np.ones_like(t)]
    weights, slopes = half * weights, slopes / half
    modes = mode_values(half * (1.0 + t), length, count) * weights
    odd = np.add.outer(np.arange(count), np.arange(degree + 1)) % 2  # of the product with values
    integrals = np.where(odd, 0.0, modes @ values.T), np.where(odd, modes @ slopes.T, 0.0)
    return Line(weights, values, slopes, (np.arange(degree + 1) < 2) * 1.0, *integrals)


def upwards(ticks: Array, degrees: Sequence[int]) -> Line:
    """Return the functions of elements along z, which vanish at the first tick.

    Args:
        ticks: Borders of the elements, ascending, shape (n + 1,) [mm].
        degrees: Degree of every element, at least 1.
    """
    t, weights = gauss_rule(max(degrees) + 1)
    first = np.cumsum([0, *degrees])  # of every element: the function that is 1 at its upper end
    values, slopes = np.zeros((2, first[-1], len(degrees), len(t)))
    halves = 0.5 * np.diff(ticks)
    for element, (degree, half) in enumerate(zip(degrees, halves, strict=True)):
        shapes, rises = _shape_functions(t, degree)
        own = slice(first[element], first[element + 1])
        values[own, element], slopes[own, element] = shapes[1:], rises[1:] / half
        if element:
            below = first[element - 1]
            values[below, element], slopes[below, element] = shapes[0], rises[0] / half
    flat, none = (len(values), -1), np.empty((0, len(values)))
    return Line(
        np.outer(halves, weights).ravel(),
        values.reshape(flat),
        slopes.reshape(flat),
        (np.arange(len(values)) == first[-2]) * 1.0,
        none,
        none,
    )


def nodal(ticks: Array, degree: int, borders: Array) -> Line:
    """Return the functions of elements of one degree across a top, even and odd in turn.

    Their products are those of hexahedra. Modes are 1 between two borders and 0 elsewhere.

    Args:
        ticks: Borders of the elements, ascending, those of each half mirrored, shape (n + 1,) [mm].
        degree: Degree of the elements, 1 or 2.
        borders: Borders of the modes, ascending, within the ticks, shape (modes + 1,) [mm].
    """
    pieces = np.union1d(ticks, np.clip(borders, ticks[0], ticks[-1]))
    halves, middles = 0.5 * np.diff(pieces), 0.5 * (pieces[1:] + pieces[:-1])
    points, weights = gauss_rule(degree + 1)
    element = np.searchsorted(ticks, middles) - 1
    start, width = ticks[element][:, None], np.diff(ticks)[element][:, None]
    place = (middles[:, None] + np.outer(halves, points) - start) / width  # 0 to 1 in the element
    nodes = np.arange(degree + 1) / degree
    values, slopes = np.zeros((2, degree * (len(ticks) - 1) + 1, *place.shape))
    for k, node in enumerate(nodes):
        shape = np.poly1d(np.delete(nodes, k), r=True)
        shape /= shape(node)
        at = degree * element + k, np.arange(len(element))
        values[at], slopes[at] = shape(place), shape.deriv()(place) / width
    count, last = len(values), np.eye(1, len(values), len(values) - 1)[0]
    own = np.searchsorted(borders, middles) - 1 == np.arange(len(borders) - 1)[:, None]
    areas = np.repeat(own, degree + 1, axis=1) * np.outer(halves, weights).ravel()
    flat = (count, -1)
    values, slopes = values.reshape(flat), slopes.reshape(flat)
    line = Line(
        np.outer(halves, weights).ravel(), values, slopes, last, areas @ values.T, areas @ slopes.T
    )
    mirrored = np.zeros((count, count))
    for k in range(count):
        sign, pair = 1.0 - 2.0 * (k % 2), k // 2
        mirrored[pair, k] = sign
        mirrored[count - 1 - pair, k] = 1.0
    return line.combined(mirrored)


def _shape_functions(t: Array, degree: int) -> tuple[Array, Array]:
    """Return (1 − t)/2, (1 + t)/2 and the functions of degree 2 and more at t, and their slopes."""
    polynomials = legendre.legvander(t, max(degree, 1)).T
    k = np.arange(2, degree + 1)[:, None]
    rest = (polynomials[2:] - polynomials[:-2]) / np.sqrt(2.0 * (2.0 * k - 1.0))
    slopes = np.sqrt(k - 0.5) * polynomials[1:-1]
    ends, even = np.stack([1.0 - t, 1.0 + t]) / 2.0, np.full_like(t, 0.5)
    return np.concatenate([ends, rest]), np.concatenate([[-even, even], slopes])


def block_lines(lengths: tuple[float, float], height: float, count: int) -> tuple[Line, Line, Line]:
    """Return functions for modes of pressure: one element across the top, more along z.

    Args:
        lengths: Sides of the top [mm].
        height: Height of the block [mm].
        count: Modes along a side of the top.

    Returns:
        Functions along x, y and z.
    """
    x, y = (across(length, count + _MORE, count) for length in lengths)
    ticks = levels(lengths, height, count)
    degrees = [_AT_BOTTOM, *(_BETWEEN,) * (len(ticks) - 3), _AT_TOP][-(len(ticks) - 1) :]
    return x, y, upwards(ticks, degrees)


def levels(lengths: tuple[float, float], height: float, count: int) -> Array:
    """Return the borders of the elements along z, ascending [mm].

    Args:
        lengths: Sides of the top [mm].
        height: Height of the block [mm].
        count: Modes along a side of the top.
    """
    width, step = max(lengths), _TOP * min(lengths) / count
    low = height - _LOW * min(height, width)
    depths = [0.0]
    while step < 0.6 * low and depths[-1] < 0.5 * width:
        depths.append(step)
        step *= 4.0
    if low - depths[-1] > 2.0 * _END * width:
        depths.append(low - _END * width)
    if len(depths) > 1 or height > step:
        depths.append(low)
    return -np.array([*depths, height])[::-1]
