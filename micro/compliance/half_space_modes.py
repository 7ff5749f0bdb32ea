"""Compliance of the half-space in the Legendre modes of a rectangle.

With A(s) = ∫ φ_k(x) φ_k'(x + s) dx, and B likewise along y, the moments of a displacement with the
kernel g(s, t) are ∫∫ A B g. Kernels of the half-space are homogeneous: on the triangles s Ly > t Lx
and s Ly < t Lx, with s the length along one and t = s v along the other, they leave polynomials of
s and smooth functions of v, to which Gauss' rules converge at once.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from geometry.legendre_modes import mode_values

Array = NDArray[np.float64]

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
    total = np.zeros(4 * (count,))
    for along, across, flip in ((0, 1, False), (1, 0, True)):
        # s = L u, t = s v, ρ = s √(1 + v²), ds dt / ρ = ds dv / √(1 + v²) = ds dw
        steep = np.arcsinh(lengths[across] / lengths[along])
        s, weights = _gauss(lengths[along], 2 * count)  # exact for the product of both
        w, others = _gauss(steep, count + _MORE)
        first = _even(_products(s, lengths[along], count)) * weights[:, None, None]
        t = np.multiply.outer(s, np.sinh(w))
        second = _even(_products(t.ravel(), lengths[across], count))
        second = np.einsum("w,swkl->skl", others, second.reshape(*t.shape, count, count))
        part = np.tensordot(first, second, axes=(0, 0))  # k, k', l, l'
        total += part.transpose(2, 0, 3, 1) if flip else part.transpose(0, 2, 1, 3)
    area = lengths[0] * lengths[1]
    matrix = total.reshape(count**2, count**2) * (4.0 / (np.pi * area**2))
    return np.asarray(0.5 * (matrix + matrix.T))


def _products(shifts: Array, length: float, count: int) -> Array:
    """Return ∫ φ_k(x) φ_l(x + s) dx, shape (shifts, K, K) [mm]."""
    nodes, weights = legendre.leggauss(count)
    half = 0.5 * (length - shifts)[:, None]
    x = half * (1.0 + nodes)
    shape = count, len(shifts), count
    here = mode_values(x.ravel(), length, count).reshape(shape).transpose(1, 0, 2)
    there = mode_values((x + shifts[:, None]).ravel(), length, count).reshape(shape)
    return np.asarray((here * (half * weights)[:, None]) @ there.transpose(1, 2, 0))


def _even(products: Array) -> Array:
    """Return the part that does not change with the shift's sign: of modes of one parity."""
    return np.asarray(0.5 * (products + products.transpose(0, 2, 1)))


def _gauss(length: float, count: int) -> tuple[Array, Array]:
    nodes, weights = legendre.leggauss(count)
    return 0.5 * length * (1.0 + nodes), 0.5 * length * weights
