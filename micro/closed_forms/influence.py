"""Mean displacement of rectangles by uniform pressures on rectangles of the half-space.

Unit pressure on rectangle j displaces rectangle i by Λ_ij / (π E*) in the mean: Love's integral L,
averaged over rectangle i. Near by it is the closed form, second differences of the fourfold
antiderivative of 1/ρ; far away, where these cancel, the expansion of 1/ρ in the rectangles' sides.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import toeplitz

from geometry.patches import Partition, PatchGrid
from micro.closed_forms.love import fourfold_integral, love_mutual

Array = NDArray[np.float64]

_ORDER = 12
_FAR = 6.0
"""Distance over the longer side beyond which the expansion is the better of the two."""


def influence_matrix(patches: Partition) -> Array:
    """Return the mean displacements Λ_ij of all patches by pressure on each, shape (N, N) [mm].

    Pressures p displace the patches by Λ p / (π E*). For equal patches symmetric and exact to 1e-12
    if they are squares, to 2e-11 for sides of 5 to 1 and to 1e-10 for 10 to 1. Of unequal ones
    A_i Λ_ij is symmetric; entries lose 1e-16 (distance / shortest side)⁴ to rounding.

    Args:
        patches: The N patches.

    Source:
        Love 1929, doi 10.1098/rsta.1929.0009; Waddad et al. 2016, eq. 29-30 for one point.
    """
    if not isinstance(patches, PatchGrid):
        return _unequal(patches)
    (nx, ny), (sx, sy), (a, b) = patches.grid, patches.size, patches.half_sizes
    table = mutual_influence(np.arange(nx)[:, None] * sx, np.arange(ny) * sy, a, b)
    steps_x = toeplitz(np.arange(nx))
    steps_y = toeplitz(np.arange(ny))
    whole = table[steps_x[:, None, :, None], steps_y[None, :, None, :]]
    return np.asarray(whole.reshape(patches.count, patches.count))


def _unequal(patches: Partition) -> Array:
    """Difference the fourfold antiderivative over the borders of both rectangles."""
    x, y = patches.borders_x, patches.borders_y
    table = fourfold_integral(
        np.subtract.outer(x, x)[:, :, None, None], np.subtract.outer(y, y)[None, None]
    )
    for axis in range(4):
        table = np.diff(table, axis=axis)
    whole = table.transpose(0, 2, 1, 3).reshape(patches.count, patches.count)
    return np.asarray(whole / patches.areas[:, None])


def mutual_influence(dx: ArrayLike, dy: ArrayLike, a: float, b: float) -> Array:
    """Return the mean of L over an equal rectangle (dx, dy) away, at any distance [mm].

    Args:
        dx: Distance of the centres along x [mm]; broadcast against ``dy``.
        dy: Distance along y [mm].
        a: Half-side along x [mm].
        b: Half-side along y [mm].

    Raises:
        InputError: When a half-side is not positive.
    """
    dx, dy = np.broadcast_arrays(np.asarray(dx, float), np.asarray(dy, float))
    result = np.asarray(love_mutual(dx, dy, a, b))
    far = np.hypot(dx, dy) > _FAR * 2.0 * max(a, b)
    result[far] = _expansion(dx[far], dy[far], a, b)
    return result


def _expansion(dx: Array, dy: Array, a: float, b: float) -> Array:
    """Return the mean from Taylor's series of 1/ρ and the moments of the sides."""
    series = _taylor(dx, dy)
    total = np.zeros(np.shape(dx))
    for i in range(_ORDER // 2 + 1):
        for j in range(_ORDER // 2 + 1 - i):
            total += _moment(a, 2 * i) * _moment(b, 2 * j) * series[2 * i][2 * j]
    return 4.0 * a * b * total


def _moment(half: float, power: int) -> float:
    """Return the mean of (x1 − x2)^power over x1, x2 on [−half, half], for an even power."""
    return 2.0 * (2.0 * half) ** power / ((power + 1) * (power + 2))


def _taylor(x: Array, y: Array) -> list[list[Array]]:
    """Return the coefficients of h^m g^n in 1/sqrt((x + h)² + (y + g)²), to the order kept.

    They follow from Q ∂F = −½ F ∂Q for F = Q^(−1/2), power by power.
    """
    square, none = x * x + y * y, np.zeros(np.shape(x))
    c = [[none] * (_ORDER + 1) for _ in range(_ORDER + 1)]
    c[0][0] = 1.0 / np.sqrt(square)
    for n in range(1, _ORDER + 1):
        before = c[0][n - 2] if n > 1 else none
        c[0][n] = -((2 * n - 1) * y * c[0][n - 1] + (n - 1) * before) / (n * square)
    for m in range(1, _ORDER + 1):
        for n in range(_ORDER + 1 - m):
            total = (2 * m - 1) * x * c[m - 1][n]
            if m > 1:
                total = total + (m - 1) * c[m - 2][n]
            if n > 0:
                total = total + 2 * m * y * c[m][n - 1]
            if n > 1:
                total = total + m * c[m][n - 2]
            c[m][n] = -total / (m * square)
    return c
