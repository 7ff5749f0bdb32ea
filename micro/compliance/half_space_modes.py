"""Compliance and surface stresses of the half-space in the Legendre modes of a rectangle.

With A(s) = ∫ φ_k(x) φ_k'(x + s) dx, and B likewise along y, the moments of a displacement with the
kernel g(s, t) are ∫∫ A B g. Kernels of the half-space are homogeneous: on the triangles s Ly > t Lx
and s Ly < t Lx, with s the length along one and t = s v along the other, they leave polynomials of
s and smooth functions of v, to which Gauss' rules converge at once.

The stresses in the surface are σ_αβ = −2ν p δ_αβ − (1 − 2ν) ∂_α ∂_β φ, with φ the convolution of p
with ln ρ/2π. Integrated by parts once, the moments of ∂_α ∂_β φ are −∫∫ A' B ∂_β ln ρ/2π.

Theory: demos/theory.md, section 4.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from geometry.legendre_modes import mode_slopes, mode_values

Array = NDArray[np.float64]
Part = Callable[[Array, float, int], Array]
"""Function of shifts, the length and the number of modes, with values of shape (shifts, K, K)."""

_MORE = 12
"""Points across a triangle beyond the number of modes: with v = sinh w they leave 1e-11."""


def half_space_modes(lengths: tuple[float, float], count: int) -> Array:
    """Return the displacements into the half-space by modes of pressure, in modes, for E* = 1.

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        (1/A²) ∫∫ φ_m(x) φ_n(x') / (π |x − x'|) dA dA', symmetric, shape (K², K²) [1/mm].
    """
    parts = _products, _products
    matrix = 4.0 / np.pi * _integrated(lengths, count, parts, 1.0, lambda x, _: np.ones_like(x))
    return np.asarray(0.5 * (matrix + matrix.T))


def half_space_stress_modes(
    lengths: tuple[float, float], poisson_ratio: float, count: int
) -> Array:
    """Return the stresses in the half-space's surface by modes of pressure, in modes.

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        poisson_ratio: ν.
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        (1/A²) ∫ φ_m σ_αβ[φ_n] dA of xx, yy and xy, shape (3, K², K²) [1/mm²].
    """
    side = 1.0 - 2.0 * poisson_ratio
    parts = _product_slopes, _products
    xx = -2.0 / np.pi * _integrated(lengths, count, parts, 1.0, lambda x, _: x)
    xy = -2.0 / np.pi * _integrated(lengths, count, parts, -1.0, lambda _, y: y)
    pressure = np.eye(count**2) / (lengths[0] * lengths[1])
    straight = -2.0 * poisson_ratio * pressure - side * xx
    return np.stack([straight, -(1.0 + 2.0 * poisson_ratio) * pressure - straight, -side * xy])


def _integrated(
    lengths: tuple[float, float],
    count: int,
    parts: tuple[Part, Part],
    sign: float,
    weight: Callable[[Array, Array], Array],
) -> Array:
    """Integrate over a quarter of all shifts between two points of the rectangle.

    Args:
        lengths: Sides of the rectangle [mm].
        count: Modes along a side.
        parts: Factors that depend on the shift along x, and along y.
        sign: 1 for the parts of both that keep their value with the sign of the shift, −1 for those
            that change theirs.
        weight: Function of the shift's direction (cos, sin), times 1/ρ.

    Returns:
        Shape (K², K²), over the square of the area.
    """
    total = np.zeros(4 * (count,))
    for along, across, flip in ((0, 1, False), (1, 0, True)):
        # s = L u, t = s v, ρ = s √(1 + v²), ds dt / ρ = ds dv / √(1 + v²) = ds dw
        steep = np.arcsinh(lengths[across] / lengths[along])
        s, weights = _gauss(lengths[along], 2 * count)  # of degree 4 K − 2 in s
        w, others = _gauss(steep, count + _MORE)
        direction = 1.0 / np.cosh(w), np.tanh(w)
        others = others * weight(*(reversed(direction) if flip else direction))
        first = _part(parts[along](s, lengths[along], count), sign) * weights[:, None, None]
        t = np.multiply.outer(s, np.sinh(w))
        second = _part(parts[across](t.ravel(), lengths[across], count), sign)
        second = np.einsum("w,swkl->skl", others, second.reshape(*t.shape, count, count))
        part = np.tensordot(first, second, axes=(0, 0))  # k, k', l, l'
        total += part.transpose(2, 0, 3, 1) if flip else part.transpose(0, 2, 1, 3)
    area = lengths[0] * lengths[1]
    return np.asarray(total.reshape(count**2, count**2) / area**2)


def _part(products: Array, sign: float) -> Array:
    """Return the even part of products with the sign of the shift, or the odd one with −1."""
    return np.asarray(0.5 * (products + sign * products.transpose(0, 2, 1)))


def _products(shifts: Array, length: float, count: int) -> Array:
    """Return ∫ φ_k(x) φ_l(x + s) dx, shape (shifts, K, K) [mm]."""
    return _overlaps(shifts, length, mode_values, count)


def _product_slopes(shifts: Array, length: float, count: int) -> Array:
    """Return the derivatives of `_products` to the shift, shape (shifts, K, K)."""
    ends = mode_values(length - shifts, length, count).T[:, :, None]
    last = mode_values(np.array([length]), length, count)[:, 0]
    return _overlaps(shifts, length, mode_slopes, count) - ends * last


def _overlaps(
    shifts: Array, length: float, there: Callable[[Array, float, int], Array], count: int
) -> Array:
    """Return ∫ φ_k(x) ψ_l(x + s) dx where both are on the interval, shape (shifts, K, K)."""
    nodes, weights = legendre.leggauss(count)
    half = 0.5 * (length - shifts)[:, None]
    x = half * (1.0 + nodes)
    shape = count, len(shifts), count
    first = mode_values(x.ravel(), length, count).reshape(shape).transpose(1, 0, 2)
    second = there((x + shifts[:, None]).ravel(), length, count).reshape(shape)
    return np.asarray((first * (half * weights)[:, None]) @ second.transpose(1, 2, 0))


def _gauss(length: float, count: int) -> tuple[Array, Array]:
    nodes, weights = legendre.leggauss(count)
    return 0.5 * length * (1.0 + nodes), 0.5 * length * weights
