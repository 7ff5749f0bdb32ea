"""Surface displacement around a Hertz contact, as a function of s = a², and its slope in s.

A semi-ellipsoidal pressure over the ellipse with semi-axes a ≥ b, β = b²/a², moves the surface by

    U = κ [ s RF(1+v, β+v, v) − X²/3 RD(β+v, v, 1+v) − Y²/3 RD(1+v, v, β+v) ],   κ s = p0 b/E*,

where v ≥ 0 is the root of X²/(1+v) + Y²/(β+v) = s, and 0 inside the ellipse. The integrand of the
underlying integral vanishes at its lower limit, so dU/ds = κ RF(1+v, β+v, v) exactly.
Both functions below return U/κ and (dU/ds)/κ.

Held at a fixed v, U is linear in s; a lower bound on v therefore continues U linearly, with
continuous slope, from the size at which the root falls below the bound.
`micro.asperities.hertz_pairs` uses this for merging contacts.

Far from the ellipse a series takes the place of Carlson's integrals. With τ = t + (1+β)/3 the
product under the root of the underlying integrals becomes (1+t)(β+t)t = τ³ (1 + e2/τ² + e3/τ³).
Expanded in 1/τ and integrated term by term, U and its slope are √x times polynomials in x = 1/τ(v)
whose coefficients depend on β alone. The ratio of their terms is below 2/(3τ): nine terms are exact
to rounding from τ = 30 on, some 5.5 major semi-axes away, at less than a tenth of the cost.

Source:
    Waddad et al. 2016, eqs. 10, 17, 18, doi 10.1016/j.triboint.2015.12.023; Carlson's integrals
    (DLMF 19.16) in place of the paper's eqs. 20–22.

Theory: docs/theory.md, section 8.
"""

from __future__ import annotations

import numpy as np
import scipy

from support.arrays import Array

NEAREST = 30.0
"""Smallest confocal parameter v for which the series is exact to rounding."""


def elliptic_field(
    x_squared: Array, y_squared: Array, s: Array, beta: Array, v_min: Array | float = 0.0
) -> tuple[Array, Array]:
    """Return U/κ [mm²] and its slope in s [1] of an elliptic contact.

    Args:
        x_squared: X², squared distance along the major axis [mm²]; all arguments broadcast.
        y_squared: Y², squared distance along the minor axis [mm²].
        s: a² > 0, squared major semi-axis [mm²].
        beta: b²/a², in (0, 1].
        v_min: Lower bound on v; 0 for the exact field.
    """
    v = np.maximum(confocal_parameter(x_squared / s, y_squared / s, beta), v_min)
    if v.size < 512:  # of few points Carlson's integrals are faster than the series
        return _carlson(x_squared, y_squared, s, beta, v)
    field, slope = far_field(x_squared, y_squared, s, beta, v)
    near = v < NEAREST
    arguments = np.broadcast_arrays(x_squared, y_squared, s, beta, v)
    field[near], slope[near] = _carlson(*(part[near] for part in arguments))
    return field, slope


def circular_field(r_squared: Array, s: Array, sine_max: float = 1.0) -> tuple[Array, Array]:
    """Return U/κ [mm²] and its slope in s [1] of a circular contact.

    With sin θ = a/r, at most 1: U/κ = s θ − r²/2 (θ − sin θ cos θ) and the slope is θ.

    Args:
        r_squared: Squared distance from the centre [mm²].
        s: a² > 0, squared contact radius [mm²]; broadcasts against ``r_squared``.
        sine_max: Upper bound on sin θ; 1 for the exact field.
    """
    sine = np.sqrt(s / np.maximum(r_squared, s / sine_max**2))
    theta = np.arcsin(np.minimum(sine, 1.0))
    return s * theta - 0.25 * r_squared * _angle_minus_sine(2.0 * theta), theta


def confocal_parameter(x_squared: Array, y_squared: Array, beta: Array) -> Array:
    """Return the root v ≥ 0 of x²/(1+v) + y²/(β+v) = 1, and 0 inside the ellipse.

    With u = β + v and m = 1 − β it solves u² − (x² + y² − m) u − m y² = 0.

    Args:
        x_squared: (X/a)² [1].
        y_squared: (Y/a)² [1].
        beta: b²/a².
    """
    gap = 1.0 - beta
    half = 0.5 * (x_squared + y_squared - gap)
    return np.maximum(half + np.sqrt(half**2 + gap * y_squared) - beta, 0.0)


def _carlson(
    x_squared: Array, y_squared: Array, s: Array, beta: Array, v: Array
) -> tuple[Array, Array]:
    p, q = 1.0 + v, beta + v
    slope = scipy.special.elliprf(p, q, v)
    # At v = 0 (inside) RD keeps two positive arguments and stays finite.
    along = x_squared * scipy.special.elliprd(q, v, p)
    across = y_squared * scipy.special.elliprd(p, v, q)
    return s * slope - (along + across) / 3.0, slope


def _angle_minus_sine(angle: Array) -> Array:
    """Return y − sin y without cancellation; the series is exact to 1e-16 below y = 0.2."""
    q = angle**2
    tail = 1.0 - q / 72.0 * (1.0 - q / 110.0)
    series = angle * q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * tail))
    return np.where(angle < 0.2, series, angle - np.sin(angle))


def far_field(
    x_squared: Array, y_squared: Array, s: Array, beta: Array, v: Array
) -> tuple[Array, Array]:
    """Return U/κ [mm²] and its slope in s [1] where v ≥ `NEAREST`.

    Args:
        x_squared: X², squared distance along the major axis [mm²]; all arguments broadcast.
        y_squared: Y², squared distance along the minor axis [mm²].
        s: a² > 0, squared major semi-axis [mm²].
        beta: b²/a², in (0, 1].
        v: Confocal parameter of the points.
    """
    root, along, across = _coefficients(beta)
    x = 1.0 / (v + (1.0 + beta) / 3.0)
    first = np.sqrt(x)
    slope = first * _polynomial(root, x)
    moments = x_squared * _polynomial(along, x) + y_squared * _polynomial(across, x)
    return s * slope - first * x * moments, slope


def _coefficients(beta: Array) -> tuple[list[Array], list[Array], list[Array]]:
    """Return the coefficients of the three polynomials, lowest power first.

    The powers of (1 + e2 y² + e3 y³)^(−1/2) follow from Miller's recurrence; division by 1 + t
    or β + t, that is by 1 + d y with d its root's offset, is one more recurrence.
    """
    centre = (1.0 + beta) / 3.0
    d1, d2, d3 = 1.0 - centre, beta - centre, -centre
    e2, e3 = d1 * d2 + d1 * d3 + d2 * d3, d1 * d2 * d3
    power = [np.ones_like(beta), np.zeros_like(beta), -0.5 * e2]
    for n in range(3, 9):
        power.append(-((n - 1.0) * e2 * power[n - 2] + (n - 1.5) * e3 * power[n - 3]) / n)
    root = [term / (1.0 + 2.0 * n) for n, term in enumerate(power)]
    return root, _divided(power, d1), _divided(power, d2)


def _divided(power: list[Array], offset: Array) -> list[Array]:
    quotient = [power[0]]
    for term in power[1:]:
        quotient.append(term - offset * quotient[-1])
    return [np.divide(term, 3.0 + 2.0 * n) for n, term in enumerate(quotient)]


def _polynomial(coefficients: list[Array], x: Array) -> Array:
    value = coefficients[-1] * x
    for coefficient in coefficients[-2:0:-1]:
        value += coefficient
        value *= x
    value += coefficients[0]
    return value
