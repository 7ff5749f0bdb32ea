"""Displacements of the half-space by uniform pressures on rectangles (Love 1929), stresses below.

Pressure p on a rectangle with half-sides a, b moves the surface point (x, y) by L p/(π E*), where
L(x, y) is the integral of 1/distance over the rectangle [mm]. Pressure on rectangle j displaces
rectangle i by Λ_ij p/(π E*) in the mean, where Λ_ij is the mean of L over rectangle i. Near by it
is a closed form, second differences of the fourfold antiderivative of 1/ρ. These cancel far away,
where Gauss' rule takes their place.

Below the surface, a wave of pressure p exp(i k·x) makes stresses that decay as exp(−q z) with the
depth z, q = |k|:

    σzz = −p (1 + q z) e,    σxx = −p [(1 − q z) kx² + 2 ν ky²]/q² e,    e = exp(i k·x − q z),
    σxz = i kx z p e,        σxy = −p (1 − q z − 2 ν) kx ky/q² e,        trace σ = −2 (1 + ν) p e,

and likewise with x and y exchanged; tension is positive. They are in equilibrium, and their trace
is harmonic, as it must be without body forces.

Source:
    Johnson 1985, Contact Mechanics, section 3.2, in waves as in section 13.2.

Theory: docs/theory.md, section 4.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import scipy
from numpy.typing import ArrayLike
from scipy import fft

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.legendre_modes import gauss_rule
from patchlaw.support import Array


def love_centre(a: ArrayLike, b: ArrayLike) -> Array:
    """Return L at the centre of the rectangle [mm]; 3.5255 s for a square of side s.

    Args:
        a: Half-side along x [mm].
        b: Half-side along y [mm].
    """
    return 4.0 * corner_integral(a, b)


def love_mean(a: ArrayLike, b: ArrayLike) -> Array:
    """Return the mean of L over the rectangle itself [mm]; 2.9732 s for a square of side s.

    Args:
        a: Half-side along x [mm].
        b: Half-side along y [mm].
    """
    return love_mutual(0.0, 0.0, a, b)


def love_mutual(dx: ArrayLike, dy: ArrayLike, a: ArrayLike, b: ArrayLike) -> Array:
    """Return the mean of L over an equal rectangle whose centre is (dx, dy) away [mm].

    It is the second difference, in x and in y, of the fourfold antiderivative of 1/ρ,
    ½ u² v asinh(v/u) + ½ u v² asinh(u/v) − ρ³/6. Rounding grows as 1e-16 (distance/side)⁴;
    `mutual_influence` goes on from there.

    Args:
        dx: Distance of the centres along x [mm]; all arguments broadcast.
        dy: Distance of the centres along y [mm].
        a: Half-side along x [mm].
        b: Half-side along y [mm].
    """
    dx, dy, a, b = (np.asarray(part, float) for part in (dx, dy, a, b))
    total = np.zeros(np.broadcast_shapes(dx.shape, dy.shape, a.shape, b.shape))
    for (i, p), (j, q) in product(((-1, 1.0), (0, -2.0), (1, 1.0)), repeat=2):
        total += p * q * fourfold_integral(dx + 2 * i * a, dy + 2 * j * b)
    return total / (4.0 * a * b)


def influence_matrix(patches: PatchGrid) -> Array:
    """Return the mean displacements Λ_ij of all patches by pressure on each, shape (N, N) [mm].

    Pressures p displace the patches by Λ p / (π E*). The matrix is symmetric and exact to 1e-12 for
    squares, to 2e-11 for sides of 5 to 1 and to 1e-10 for 10 to 1.

    Args:
        patches: The N patches.

    Source:
        Love 1929, doi 10.1098/rsta.1929.0009; Waddad et al. 2016, eq. 29-30 for one point.
    """
    (nx, ny), (sx, sy), (a, b) = patches.grid, patches.size, patches.half_sizes
    table = mutual_influence(np.arange(nx)[:, None] * sx, np.arange(ny) * sy, a, b)
    steps_x = scipy.linalg.toeplitz(np.arange(nx))
    steps_y = scipy.linalg.toeplitz(np.arange(ny))
    whole = table[steps_x[:, None, :, None], steps_y[None, :, None, :]]
    return np.asarray(whole.reshape(patches.count, patches.count))


def mutual_influence(dx: ArrayLike, dy: ArrayLike, a: float, b: float) -> Array:
    """Return the mean of L over an equal rectangle (dx, dy) away, at any distance [mm].

    Args:
        dx: Distance of the centres along x [mm]; broadcast against ``dy``.
        dy: Distance along y [mm].
        a: Half-side along x [mm].
        b: Half-side along y [mm].
    """
    dx, dy = np.broadcast_arrays(np.asarray(dx, float), np.asarray(dy, float))
    result = np.asarray(love_mutual(dx, dy, a, b))
    far = np.hypot(dx, dy) > 6.0 * 2.0 * max(a, b)  # where Gauss' rule is the better of the two
    result[far] = _far_influence(dx[far], dy[far], a, b)
    return result


def _far_influence(dx: Array, dy: Array, a: float, b: float) -> Array:
    """Return the mean from Gauss' rule over the shifts between points of the two rectangles.

    From six longer sides on the error of six points on a side is rounding. The shifts along x have
    the density 1 − |t| at 2 a t, those along y at 2 b t.
    """
    nodes, weights = gauss_rule(6)
    t, weights = 0.5 * (1.0 + nodes), 0.25 * weights * (1.0 - nodes)
    t, weights = np.concatenate([-t, t]), np.concatenate([weights, weights])
    total = np.zeros(np.shape(dx))
    for (s, one), (u, other) in product(zip(t, weights, strict=True), repeat=2):
        total += one * other / np.hypot(dx + 2.0 * a * s, dy + 2.0 * b * u)
    return 4.0 * a * b * total


def corner_integral(u: ArrayLike, v: ArrayLike) -> Array:
    """Return u asinh(v/|u|) + v asinh(u/|v|), whose mixed derivative is 1/sqrt(u² + v²).

    Its differences over the corners of a rectangle give L; continuous, 0 at the origin.

    Args:
        u: Distance along x from the point to the corner [mm].
        v: Distance along y [mm].
    """
    along_x, along_y = corner_parts(u, v)
    return along_y + along_x


def corner_parts(u: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
    """Return v asinh(u/|v|) and u asinh(v/|u|), with mixed derivatives u²/ρ³ and v²/ρ³.

    Args:
        u: Distance along x from the point to the corner [mm].
        v: Distance along y [mm].
    """
    u, v = np.asarray(u, float), np.asarray(v, float)
    return v * _asinh_ratio(u, v), u * _asinh_ratio(v, u)


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
