"""Stresses in a half-space below the pressures on its cells, in waves.

A wave of pressure p exp(i k·x) makes stresses that decay as exp(−q z) with the depth z, q = |k|:

    σzz = −p (1 + q z) e,    σxx = −p [(1 − q z) kx² + 2 ν ky²]/q² e,    e = exp(i k·x − q z),
    σxz = i kx z p e,        σxy = −p (1 − q z − 2 ν) kx ky/q² e,        trace σ = −2 (1 + ν) p e,

and likewise with x and y exchanged; tension is positive. They are in equilibrium, and their trace
is harmonic, as it must be without body forces.

Source:
    Johnson 1985, Contact Mechanics, section 3.2, in waves as in section 13.2.

Theory: docs/theory.md, section 4.
"""

from __future__ import annotations

import numpy as np
from scipy import fft

from patchlaw.support.arrays import Array

_DECAYED = 20.0
"""q z from which on a wave is left out: 2e-9 of it are left at that depth."""


def stresses_below(
    pressure: Array,
    spacing: tuple[float, float],
    poisson_ratio: float,
    depths: Array,
    row: int,
) -> Array:
    """Return the stresses below one row of cells of a half-space.

    No pressure acts outside of the cells. Their copies, two lengths of the grid apart, add nothing
    that matters down to depths of about half that length.

    Args:
        pressure: Pressures on the cells, shape (nx, ny) [MPa].
        spacing: Sides (dx, dy) of a cell [mm].
        poisson_ratio: Poisson's ratio ν.
        depths: Depths z ≥ 0, shape (m,) [mm].
        row: Index of the row of cells along x that the stresses lie below.

    Returns:
        Tensors at the middles of the cells of the row, shape (m, nx, 3, 3) [MPa].
    """
    grid = pressure.shape
    padded = tuple(2 * count for count in grid)
    kx = 2.0 * np.pi * fft.rfftfreq(padded[0], spacing[0])[:, None]
    ky = 2.0 * np.pi * fft.fftfreq(padded[1], spacing[1])
    q = np.hypot(kx, ky)
    across = np.where(q > 0.0, q, 1.0)
    cx, cy = kx / across, ky / across
    factors = np.stack([np.ones_like(q), cx * cx, cx * cy, cy * cy, cx, cy])
    factors[[1, 3], 0, 0] = 0.5  # the mean over all directions
    factors[[2, 4], -1] = 0.0  # waves of two cells run either way
    factors[[2, 5], :, grid[1]] = 0.0
    waves = fft.fft(fft.rfft(pressure, n=padded[0], axis=0), n=padded[1], axis=1)
    waves *= np.exp(2j * np.pi * np.arange(padded[1]) * row / padded[1]) / padded[1]
    stresses = np.empty((len(depths), grid[0], 3, 3))
    for at, depth in zip(stresses, depths, strict=True):
        kept = slice(np.searchsorted(kx[:, 0] * depth, _DECAYED, side="right"))
        decayed = waves[kept] * np.exp(-q[kept] * depth)
        # sums over ky of the pressures by the products of directions, alone and times q z
        plain = np.einsum("fxy,xy->fx", factors[:, kept], decayed)
        steep = np.einsum("fxy,xy->fx", factors[:, kept], decayed * (q[kept] * depth))
        one, xx, xy, yy, _, _ = plain
        parts = {
            (0, 0): -xx + steep[1] - 2.0 * poisson_ratio * yy,
            (1, 1): -yy + steep[3] - 2.0 * poisson_ratio * xx,
            (2, 2): -one - steep[0],
            (0, 1): -(1.0 - 2.0 * poisson_ratio) * xy + steep[2],
            (0, 2): 1j * steep[4],
            (1, 2): 1j * steep[5],
        }
        for (i, j), line in parts.items():
            at[:, i, j] = at[:, j, i] = fft.irfft(line, n=padded[0])[: grid[0]]
    return stresses
