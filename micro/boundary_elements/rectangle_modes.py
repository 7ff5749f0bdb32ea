"""Compliance and surface stresses in the Legendre modes of a rectangle: half-space, free sides.

With A(s) = ∫ φ_k(x) φ_k'(x + s) dx, and B likewise along y, the moments of a displacement with the
kernel g(s, t) are ∫∫ A B g. Kernels of the half-space are homogeneous: on the triangles s Ly > t Lx
and s Ly < t Lx, with s the length along one and t = s v along the other, they leave polynomials of
s and smooth functions of v, to which Gauss' rules converge at once.

The stresses in the surface are σ_αβ = −2ν p δ_αβ − (1 − 2ν) ∂_α ∂_β φ, with φ the convolution of p
with ln ρ/2π. Integrated by parts once, the moments of ∂_α ∂_β φ are −∫∫ A' B ∂_β ln ρ/2π.

What free sides add is a sum of waves along them, whose means with the modes are Bessel functions,
and across them of values at nodes of the distance from the side.

Theory: docs/theory.md, sections 4 and 5.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy

from patchlaw.geometry.legendre_modes import gauss_rule, mode_slopes, mode_values
from patchlaw.micro.boundary_elements.free_sides import (
    FreeSides,
    distance_nodes,
    gauss_points,
    values_at,
)
from patchlaw.support import Array, Indices, cached_where_small

Part = Callable[[Array, float, int], Array]
"""Function of shifts, the length and the number of modes, with values of shape (shifts, K, K)."""

# matrices of few modes, of 1.3 or 3.8 MB, are cached
_of_few_modes = cached_where_small(lambda *arguments: arguments[-1] <= 20, most=8)


@_of_few_modes
def half_space_modes(lengths: tuple[float, float], count: int) -> Array:
    """Return the displacements into the half-space by modes of pressure, in modes, for E* = 1.

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        (1/A²) ∫∫ φ_m(x) φ_n(x') / (π |x − x'|) dA dA', symmetric, shape (K², K²) [1/mm].
    """
    matrix = direction_modes(lengths, (0, 0), count)
    return np.asarray(0.5 * (matrix + matrix.T))


@_of_few_modes
def direction_modes(lengths: tuple[float, float], powers: tuple[int, int], count: int) -> Array:
    """Return what kernels of a direction displace by modes, in modes.

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        powers: Powers a and b of the kernel cos^a sin^b / (π ρ), with ρ and its direction from the
            load to the point.
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        (1/A²) ∫∫ φ_m(x) φ_n(x') cos^a sin^b / (π ρ) dA dA', shape (K², K²) [1/mm].
    """
    signs = (-1.0) ** powers[0], (-1.0) ** powers[1]
    parts = _products, _products

    def weight(cos: Array, sin: Array) -> Array:
        return signs[0] * signs[1] * 4.0 / np.pi * cos ** powers[0] * sin ** powers[1]

    return _integrated(lengths, count, parts, signs, weight)


@_of_few_modes
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
    xx = -2.0 / np.pi * _integrated(lengths, count, parts, (1.0, 1.0), lambda x, _: x)
    xy = -2.0 / np.pi * _integrated(lengths, count, parts, (-1.0, -1.0), lambda _, y: y)
    pressure = np.eye(count**2) / (lengths[0] * lengths[1])
    straight = -2.0 * poisson_ratio * pressure - side * xx
    return np.stack([straight, -(1.0 + 2.0 * poisson_ratio) * pressure - straight, -side * xy])


def _integrated(
    lengths: tuple[float, float],
    count: int,
    parts: tuple[Part, Part],
    signs: tuple[float, float],
    weight: Callable[[Array, Array], Array],
) -> Array:
    """Integrate over a quarter of all shifts between two points of the rectangle.

    Args:
        lengths: Sides of the rectangle [mm].
        count: Modes along a side.
        parts: Factors that depend on the shift along x, and along y.
        signs: 1 for the part along x that keeps its value with the sign of the shift, −1 for the
            one that changes it; the same along y.
        weight: Function of the shift's direction (cos, sin), times 1/ρ.

    Returns:
        Shape (K², K²), over the square of the area.
    """
    total = np.zeros(4 * (count,))
    for along, across, flip in ((0, 1, False), (1, 0, True)):
        # s = L u, t = s v, ρ = s √(1 + v²), ds dt / ρ = ds dv / √(1 + v²) = ds dw;
        # the integrand is of degree 4 K − 2 in s
        steep = np.arcsinh(lengths[across] / lengths[along])
        s, weights = gauss_points(np.array([0.0, lengths[along]]), 2 * count)
        # with v = sinh w so many points leave 1e-11
        w, others = gauss_points(np.array([0.0, steep]), count + 12)
        direction = 1.0 / np.cosh(w), np.tanh(w)
        others = others * weight(*(reversed(direction) if flip else direction))
        first = _part(parts[along](s, lengths[along], count), signs[along]) * weights[:, None, None]
        t = np.multiply.outer(s, np.sinh(w))
        second = _part(parts[across](t.ravel(), lengths[across], count), signs[across])
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
    nodes, weights = gauss_rule(count)
    half = 0.5 * (length - shifts)[:, None]
    x = half * (1.0 + nodes)
    shape = count, len(shifts), count
    first = mode_values(x.ravel(), length, count).reshape(shape).transpose(1, 0, 2)
    second = there((x + shifts[:, None]).ravel(), length, count).reshape(shape)
    return np.asarray((first * (half * weights)[:, None]) @ second.transpose(1, 2, 0))


@_of_few_modes
def side_modes(sides: FreeSides, count: int) -> Array:
    """Return the displacements that free sides add by modes of pressure, in modes, for E* = 1.

    Args:
        sides: The free sides.
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        (1/A²) ∫∫ φ_m S φ_n dA dA', symmetric, shape (K², K²) [1/mm].
    """
    matrix = _sum(sides, count, stress=False)[0]
    return np.asarray(0.5 * (matrix + matrix.T))


@_of_few_modes
def side_stress_modes(sides: FreeSides, count: int) -> Array:
    """Return the stresses in the surface that free sides add by modes of pressure, in modes.

    Args:
        sides: The free sides.
        count: Modes K along a side; mode k K + l is k along x, l along y.

    Returns:
        (1/A²) ∫ φ_m σ_αβ[φ_n] dA of xx, yy and xy, shape (3, K², K²) [1/mm²].
    """
    return _sum(sides, count, stress=True)


def _sum(sides: FreeSides, count: int, *, stress: bool) -> Array:
    """Return the displacements, or the stresses xx, yy and xy, by all sides in modes."""
    across_x = _by_two(sides, 0, count, stress=stress).transpose(0, 1, 3, 2, 4)
    across_y = _by_two(sides, 1, count, stress=stress).transpose(0, 3, 1, 4, 2)
    total = across_x + (across_y[[1, 0, 2]] if stress else across_y)
    area = sides.lengths[0] * sides.lengths[1]
    return np.asarray(total.reshape(len(total), count**2, count**2) / area**2)


def _by_two(sides: FreeSides, axis: int, count: int, *, stress: bool) -> Array:
    """Return what two opposite sides add, by modes across them and along.

    Returns:
        Displacements, or the stresses normal to the sides, along them and in shear, in front; shape
        (1 or 3, k, k', l, l').
    """
    # waves are left out as the cube of their length
    length, waves = sides.lengths[axis], np.arange(8 * count)
    nodes = distance_nodes(length / 1024.0 / count**2, length)
    loads = _integrals(nodes, length, count)
    if stress:
        kernels = sides.stresses(axis, nodes, waves)
    else:
        kernels = sides.compliance(axis, nodes, waves)[None]
    lines = zip(loads @ kernels @ loads.T, (1.0, 1.0, -1.0), strict=False)
    return np.stack([_along(sides, axis, part, far) for part, far in lines])


def _along(sides: FreeSides, axis: int, lines: Array, far: float) -> Array:
    """Sum waves along two opposite sides.

    Args:
        sides: The free sides.
        axis: 0 for sides across x, 1 across y.
        lines: By waves, modes across the sides and modes of loads across them, shape (w, k, k').
        far: 1 for what the opposite side does as this one; −1 for shear, which changes its sign
            there, and is a sine where the load is a cosine, and −cos where it is a sine.

    Returns:
        Shape (k, k', l, l').
    """
    length, count = sides.lengths[1 - axis], lines.shape[1]
    waves = np.arange(len(lines))
    # cosine series of period 2 L, of which the load takes one half
    lines = lines * np.where(waves == 0, 0.5, 1.0)[:, None, None] / length
    parity = np.arange(count) % 2
    low, high = sides.pair(axis)
    lines *= float(low) + high * far * np.where(parity[:, None] == parity, 1.0, -1.0)
    cosines, sines = _waves(waves, count) * length
    seen = (cosines, sines) if far > 0.0 else (sines, -cosines)
    both = sum(
        np.einsum("kw,lw->wkl", one, load) for one, load in zip(seen, (cosines, sines), strict=True)
    )
    return np.tensordot(lines, both, axes=(0, 0))


def _waves(waves: Indices, count: int) -> Array:
    """Return means of the modes times cos and sin πw(x/L − 1/2), shape (2, K, waves).

    ∫ P_k(t) exp(i z t) dt = 2 iᵏ j_k(z).
    """
    k = np.arange(count)[:, None]
    bessel = np.sqrt(2.0 * k + 1.0) * scipy.special.spherical_jn(k, 0.5 * np.pi * waves)
    phase = 1j**k
    return np.stack([bessel * phase.real, bessel * phase.imag])


def _integrals(nodes: Array, length: float, count: int) -> Array:
    """Return the integrals of modes times the interpolation from nodes, shape (K, nodes) [mm]."""
    ticks = np.concatenate([[0.0], nodes[nodes < length], [length]])
    x, weights = gauss_points(ticks, count // 2 + 4)
    modes = mode_values(x, length, count) * weights
    return np.asarray((values_at(nodes, x).T @ modes.T).T)
