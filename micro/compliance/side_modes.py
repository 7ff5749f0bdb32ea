"""Compliance and stresses that free sides add to the half-space, in modes of the rectangle.

Theory: demos/theory.md, section 5.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.special import spherical_jn

from geometry.legendre_modes import mode_values
from micro.compliance.distance_nodes import distance_nodes, values_at
from micro.compliance.free_sides import FreeSides

Array = NDArray[np.float64]

_WAVES = 8
"""Waves along a side, per mode: shorter ones are left out, as the cube of their length."""
_NEAREST = 1.0 / 1024.0
"""First node of the distance from a side, of its length over the square of the modes."""


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
    length, waves = sides.lengths[axis], np.arange(_WAVES * count)
    nodes = distance_nodes(_NEAREST * length / count**2, length)
    loads = _integrals(nodes, length, count)
    if not stress:
        lines = loads @ sides.compliance(axis, nodes, waves) @ loads.T
        return _along(sides, axis, lines, far=1.0)[None]
    lines = loads @ sides.stresses(axis, nodes, waves) @ loads.T
    signs = 1.0, 1.0, -1.0
    parts = [_along(sides, axis, part, far=far) for part, far in zip(lines, signs, strict=True)]
    return np.stack(parts)


def _along(sides: FreeSides, axis: int, lines: Array, *, far: float) -> Array:
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
    lines *= 1.0 + far * np.where(parity[:, None] == parity, 1.0, -1.0)
    cosines, sines = _waves(waves, count) * length
    seen = (cosines, sines) if far > 0.0 else (sines, -cosines)
    both = sum(
        np.einsum("kw,lw->wkl", one, load) for one, load in zip(seen, (cosines, sines), strict=True)
    )
    return np.tensordot(lines, both, axes=(0, 0))


def _waves(waves: NDArray[np.intp], count: int) -> Array:
    """Return means of the modes times cos and sin πw(x/L − 1/2), shape (2, K, waves).

    ∫ P_k(t) exp(i z t) dt = 2 iᵏ j_k(z).
    """
    k = np.arange(count)[:, None]
    bessel = np.sqrt(2.0 * k + 1.0) * spherical_jn(k, 0.5 * np.pi * waves)
    phase = 1j**k
    return np.stack([bessel * phase.real, bessel * phase.imag])


def _integrals(nodes: Array, length: float, count: int) -> Array:
    """Return the integrals of modes times the interpolation from nodes, shape (K, nodes) [mm]."""
    ticks = np.concatenate([[0.0], nodes[nodes < length], [length]])
    points, weights = legendre.leggauss(count // 2 + 4)
    half = 0.5 * np.diff(ticks)[:, None]
    x = (0.5 * (ticks[1:] + ticks[:-1])[:, None] + half * points).ravel()
    modes = mode_values(x, length, count) * (half * weights).ravel()
    return np.asarray((values_at(nodes, x).T @ modes.T).T)
