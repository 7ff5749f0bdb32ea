"""What a free side plane adds to the compliance of the half-space: the elastic quarter-space.

Pressures p on the top x > 0 of a quarter-space and their mirror images about its side x = 0 leave
no shear on the side, but a normal traction A p. Pressures q = −A p on the side, and their images
about the top, take it off; by symmetry they do not displace the top along its normal, but load it
by A q. What presses the half-space and its image is therefore p + A²p + A⁴p + …, and the normal
displacement of the top

    u = (G + G') (1 − A²)⁻¹ p,

with G the half-space's compliance and G' that of the images (Hetényi 1970; Keer, Lee & Mura 1983).
Waves along the edge do not mix. At wave number k, all lengths counted in 1/k and z into the depth,

    G = 2/(πE*) K₀(|x − x'|),
    A(z, x) = 2/π [z x² K₂(ρ)/ρ² − (1 − 2ν) ∫_z^∞ K₀(√(x² + s²)) ds],   ρ² = x² + z²,

the transforms of Boussinesq's solution (Johnson 1985, eq. 3.18 and 3.19) and of its image.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline, make_interp_spline
from scipy.special import kn

Array = NDArray[np.float64]

_STEP = 0.08
_SMALLEST, _LARGEST = 1e-8, 40.0  # distances times wave number


class QuarterSpace:
    """Normal displacement of the top by what is there of the side alone, for E* = 1.

    Args:
        poisson_ratio: ν.

    Source:
        Hetényi 1970, J. Appl. Mech. 37, 75-80; Keer, Lee & Mura 1983, Int. J. Solids Struct.
        19, 497-508.
    """

    def __init__(self, poisson_ratio: float) -> None:
        logs = np.arange(np.log(_SMALLEST), np.log(_LARGEST), _STEP)
        self._ends = float(logs[0]), float(logs[-1])
        self._spline = RectBivariateSpline(logs, logs, _side_compliance(logs, poisson_ratio))

    def compliance(self, x: Array, wave_number: float) -> Array:
        """Return displacements at distances x from the edge by line loads at distances x.

        Args:
            x: Distances, ascending, shape (n,) [mm].
            wave_number: k of loads ~ cos ky along the edge [1/mm].

        Returns:
            Shape (n, n); symmetric.
        """
        logs = np.log(x * wave_number)
        found = self._spline(*2 * (np.clip(logs, *self._ends),))
        inside = logs < self._ends[1]
        return np.asarray(np.where(inside[:, None] & inside, found, 0.0))


def _side_compliance(logs: Array, poisson_ratio: float) -> Array:
    """Return (G + G')(1 − A²)⁻¹ − G at k = 1, at distances exp(logs), for E* = 1.

    Functions of the logarithm of a distance are analytic and vanish at both ends: the trapezoidal
    rule is accurate; the logarithmic singularity of G takes its own weight.
    """
    x = np.exp(logs)
    weights = _STEP * x
    side = side_traction(logs, poisson_ratio)
    twice = (side * weights) @ side
    spread = np.linalg.solve(np.eye(len(x)) - twice * weights, twice)
    apart = np.abs(np.subtract.outer(x, x))
    np.fill_diagonal(apart, 1.0)
    near = kn(0, apart)
    np.fill_diagonal(near, -np.log(_STEP * x / (4.0 * np.pi)) - np.euler_gamma)
    image = kn(0, np.add.outer(x, x))
    found = 2.0 / np.pi * (image + ((near + image) * weights) @ spread)
    return np.asarray(0.5 * (found + found.T))


def side_traction(logs: Array, poisson_ratio: float) -> Array:
    """Return A(z, x) at k = 1, compression positive, at depths and distances exp(logs)."""
    x = np.exp(logs)
    z, rho = x[:, None], np.hypot(x[:, None], x)
    direct = z * x**2 * kn(2, rho) / rho**2
    return np.asarray(2.0 / np.pi * (direct - (1.0 - 2.0 * poisson_ratio) * depth_integral(logs)))


def depth_integral(logs: Array) -> Array:
    """Return ∫_z^∞ K₀(√(x² + s²)) ds at depths z and distances x of exp(logs), shape (n, n)."""
    x = np.exp(logs)
    below = make_interp_spline(logs, kn(0, np.hypot.outer(x, x)) * x[:, None]).antiderivative()
    return np.asarray(below(logs[-1]) - below(logs))


quarter_space = cache(QuarterSpace)
