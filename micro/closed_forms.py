"""Closed forms: contact of one asperity (Hertz), and uniform pressure on rectangles (Love).

Around the contact, a semi-ellipsoidal pressure over the ellipse with semi-axes a ≥ b, β = b²/a² and
s = a², moves the surface by

    U = κ [ s RF(1+v, β+v, v) − X²/3 RD(β+v, v, 1+v) − Y²/3 RD(1+v, v, β+v) ],   κ s = p0 b/E*,

where v ≥ 0 is the root of X²/(1+v) + Y²/(β+v) = s, and 0 inside the ellipse. The integrand of the
underlying integral vanishes at its lower limit, so dU/ds = κ RF(1+v, β+v, v) exactly.
`elliptic_field` and `circular_field` return U/κ and (dU/ds)/κ.

Held at a fixed v, U is linear in s; a lower bound on v therefore continues U linearly, with
continuous slope, from the size at which the root falls below the bound.
`micro.asperities.hertz_pairs` uses this for merging contacts.

Far from the ellipse a series takes the place of Carlson's integrals. With τ = t + (1+β)/3 the
product under the root of the underlying integrals becomes (1+t)(β+t)t = τ³ (1 + e2/τ² + e3/τ³).
Expanded in 1/τ and integrated term by term, U and its slope are √x times polynomials in x = 1/τ(v)
whose coefficients depend on β alone. The ratio of their terms is below 2/(3τ): nine terms are exact
to rounding from τ = 30 on, some 5.5 major semi-axes away, at less than a tenth of the cost.

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
    Waddad et al. 2016, eqs. 10, 17, 18, doi 10.1016/j.triboint.2015.12.023; Carlson's integrals
    (DLMF 19.16) in place of the paper's eqs. 20–22.
    Love 1929; Johnson 1985, Contact Mechanics, section 3.2, in waves as in section 13.2.

Theory: docs/theory.md, sections 4 and 8.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike
from scipy import fft

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.face_frame import gauss_rule
from patchlaw.support import Array, InputError

NEAREST = 30.0
"""Smallest confocal parameter v for which the series is exact to rounding."""


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

    @property
    def axis_ratio(self) -> Array:
        """The ratio b/a; slender contacts keep all its digits, which 1 − e² loses at e → 1."""
        return np.sqrt(self.axis_ratio_squared)

    @property
    def eccentricity(self) -> Array:
        """The eccentricity e."""
        return np.sqrt(1.0 - self.axis_ratio_squared)


def shape_factors(radius_major: ArrayLike, radius_minor: ArrayLike) -> ShapeFactors:
    """Return the shape factors of contacts with given principal radii.

    The eccentricity is the root of ((a/b)² E(e) − K(e)) / (K(e) − E(e)) = R'/R''. In Carlson's
    integrals the left side is RD(0, 1, β)/RD(0, β, 1) with β = b²/a², free of cancellation for
    every shape.

    Args:
        radius_major: Larger principal radius R' [mm].
        radius_minor: Smaller principal radius R'' [mm].

    Raises:
        InputError: When a radius is not positive or R' < R''.

    Source:
        Waddad et al. 2016, eqs. 1 and 3, doi 10.1016/j.triboint.2015.12.023; Johnson, Contact
        Mechanics (1985), eq. 4.25; Carlson's form from DLMF 19.25.1.
    """
    return _factors(_axis_ratio_squared(radius_major, radius_minor))


def factors_at(eccentricity: ArrayLike) -> ShapeFactors:
    """Return the shape factors of contacts with given eccentricities.

    Args:
        eccentricity: e in [0, 1).

    Source:
        Waddad et al. 2016, eqs. 1 and 3, doi 10.1016/j.triboint.2015.12.023.
    """
    e = np.asarray(eccentricity, float)
    return _factors((1.0 - e) * (1.0 + e))


def _factors(beta: Array) -> ShapeFactors:
    """Return the factors; with Carlson's integrals the paper's 1/e cancels.

    K − E = (e²/3) RD(0, β, 1) and E/β − K = (e²/3) RD(0, 1, β).
    """
    integral = scipy.special.elliprf(0.0, beta, 1.0)
    product = scipy.special.elliprd(0.0, 1.0, beta) * scipy.special.elliprd(0.0, beta, 1.0)
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
    for _ in range(30):
        beta = np.exp(log_beta)
        ratio = scipy.special.elliprd(0.0, 1.0, beta) / scipy.special.elliprd(0.0, beta, 1.0)
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


def checked_modulus(contact_modulus: float) -> None:
    """Refuse a contact modulus that is not positive and finite.

    Raises:
        InputError: When it is not.
    """
    if not (contact_modulus > 0.0 and np.isfinite(contact_modulus)):
        raise InputError(
            "the contact modulus must be positive",
            value=contact_modulus,
            allowed="finite E* > 0 MPa",
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class HertzContact:
    """Frictionless elliptic contacts of paraboloids, each alone on the half-space.

    The arrays broadcast against each other; every result has the broadcast shape.

    Args:
        contact_modulus: E* [MPa].
        radius_major: Larger principal radius R' of the summit [mm].
        radius_minor: Smaller principal radius R'' [mm].
        indentation: Approach w ≥ 0 of the summit's contact [mm].

    Raises:
        InputError: When the modulus or a radius is not positive, R' < R'', or w < 0.

    Source:
        Johnson, Contact Mechanics (1985), ch. 4; Waddad et al. 2016, eqs. 1–5 and 17,
        doi 10.1016/j.triboint.2015.12.023.
    """

    contact_modulus: float
    radius_major: ArrayLike
    radius_minor: ArrayLike
    indentation: ArrayLike

    def __post_init__(self) -> None:
        checked_modulus(self.contact_modulus)
        lowest = np.min(np.asarray(self.indentation, float), initial=0.0)
        if not lowest >= 0.0:  # also NaN
            raise InputError(
                "an indentation is negative or not a number", value=float(lowest), allowed="w ≥ 0"
            )
        _ = self.factors  # checks the radii

    @cached_property
    def factors(self) -> ShapeFactors:
        """Shape factors of the contact ellipses."""
        return shape_factors(self.radius_major, self.radius_minor)

    @cached_property
    def radius(self) -> Array:
        """Equivalent radius R = sqrt(R' R'') [mm]."""
        return np.sqrt(np.asarray(self.radius_major, float) * np.asarray(self.radius_minor, float))

    @property
    def semi_major(self) -> Array:
        """Major semi-axis a = (2 K F1/π) sqrt(R w) [mm]."""
        return self.factors.axis * np.sqrt(self.radius * self._depth)

    @property
    def semi_minor(self) -> Array:
        """Minor semi-axis b [mm]."""
        return self.semi_major * self.factors.axis_ratio

    @property
    def force(self) -> Array:
        """Normal force P = 4/3 E* sqrt(R) F1 w^(3/2) [N]."""
        stiffness = 4.0 / 3.0 * self.contact_modulus * np.sqrt(self.radius) * self.factors.force
        return stiffness * self._depth**1.5

    @property
    def area(self) -> Array:
        """Contact area A = π R A1 w = π a b [mm²]."""
        return np.pi * self.radius * self.factors.area * self._depth

    @property
    def peak_pressure(self) -> Array:
        """Pressure at the centre, p0 = 3 P/(2 A) = E* w/(b K) [MPa], 0 without contact."""
        width = self.factors.axis * self.factors.axis_ratio * self.factors.integral
        return self.contact_modulus * np.sqrt(self._depth / self.radius) / width

    def pressure(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return p = p0 sqrt(1 − x²/a² − y²/b²) inside the ellipse and 0 outside [MPa].

        Args:
            x: Distance from the centre along the major axis [mm]; broadcasts.
            y: Distance along the minor axis [mm].

        Source:
            Waddad et al. 2016, eq. 4, doi 10.1016/j.triboint.2015.12.023.
        """
        major = np.where(self.semi_major > 0.0, self.semi_major, 1.0)
        minor = np.where(self.semi_minor > 0.0, self.semi_minor, 1.0)
        depth = 1.0 - np.square(x / major) - np.square(y / minor)
        return self.peak_pressure * np.sqrt(np.maximum(depth, 0.0))

    def displacement(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return the normal displacement of the surface, inside and outside the ellipse [mm].

        Args:
            x: Distance from the centre along the major axis [mm]; broadcasts.
            y: Distance along the minor axis [mm].

        Source:
            Waddad et al. 2016, eq. 17, doi 10.1016/j.triboint.2015.12.023.
        """
        size = self.radius * self.factors.axis**2
        s = size * self._depth
        safe = np.where(s > 0.0, s, 1.0)
        beta = self.factors.axis_ratio_squared
        field, _ = elliptic_field(np.square(x), np.square(y), safe, beta)
        return np.where(s > 0.0, field / (size * self.factors.integral), 0.0)

    @property
    def _depth(self) -> Array:
        return np.asarray(self.indentation, float)


def crowned_peak(
    radii: Sequence[float],
    contact_modulus: float,
    length: float,
    *,
    force: float = 0.0,
    approach: float = 0.0,
) -> float:
    """Return the largest pressure of a smooth crowned face on a plane [MPa].

    Args:
        radii: Radii of curvature along x and y, or the one of a cylinder [mm].
        contact_modulus: E* [MPa].
        length: Length of a cylinder [mm].
        force: Its force [N].
        approach: Its approach; the larger of both pressures counts [mm].

    Source:
        Johnson, Contact Mechanics (1985), eq. 4.24, 4.25 and 4.45; ellipses are circles of the
        geometric mean of the radii, and a cylinder's approach its depth of the circular segment.
    """
    modulus, radius = contact_modulus, math.sqrt(math.prod(radii))
    if len(radii) == 1:
        (radius,) = radii
        peak = math.sqrt(force / length * modulus / (math.pi * radius))
        return max(peak, modulus * math.sqrt(0.5 * approach / radius))
    peak = (6.0 * force * modulus**2 / (math.pi**3 * radius**2)) ** (1.0 / 3.0)
    return max(peak, 2.0 / math.pi * modulus * math.sqrt(approach / radius))


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
    pressure: Array, spacing: tuple[float, float], poisson_ratio: float, depths: Array, row: int
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
