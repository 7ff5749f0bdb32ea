"""Shape of an elliptic Hertz contact: axis ratio from the radii and the factors F1, A1.

Theory: demos/theory.md, section 8.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import elliprd, elliprf

from geometry.errors import InputError

Array = NDArray[np.float64]

_NEWTON_STEPS = 30


class ShapeFactors(NamedTuple):
    """What the shape of the contact ellipse contributes to Hertz's formulas (no units).

    Attributes:
        axis_ratio_squared: β = b²/a² = 1 − e², in (0, 1].
        integral: K(e), the complete elliptic integral of the first kind.
        axis: 2 K F1/π; the major semi-axis is ``axis · sqrt(R w)``.
        force: F1(e).
        area: A1(e).
    """

    axis_ratio_squared: Array
    integral: Array
    axis: Array
    force: Array
    area: Array


def shape_factors(radius_major: ArrayLike, radius_minor: ArrayLike) -> ShapeFactors:
    """Return the shape factors of contacts with given principal radii.

    Args:
        radius_major: Larger principal radius R' [mm].
        radius_minor: Smaller principal radius R'' [mm].

    Raises:
        InputError: When a radius is not positive or R' < R''.

    Source:
        Waddad et al. 2016, eqs. 1 and 3, doi 10.1016/j.triboint.2015.12.023.
    """
    return _factors(_axis_ratio_squared(radius_major, radius_minor))


def axis_ratio(radius_major: ArrayLike, radius_minor: ArrayLike) -> Array:
    """Return b/a of the contact ellipse, to rounding error for R'/R'' up to 1e8 and beyond.

    Use it instead of the eccentricity for slender contacts: 1 − e² loses all digits at e → 1.

    Args:
        radius_major: Larger principal radius R' [mm].
        radius_minor: Smaller principal radius R'' [mm].

    Raises:
        InputError: When a radius is not positive or R' < R''.
    """
    return np.sqrt(_axis_ratio_squared(radius_major, radius_minor))


def eccentricity(radius_major: ArrayLike, radius_minor: ArrayLike) -> Array:
    """Return the exact eccentricity e of the contact ellipse, e² = 1 − b²/a².

    It is the root of ((a/b)² E(e) − K(e)) / (K(e) − E(e)) = R'/R''. In Carlson's integrals the
    left side is RD(0, 1, β)/RD(0, β, 1) with β = b²/a², free of cancellation for every shape.

    Args:
        radius_major: Larger principal radius R' [mm].
        radius_minor: Smaller principal radius R'' [mm].

    Raises:
        InputError: When a radius is not positive or R' < R''.

    Source:
        Johnson, Contact Mechanics (1985), eq. 4.25; Carlson's form from DLMF 19.25.1.
    """
    return np.sqrt(1.0 - _axis_ratio_squared(radius_major, radius_minor))


def eccentricity_approximate(radius_major: ArrayLike, radius_minor: ArrayLike) -> Array:
    """Return the approximation e ≈ sqrt(1 − (R''/R')^(4/3)), for comparison with the paper.

    Its b/a is within 0.1 % of the exact one at R'/R'' = 2 and 3 % off at 10.

    Args:
        radius_major: Larger principal radius R' [mm].
        radius_minor: Smaller principal radius R'' [mm].

    Raises:
        InputError: When a radius is not positive or R' < R''.

    Source:
        Waddad et al. 2016, eq. 2, doi 10.1016/j.triboint.2015.12.023.
    """
    return np.sqrt(1.0 - _radius_ratio(radius_major, radius_minor) ** (-4.0 / 3.0))


def force_factor(eccentricity: ArrayLike) -> Array:
    """Return F1(e) of P = 4/3 E* sqrt(R) F1 w^(3/2); F1(0) = 1.

    With K − E = (e²/3) RD(0, β, 1) and E/β − K = (e²/3) RD(0, 1, β) the paper's 1/e cancels.

    Args:
        eccentricity: e in [0, 1).

    Raises:
        InputError: When e lies outside [0, 1).

    Source:
        Waddad et al. 2016, eq. 1, doi 10.1016/j.triboint.2015.12.023.
    """
    return _factors(_complement(eccentricity)).force


def area_factor(eccentricity: ArrayLike) -> Array:
    """Return A1(e) = sqrt(1 − e²) (2 K F1/π)² of A = π R A1 w; A1(0) = 1.

    Args:
        eccentricity: e in [0, 1).

    Raises:
        InputError: When e lies outside [0, 1).

    Source:
        Waddad et al. 2016, eq. 3, doi 10.1016/j.triboint.2015.12.023.
    """
    return _factors(_complement(eccentricity)).area


def axis_factor(eccentricity: ArrayLike) -> Array:
    """Return 2 K F1/π of a = (2 K F1/π) sqrt(R w); 1 at e = 0.

    Args:
        eccentricity: e in [0, 1).

    Raises:
        InputError: When e lies outside [0, 1).
    """
    return _factors(_complement(eccentricity)).axis


def _factors(beta: Array) -> ShapeFactors:
    integral = elliprf(0.0, beta, 1.0)
    product = elliprd(0.0, 1.0, beta) * elliprd(0.0, beta, 1.0)
    force = np.pi / np.sqrt(6.0) * product**0.25 * integral**-1.5
    axis = 2.0 / np.pi * integral * force
    return ShapeFactors(beta, integral, axis, force, np.sqrt(beta) * axis**2)


def _axis_ratio_squared(radius_major: ArrayLike, radius_minor: ArrayLike) -> Array:
    """Solve ln RD(0, 1, β) − ln RD(0, β, 1) = ln R'/R'' for β by Newton's method in ln β.

    The slope in ln β is −1 + (β q − 1/q) / (2 (1 − β)) with q the left side: from −3/4 at β = 1,
    where the quotient is 0/0, to −1 at β → 0. The function is nearly straight, so the
    paper's eq. 2 as start leads to rounding error in a few steps.
    """
    target = np.log(_radius_ratio(radius_major, radius_minor))
    log_beta = -4.0 / 3.0 * target
    for _ in range(_NEWTON_STEPS):
        beta = np.exp(log_beta)
        ratio = elliprd(0.0, 1.0, beta) / elliprd(0.0, beta, 1.0)
        gap = 1.0 - beta
        flat = gap < 1e-5  # the quotient has lost half its digits; its limit is as good
        quotient = (beta * ratio - 1.0 / ratio) / (2.0 * np.where(flat, 1.0, gap))
        slope = np.where(flat, -0.75, quotient - 1.0)
        step = (target - np.log(ratio)) / slope
        log_beta = np.minimum(log_beta + step, 0.0)
        if np.all(np.abs(step) <= 4e-16 * (1.0 + np.abs(log_beta))):
            break
    return np.asarray(np.exp(log_beta))


def _radius_ratio(radius_major: ArrayLike, radius_minor: ArrayLike) -> Array:
    major, minor = np.asarray(radius_major, float), np.asarray(radius_minor, float)
    good = (minor > 0.0) & (major >= minor) & np.isfinite(major)
    if not np.all(good):
        first = tuple(float(radius[~good].flat[0]) for radius in np.broadcast_arrays(major, minor))
        raise InputError(
            "these principal radii do not describe a summit",
            value=first,
            allowed="finite R' ≥ R'' > 0 in mm",
        )
    return major / minor


def _complement(eccentricity: ArrayLike) -> Array:
    e = np.asarray(eccentricity, float)
    good = (e >= 0.0) & (e < 1.0)
    if not np.all(good):
        raise InputError(
            "this eccentricity is not one of an ellipse",
            value=float(e[~good].flat[0]),
            allowed="0 ≤ e < 1",
        )
    return (1.0 - e) * (1.0 + e)
