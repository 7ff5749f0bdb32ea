"""Compliance that free sides add to the half-space, in the Legendre modes of the rectangle."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.special import spherical_jn

from geometry.legendre_modes import mode_values
from micro.cells.distance_nodes import distance_nodes, values_at
from micro.cells.free_sides import FreeSides

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
    total = _by_two(sides, 0, count).transpose(0, 2, 1, 3)
    total += _by_two(sides, 1, count).transpose(2, 0, 3, 1)
    area = sides.lengths[0] * sides.lengths[1]
    matrix = total.reshape(count**2, count**2) / area**2
    return np.asarray(0.5 * (matrix + matrix.T))


def _by_two(sides: FreeSides, axis: int, count: int) -> Array:
    """Return what two opposite sides add, by modes across them and along, shape (k, k', l, l')."""
    length, along = sides.lengths[axis], sides.lengths[1 - axis]
    nodes = distance_nodes(_NEAREST * length / count**2, length)
    waves = np.arange(_WAVES * count)
    loads = _integrals(nodes, length, count)
    lines = loads @ sides.compliance(axis, nodes, waves) @ loads.T
    # cosine series of period 2 L, of which the load takes one half
    lines *= np.where(waves == 0, 0.5, 1.0)[:, None, None] / along
    parity = np.arange(count) % 2
    lines *= 2.0 * (parity[:, None] == parity)  # the far side mirrors the near one
    across = _waves(waves, count) * along
    both = np.einsum("ckw,clw->wkl", across, across)
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
