"""What a free side plane adds to the half-space beside it: the elastic quarter-space.

Pressures p on the top x > 0 of a quarter-space and their mirror images about its side x = 0 leave
no shear on the side, but a normal traction A p. Pressures q = −A p on the side, and their images
about the top, take it off. By symmetry they do not displace the top along its normal, but load it
by A q. The half-space and its image are therefore pressed by p̃ = p + A²p + A⁴p + … = (1 − A²)⁻¹ p,
and the normal displacement of the top is

    u = (G + G') p̃,

with G the half-space's compliance and G' that of the images (Hetényi 1970; Keer, Lee & Mura 1983).
Waves along the edge do not mix. At wave number k, all lengths counted in 1/k and z into the depth,

    G = 2/(πE*) K₀(|x − x'|),
    A(z, x) = 2/π [z x² K₂(ρ)/ρ² − (1 − 2ν) ∫_z^∞ K₀(√(x² + s²)) ds],   ρ² = x² + z²,

the transforms of Boussinesq's solution (Johnson 1985, eq. 3.18 and 3.19) and of its image.

The stresses in the top are those of one half-space by p̃ and its image about the side, and those of
another one, whose surface is the side, by q = −A p̃ and its image about the top. In the surface of a
half-space, σ_ab = −2ν p δ_ab − (1 − 2ν) φ_,ab with Δφ = p in the plane. Loads ~ cos ky have
φ = −∫ exp(−k|x − x'|) p dx' / 2k, so that

    σ_xx = −p + (½ − ν) ∫ exp(−|x − x'|) p dx',   σ_yy = −2ν p − (½ − ν) ∫ exp(−|x − x'|) p dx',
    σ_xy = (½ − ν) ∫ sign(x − x') exp(−|x − x'|) p dx' (~ sin ky).

Pressure q on the side at depths z, and its image, makes at distance x from the side on the top

    σ_xx = −2/π x³ K₂(ρ)/ρ² q,   σ_xy = −2/π x² K₁(ρ)/ρ q,
    σ_yy = 2/π [x K₀(ρ) − 2ν x K₁(ρ)/ρ − (1 − 2ν) ∫_x^∞ K₀(√(s² + z²)) ds] q.

What is left after the half-space's own part is without singularity, and cancels its σ_xx and σ_xy
at the side.

Theory: docs/theory.md, section 5.
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
import scipy

from patchlaw.support.arrays import Array

_STEP = 0.08
"""Step of the tables, in the logarithm of distances times wave number."""

Spline = tuple[Any, ...]
"""Knots, coefficients and degrees of a bicubic spline, as `scipy.interpolate.bisplev` takes them;
objects of splines check every call for longer than they evaluate some 30 × 30 places."""


def side_compliance(poisson_ratio: float, x: Array, wave_number: float) -> Array:
    """Return normal displacements at distances x from the edge by line loads at distances x.

    Only what the side adds to the half-space is returned, for E* = 1.

    Args:
        poisson_ratio: ν.
        x: Distances, ascending, shape (n,) [mm].
        wave_number: k of loads ~ cos ky along the edge [1/mm].

    Returns:
        Shape (n, n); symmetric.

    Source:
        Hetényi 1970, J. Appl. Mech. 37, 75-80; Keer, Lee & Mura 1983, Int. J. Solids Struct.
        19, 497-508.
    """
    return _values(_compliance_splines(poisson_ratio), x * wave_number)[0]


def side_stresses(poisson_ratio: float, x: Array, wave_number: float) -> Array:
    """Return stresses at distances x from the edge by line loads at distances x.

    Only what the side adds to those of the half-space is returned.

    Args:
        poisson_ratio: ν.
        x: Distances, ascending, shape (n,) [mm].
        wave_number: k > 0 of loads ~ cos ky along the edge [1/mm].

    Returns:
        σ_xx, σ_yy (~ cos ky) and σ_xy (~ sin ky) by loads of 1 N/mm, shape (3, n, n), the loads
        last [1/mm].
    """
    return _values(_stress_splines(poisson_ratio), x * wave_number) / np.add.outer(x, x)


@cache
def _compliance_splines(nu: float) -> list[Spline]:
    logs = _logs(1e-8)
    return [_spline(logs, _side_compliance(logs, nu))]


@cache
def _stress_splines(nu: float) -> list[Spline]:
    """Return splines of the stresses times x + x': so they vary little where both are short."""
    logs = _logs(1e-11)
    apart = np.add.outer(np.exp(logs), np.exp(logs))
    return [_spline(logs, part) for part in _side_stresses(logs, nu) * apart]


def _spline(logs: Array, values: Array) -> Spline:
    """Return the spline through the values of a table."""
    spline = scipy.interpolate.RectBivariateSpline(logs, logs, values)
    return (*spline.get_knots(), spline.get_coeffs(), 3, 3)


def _values(splines: list[Spline], distances: Array) -> Array:
    """Return functions at pairs of ascending distances, (functions, n, n); 0 beyond tables."""
    first, *_, last = splines[0][0]
    logs = np.log(distances)
    within = int(np.searchsorted(logs, last))
    places = np.maximum(logs[:within], first)
    values = np.zeros((len(splines), len(logs), len(logs)))
    for value, spline in zip(values, splines, strict=True):
        if within:
            value[:within, :within] = scipy.interpolate.bisplev(places, places, spline)
    return values


def _logs(smallest: float) -> Array:
    """Return places of a table: logarithms of distances times wave number from a smallest one."""
    return np.arange(np.log(smallest), np.log(40.0), _STEP)


def _reflections(logs: Array, nu: float) -> tuple[Array, Array]:
    """Return A and p̃ − p by p, as matrices between distances exp(logs), at k = 1.

    Functions of the logarithm of a distance are analytic and vanish at both ends, so that the
    trapezoidal rule is accurate.
    """
    weights = _STEP * np.exp(logs)
    side = side_traction(logs, nu)
    twice = (side * weights) @ side
    return side, np.linalg.solve(np.eye(len(logs)) - twice * weights, twice)


def _side_compliance(logs: Array, nu: float) -> Array:
    """Return (G + G')(1 − A²)⁻¹ − G at k = 1, at distances exp(logs), for E* = 1.

    The logarithmic singularity of G takes its own weight in the trapezoidal rule.
    """
    x = np.exp(logs)
    weights = _STEP * x
    _, more = _reflections(logs, nu)
    apart = np.abs(np.subtract.outer(x, x))
    np.fill_diagonal(apart, 1.0)
    near = scipy.special.k0(apart)
    np.fill_diagonal(near, -np.log(_STEP * x / (4.0 * np.pi)) - np.euler_gamma)
    image = scipy.special.k0(np.add.outer(x, x))
    total = 2.0 / np.pi * (image + ((near + image) * weights) @ more)
    return np.asarray(0.5 * (total + total.T))


def _side_stresses(logs: Array, nu: float) -> Array:
    """Return the stresses at k = 1, at distances exp(logs), shape (3, n, n)."""
    weights = _STEP * np.exp(logs)
    side, more = _reflections(logs, nu)
    pressed = side + (side * weights) @ more  # −q by p
    even, odd = ((0.5 - nu) * part for part in _decays(logs, more))
    own = np.stack([-more + even, -2.0 * nu * more - even, odd])
    return np.asarray(own - (side_pressure_stresses(logs, nu) * weights) @ pressed)


def _decays(logs: Array, more: Array) -> tuple[Array, Array]:
    """Integrate exp(−|x − x'|) over p̃ − p and the images of p̃, once times sign(x − x').

    The trapezoidal rule in log x accounts for the bend and for the jump at x' = x by the first term
    of the Euler-Maclaurin formula.
    """
    x = np.exp(logs)
    apart, weights = np.subtract.outer(x, x), _STEP * x
    near = np.exp(-np.abs(apart)) * weights
    image = np.exp(-np.add.outer(x, x))
    imaged = image + (image * weights) @ more
    bend = weights[:, None] ** 2 / 6.0 * more
    jump = _STEP / 6.0 * np.gradient(x[:, None] * more, axis=0)
    return imaged + near @ more - bend, imaged + (np.sign(apart) * near) @ more - jump


def side_traction(logs: Array, poisson_ratio: float) -> Array:
    """Return A(z, x) at k = 1, compression positive, shape (n, n).

    Args:
        logs: Logarithms of depths and distances, ascending, shape (n,).
        poisson_ratio: ν.
    """
    x, of = np.exp(logs), _radial_functions(logs.tobytes())
    direct = x[:, None] * x**2 * of.k2 / of.rho**2
    return np.asarray(2.0 / np.pi * (direct - (1.0 - 2.0 * poisson_ratio) * of.below))


def side_pressure_stresses(logs: Array, poisson_ratio: float) -> Array:
    """Return σ_xx, σ_yy and σ_xy in the top by pressures on the side, at k = 1, shape (3, n, n).

    Args:
        logs: Logarithms of distances on the top and of depths on the side, which come last, (n,).
        poisson_ratio: ν.
    """
    x, of = np.exp(logs)[:, None], _radial_functions(logs.tobytes())
    xx = -(x**3) * of.k2 / of.rho**2
    along = x * of.k0 - 2.0 * poisson_ratio * x * of.k1 / of.rho
    yy = along - (1.0 - 2.0 * poisson_ratio) * of.below
    return 2.0 / np.pi * np.stack([xx, yy, -(x**2) * of.k1 / of.rho])


class _RadialFunctions(NamedTuple):
    """Functions of ρ = √(x² + z²) at k = 1, at depths z and distances x of a table, (n, n) each.

    Attributes:
        rho: ρ.
        k0: K₀(ρ).
        k1: K₁(ρ).
        k2: K₂(ρ).
        below: ∫_z^∞ K₀(√(x² + s²)) ds.
    """

    rho: Array
    k0: Array
    k1: Array
    k2: Array
    below: Array


@lru_cache(maxsize=1)
def _radial_functions(logs: bytes) -> _RadialFunctions:
    """Return the functions at depths and distances exp(logs), of which the bytes are given."""
    places = np.frombuffer(logs)
    x = np.exp(places)
    rho = np.hypot.outer(x, x)
    k_0, k_1 = scipy.special.k0(rho), scipy.special.k1(rho)
    below = scipy.interpolate.make_interp_spline(places, k_0 * x[:, None]).antiderivative()
    integral = np.asarray(below(places[-1]) - below(places))
    return _RadialFunctions(rho, k_0, k_1, k_0 + 2.0 / rho * k_1, integral)
