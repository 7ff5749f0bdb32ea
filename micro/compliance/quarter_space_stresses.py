"""What a free side plane adds to the stresses in the surface of the half-space.

As in `micro.compliance.quarter_space`, pressures p on the top of a quarter-space press one
half-space by p̃ = (1 − A²)⁻¹ p and by its mirror image about the side x = 0, and another one, whose
surface is the side, by q = −A p̃ and its image about the top. The stresses in the top are the sum
of both.

In the surface of a half-space, σ_ab = −2ν p δ_ab − (1 − 2ν) φ_,ab with Δφ = p in the plane. Loads
~ cos ky have φ = −∫ exp(−k|x − x'|) p dx' / 2k, so that, all lengths counted in 1/k,

    σ_xx = −p + (½ − ν) ∫ exp(−|x − x'|) p dx',   σ_yy = −2ν p − (½ − ν) ∫ exp(−|x − x'|) p dx',
    σ_xy = (½ − ν) ∫ sign(x − x') exp(−|x − x'|) p dx' (~ sin ky).

Pressure q on the side at depths z, and its image, makes at distance x from the side on the top

    σ_xx = −2/π x³ K₂(ρ)/ρ² q,   σ_xy = −2/π x² K₁(ρ)/ρ q,   ρ² = x² + z²,
    σ_yy = 2/π [x K₀(ρ) − 2ν x K₁(ρ)/ρ − (1 − 2ν) ∫_x^∞ K₀(√(s² + z²)) ds] q,

the transforms of Boussinesq's solution (Johnson 1985, eq. 3.19). What is left after the
half-space's own part is without singularity, and cancels its σ_xx and σ_xy at the side.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline
from scipy.special import kn

from micro.compliance.quarter_space import depth_integral, side_traction

Array = NDArray[np.float64]

_STEP = 0.08
_SMALLEST, _LARGEST = 1e-11, 40.0  # distances times wave number


class QuarterSpaceStresses:
    """Stresses in the top of a quarter-space by what is there of the side alone.

    Args:
        poisson_ratio: ν.

    Source:
        Hetényi 1970, J. Appl. Mech. 37, 75-80; Keer, Lee & Mura 1983, Int. J. Solids Struct.
        19, 497-508.
    """

    def __init__(self, poisson_ratio: float) -> None:
        logs = np.arange(np.log(_SMALLEST), np.log(_LARGEST), _STEP)
        self._ends = float(logs[0]), float(logs[-1])
        # the stresses are of the size of 1/(x + x') where both distances are short
        apart = np.add.outer(np.exp(logs), np.exp(logs))
        found = _side_stresses(logs, poisson_ratio) * apart
        self._splines = [RectBivariateSpline(logs, logs, part) for part in found]

    def stresses(self, x: Array, wave_number: float) -> Array:
        """Return stresses at distances x from the edge by line loads at distances x.

        Args:
            x: Distances, ascending, shape (n,) [mm].
            wave_number: k > 0 of loads ~ cos ky along the edge [1/mm].

        Returns:
            σ_xx, σ_yy (~ cos ky) and σ_xy (~ sin ky) by loads of 1 N/mm, shape (3, n, n), the
            loads last [1/mm].
        """
        logs = np.log(x * wave_number)
        places = 2 * (np.clip(logs, *self._ends),)
        inside = logs < self._ends[1]
        factors = np.where(inside[:, None] & inside, 1.0 / np.add.outer(x, x), 0.0)
        return np.stack([spline(*places) for spline in self._splines]) * factors


def _side_stresses(logs: Array, nu: float) -> Array:
    """Return the stresses at k = 1, at distances exp(logs), shape (3, n, n)."""
    x = np.exp(logs)
    weights = _STEP * x
    side = side_traction(logs, nu)
    twice = (side * weights) @ side
    spread = np.linalg.solve(np.eye(len(x)) - twice * weights, twice)  # p̃ − p by p
    pressed = side + (side * weights) @ spread  # −q by p
    even, odd = ((0.5 - nu) * part for part in _decays(x, spread))
    own = np.stack([-spread + even, -2.0 * nu * spread - even, odd])
    return np.asarray(own - (_by_side(logs, nu) * weights) @ pressed)


def _decays(x: Array, spread: Array) -> tuple[Array, Array]:
    """Integrate exp(−|x − x'|) over p̃ − p and the images of p̃, once times sign(x − x').

    The trapezoidal rule in log x knows of the bend and of the jump at x' = x by the first term of
    the Euler-Maclaurin formula.
    """
    apart, weights = np.subtract.outer(x, x), _STEP * x
    near = np.exp(-np.abs(apart))
    image = np.exp(-np.add.outer(x, x))
    imaged = image + (image * weights) @ spread
    bend = (_STEP * x)[:, None] ** 2 / 6.0 * spread
    jump = _STEP / 6.0 * np.gradient(x[:, None] * spread, axis=0)
    even = (near * weights) @ spread - bend
    odd = (np.sign(apart) * near * weights) @ spread - jump
    return imaged + even, imaged + odd


def _by_side(logs: Array, nu: float) -> Array:
    """Return the stresses in the top by pressures on the side, at k = 1, shape (3, n, n)."""
    x = np.exp(logs)[:, None]
    rho = np.hypot(x, x.T)
    k_0, k_1, k_2 = (kn(order, rho) for order in range(3))
    below = depth_integral(logs)
    xx = -(x**3) * k_2 / rho**2
    yy = x * k_0 - 2.0 * nu * x * k_1 / rho - (1.0 - 2.0 * nu) * below
    return 2.0 / np.pi * np.stack([xx, yy, -(x**2) * k_1 / rho])


quarter_space_stresses = cache(QuarterSpaceStresses)
