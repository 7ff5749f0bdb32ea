"""Displacement by a uniform pressure on a rectangle of the half-space (Love 1929).

Pressure p on a rectangle with half-sides a, b moves the surface point (x, y) by L p/(π E*), where
L(x, y) is the integral of 1/distance over the rectangle [mm].
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError

Array = NDArray[np.float64]


def love_integral(x: ArrayLike, y: ArrayLike, a: ArrayLike, b: ArrayLike) -> Array:
    """Return L(a, b, x, y), the integral of 1/distance from (x, y) over the rectangle [mm].

    Finite everywhere, borders and corners included. The four corner terms cancel far away: the
    relative error is about 1e-16 (r/a)², so 1e-10 at a thousand half-sides.

    Args:
        x: Distance of the point from the centre along x [mm]; all arguments broadcast.
        y: Distance along y [mm].
        a: Half-side along x [mm].
        b: Half-side along y [mm].

    Raises:
        InputError: When a half-side is not positive.

    Source:
        Waddad et al. 2016, eq. 30, doi 10.1016/j.triboint.2015.12.023 (Love 1929).
    """
    x, y, a, b = np.asarray(x, float), np.asarray(y, float), *_half_sides(a, b)
    total = np.zeros(np.broadcast_shapes(x.shape, y.shape, a.shape, b.shape))
    for i, j in product((1, -1), repeat=2):
        total += i * j * corner_integral(x + i * a, y + j * b)
    return total


def love_centre(a: ArrayLike, b: ArrayLike) -> Array:
    """Return L at the centre of the rectangle [mm]; 3.5255 s for a square of side s.

    Args:
        a: Half-side along x [mm].
        b: Half-side along y [mm].

    Raises:
        InputError: When a half-side is not positive.
    """
    return 4.0 * corner_integral(*_half_sides(a, b))


def love_mean(a: ArrayLike, b: ArrayLike) -> Array:
    """Return the mean of L over the rectangle itself [mm]; 2.9732 s for a square of side s.

    Args:
        a: Half-side along x [mm].
        b: Half-side along y [mm].

    Raises:
        InputError: When a half-side is not positive.
    """
    return love_mutual(0.0, 0.0, a, b)


def love_mutual(dx: ArrayLike, dy: ArrayLike, a: ArrayLike, b: ArrayLike) -> Array:
    """Return the mean of L over an equal rectangle whose centre is (dx, dy) away [mm].

    It is the second difference, in x and in y, of the fourfold antiderivative of 1/ρ,
    ½ u² v asinh(v/u) + ½ u v² asinh(u/v) − ρ³/6. Rounding grows as 1e-16 (distance/side)⁴;
    `micro.closed_forms.influence` goes on from there.

    Args:
        dx: Distance of the centres along x [mm]; all arguments broadcast.
        dy: Distance of the centres along y [mm].
        a: Half-side along x [mm].
        b: Half-side along y [mm].

    Raises:
        InputError: When a half-side is not positive.
    """
    dx, dy, a, b = np.asarray(dx, float), np.asarray(dy, float), *_half_sides(a, b)
    total = np.zeros(np.broadcast_shapes(dx.shape, dy.shape, a.shape, b.shape))
    for (i, p), (j, q) in product(((-1, 1.0), (0, -2.0), (1, 1.0)), repeat=2):
        total += p * q * fourfold_integral(dx + 2 * i * a, dy + 2 * j * b)
    return total / (4.0 * a * b)


def corner_integral(u: ArrayLike, v: ArrayLike) -> Array:
    """Return u asinh(v/|u|) + v asinh(u/|v|), whose mixed derivative is 1/sqrt(u² + v²).

    Its differences over the corners of a rectangle give L; continuous, 0 at the origin.

    Args:
        u: Distance along x from the point to the corner [mm].
        v: Distance along y [mm].
    """
    u, v = np.asarray(u, float), np.asarray(v, float)
    return u * _asinh_ratio(v, u) + v * _asinh_ratio(u, v)


def fourfold_integral(u: Array, v: Array) -> Array:
    """Return the antiderivative of 1/sqrt(u² + v²), twice in u and twice in v [mm³]."""
    logs = u * _asinh_ratio(v, u) + v * _asinh_ratio(u, v)
    return 0.5 * u * v * logs - np.hypot(u, v) ** 3 / 6.0


def _asinh_ratio(numerator: Array, denominator: Array) -> Array:
    """Return asinh(n/|d|), or 0 where d is 0: the caller multiplies by d."""
    size = np.abs(denominator)
    shape = np.broadcast_shapes(np.shape(numerator), np.shape(size))
    ratio = np.zeros(shape)
    np.divide(numerator, size, out=ratio, where=size > 1e-290 * np.abs(numerator))
    return np.arcsinh(ratio)


def _half_sides(a: ArrayLike, b: ArrayLike) -> tuple[Array, Array]:
    sides = np.asarray(a, float), np.asarray(b, float)
    for side in sides:
        if not np.all(side > 0.0):
            raise InputError(
                "the half-sides of a rectangle must be positive",
                value=side.tolist(),
                allowed="a > 0, b > 0 in mm",
            )
    return sides
