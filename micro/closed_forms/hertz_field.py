"""Surface displacement around a Hertz contact, as a function of s = a², and its slope in s.

A semi-ellipsoidal pressure over the ellipse with semi-axes a ≥ b, β = b²/a², moves the surface by

    U = κ [ s RF(1+v, β+v, v) − X²/3 RD(β+v, v, 1+v) − Y²/3 RD(1+v, v, β+v) ],   κ s = p0 b/E*,

where v ≥ 0 is the root of X²/(1+v) + Y²/(β+v) = s, and 0 inside the ellipse. The integrand of the
underlying integral vanishes at its lower limit, so dU/ds = κ RF(1+v, β+v, v) exactly.
Both functions below return U/κ and (dU/ds)/κ.

Held at a fixed v, U is linear in s; a lower bound on v therefore continues U linearly, with
continuous slope, from the size at which the root falls below the bound.
`micro.interaction.hertz_pairs` uses this for merging contacts.

Source:
    Waddad et al. 2016, eqs. 10, 17, 18, doi 10.1016/j.triboint.2015.12.023; Carlson's integrals
    (DLMF 19.16) in place of the paper's eqs. 20–22.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import elliprd, elliprf

from micro.closed_forms.hertz_far_field import NEAREST, far_field

Array = NDArray[np.float64]

_MANY = 512  # from this many points on the far field's series is faster than Carlson's integrals


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
    if v.size < _MANY:
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
    slope = elliprf(p, q, v)
    # At v = 0 (inside) RD keeps two positive arguments and stays finite.
    along = x_squared * elliprd(q, v, p)
    across = y_squared * elliprd(p, v, q)
    return s * slope - (along + across) / 3.0, slope


def _angle_minus_sine(angle: Array) -> Array:
    """Return y − sin y without cancellation; the series is exact to 1e-16 below y = 0.2."""
    q = angle**2
    tail = 1.0 - q / 72.0 * (1.0 - q / 110.0)
    series = angle * q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * tail))
    return np.where(angle < 0.2, series, angle - np.sin(angle))
