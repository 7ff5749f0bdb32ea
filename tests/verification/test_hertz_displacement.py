"""Hertz contacts against direct integration: pressure, displacement, axis ratio."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from patchlaw.micro import HertzContact
from patchlaw.micro.closed_forms import (
    circular_field,
    confocal_parameter,
    elliptic_field,
    factors_at,
    shape_factors,
)

E_STAR = 4000.0
SHAPES = {"sphere": (0.2, 0.2), "ellipsoid": (0.5, 0.2), "slender": (3.0, 0.1)}
OUTSIDE = np.array([(1.05, 0.0), (0.0, 1.4), (0.9, 0.9), (3.0, -2.0)])
INSIDE = np.array([(0.0, 0.0), (0.5, 0.2), (-0.3, 0.8), (0.95, 0.0)])


@pytest.fixture(params=SHAPES)
def contact(request):
    major, minor = SHAPES[request.param]
    return HertzContact(
        contact_modulus=E_STAR, radius_major=major, radius_minor=minor, indentation=2e-3
    )


def integrated_displacement(contact, x, y):
    """Integrate p/(π E* ρ) along every ray from the point, so that 1/ρ drops out.

    Only the part of a ray inside the ellipse counts; both integrals are adaptive quadratures.
    """
    a, b = float(contact.semi_major), float(contact.semi_minor)

    def along_ray(phi):
        u, v = np.cos(phi), np.sin(phi)
        A = (u / a) ** 2 + (v / b) ** 2
        B = x * u / a**2 + y * v / b**2
        C = (x / a) ** 2 + (y / b) ** 2 - 1
        if B**2 - A * C <= 0:
            return 0.0
        half = np.sqrt(B**2 - A * C) / A
        start, end = max(-B / A - half, 0.0), -B / A + half
        if end <= start:
            return 0.0
        return quad(
            lambda t: np.sqrt(max(1 - ((x + t * u) / a) ** 2 - ((y + t * v) / b) ** 2, 0.0)),
            start,
            end,
            epsrel=1e-9,
        )[0]

    # The rays that graze the ellipse from outside are kinks of the outer integrand.
    grazing = grazing_angles(x / a, y / b)
    directions = sorted({np.arctan2(b * np.sin(s), a * np.cos(s)) % (2 * np.pi) for s in grazing})
    edges = [*directions, directions[0] + 2 * np.pi] if directions else [0.0, 2 * np.pi]
    total = sum(
        quad(along_ray, lo, hi, epsrel=1e-8, epsabs=1e-12, limit=200)[0]
        for lo, hi in pairwise(edges)
    )
    return float(contact.peak_pressure) * total / (np.pi * E_STAR)


def grazing_angles(x, y):
    """Directions in which rays from (x, y) touch the unit circle; none from inside."""
    r = np.hypot(x, y)
    if r <= 1:
        return ()
    towards, half = np.arctan2(-y, -x), np.arcsin(1 / r)
    return towards - half, towards + half


@pytest.mark.long
@pytest.mark.parametrize("point", [*INSIDE, *OUTSIDE], ids=str)
def test_displacement_is_the_integral_of_the_pressure(contact, point):
    x, y = point * (contact.semi_major, contact.semi_minor)
    # The nested quadratures ask for 1e-8; near the rim they reach a few times that.
    expected = integrated_displacement(contact, x, y)
    assert contact.displacement(x, y) == pytest.approx(expected, rel=1e-6)


def test_contact_follows_the_paraboloid(contact):
    x, y = INSIDE.T * np.array([[contact.semi_major], [contact.semi_minor]])
    shape = x**2 / (2 * contact.radius_major) + y**2 / (2 * contact.radius_minor)
    expected = contact.indentation - shape
    assert contact.displacement(x, y) == pytest.approx(expected, rel=1e-11)  # rounding of w − shape


def test_plane_stays_above_the_surface_outside(contact):
    angle = np.linspace(0, 2 * np.pi, 50)
    scale = np.geomspace(1.001, 30, 40)[:, None]
    x = scale * contact.semi_major * np.cos(angle)
    y = scale * contact.semi_minor * np.sin(angle)
    shape = x**2 / (2 * contact.radius_major) + y**2 / (2 * contact.radius_minor)
    assert np.all(contact.displacement(x, y) > contact.indentation - shape)


def test_pressure_adds_up_to_the_force(contact):
    nodes, weights = np.polynomial.legendre.leggauss(40)
    psi, dpsi = np.pi / 4 * (nodes + 1), np.pi / 4 * weights  # r = sin ψ removes the root
    angle = 2 * np.pi * np.arange(40) / 40
    x = contact.semi_major * np.sin(psi)[:, None] * np.cos(angle)
    y = contact.semi_minor * np.sin(psi)[:, None] * np.sin(angle)
    ring = contact.pressure(x, y).mean(axis=1) * 2 * np.pi
    force = (
        contact.semi_major * contact.semi_minor * np.sum(ring * np.sin(psi) * np.cos(psi) * dpsi)
    )
    # The rule is exact for the semi-ellipsoid; the root in `pressure` loses half the digits at
    # the rim, where it weighs least.
    assert force == pytest.approx(contact.force, rel=1e-11)
    assert contact.pressure(1.01 * contact.semi_major, 0.0) == 0.0


def test_far_away_is_a_point_force(contact):
    r = 1e4 * contact.semi_major
    angle = np.linspace(0, np.pi, 7)
    field = contact.displacement(r * np.cos(angle), r * np.sin(angle))
    point_force = contact.force / (np.pi * E_STAR * r)
    assert field == pytest.approx(np.full(7, point_force), rel=1e-8)  # next term ~ (a/r)²


@pytest.mark.parametrize("point", [*INSIDE, *OUTSIDE], ids=str)
@pytest.mark.parametrize("beta", [1.0, 0.4, 0.01])
def test_slope_in_squared_axis(point, beta):
    (x2, y2), s = np.square(point), np.array(1.0)
    value, slope = elliptic_field(x2, y2, s, np.array(beta))
    # By quadrature of dU/ds = ½ ∫_v^∞ dt / sqrt((1+t)(β+t)t), with t = v + τ²/(1−τ)² …
    v = float(confocal_parameter(x2, y2, np.array(beta)))

    def integrand(tau):
        t, jacobian = v + (tau / (1 - tau)) ** 2, 2 * tau / (1 - tau) ** 3
        return 0.5 * jacobian / np.sqrt((1 + t) * (beta + t) * t) if t > 0 else 1 / np.sqrt(beta)

    assert slope == pytest.approx(quad(integrand, 0, 1, epsrel=1e-12, limit=200)[0], rel=1e-10)
    # … and by central differences of U: error h² U''' ~ 1e-8, and 1e-16/h ~ 1e-11.
    h = 1e-5
    step = [elliptic_field(x2, y2, s + sign * h, np.array(beta))[0] for sign in (1, -1)]
    assert slope == pytest.approx((step[0] - step[1]) / (2 * h), rel=1e-6)
    assert value > 0.0


def test_circular_closed_form():
    a, r = 0.3, np.array([0.0, 0.1, 0.3, 0.31, 0.5, 2.0])
    field, slope = circular_field(r**2, np.full(6, a**2))
    out = np.maximum(r, a)
    asin, root = np.arcsin(a / out), np.sqrt(out**2 - a**2)
    johnson = np.where(
        r > a, ((2 * a**2 - r**2) * asin + a * root) / 2, np.pi / 2 * (a**2 - r**2 / 2)
    )
    assert field == pytest.approx(johnson, rel=1e-13)  # Johnson 1985, eq. 3.42
    assert slope == pytest.approx(asin, rel=1e-15)


def test_elliptic_field_of_a_circle():
    r2 = np.concatenate([np.linspace(0.0, 2.0, 41), np.geomspace(2.0, 1e8, 60)])
    s = np.ones_like(r2)
    for share in (0.0, 0.3, 1.0):  # any direction
        value, slope = elliptic_field(share * r2, (1 - share) * r2, s, s)
        circle, circle_slope = circular_field(r2, s)
        assert value == pytest.approx(circle, rel=1e-13)  # a few roundings, near and far
        # At the rim the slope has a vertical tangent in r: rounding of r is amplified to 1e-8.
        rim = np.abs(r2 - 1) < 1e-9
        assert slope[~rim] == pytest.approx(circle_slope[~rim], rel=1e-13)


def complete_integrals(beta):
    """K and E by quadrature of their definitions, with m = 1 − β."""

    def root(phi):
        return np.sqrt(np.cos(phi) ** 2 + beta * np.sin(phi) ** 2)

    options = {"epsabs": 0.0, "epsrel": 1e-13, "limit": 400}
    # The integrand of K varies over cos φ ~ √β: break the interval there.
    edge = np.pi / 2 - 3 * np.sqrt(beta)
    edges = [0.0, edge, np.pi / 2] if edge > 0 else [0.0, np.pi / 2]
    pieces = list(pairwise(edges))
    K = sum(quad(lambda phi: 1 / root(phi), lo, hi, **options)[0] for lo, hi in pieces)
    E = sum(quad(root, lo, hi, **options)[0] for lo, hi in pieces)
    return K, E


def radius_ratio(beta):
    """R'/R'' of a contact with b²/a² = β (Johnson 1985, eq. 4.25)."""
    K, E = complete_integrals(beta)
    return (E / beta - K) / (K - E)


@pytest.mark.parametrize("ratio", [1.1, 2.0, 10.0, 1e3, 1e5, 1e8])
def test_exact_root(ratio):
    log_beta = brentq(
        lambda t: np.log(radius_ratio(np.exp(t)) / ratio), -1.6 * np.log(ratio), -1e-3, xtol=1e-14
    )
    # K − E loses up to two digits at 1.1, quad keeps 1e-13.
    shape = shape_factors(ratio, 1.0)
    assert shape.axis_ratio == pytest.approx(np.exp(0.5 * log_beta), rel=1e-11)
    assert shape.eccentricity == pytest.approx(np.sqrt(-np.expm1(log_beta)), rel=1e-10)


@pytest.mark.parametrize("e", [0.2, 0.7, 0.99])
def test_force_factor(e):
    K, E = complete_integrals(1 - e**2)
    F1 = np.pi / np.sqrt(2) / e * ((E / (1 - e**2) - K) * (K - E)) ** 0.25 * K**-1.5
    assert factors_at(e).force == pytest.approx(F1, rel=1e-11)  # cancellation in the reference
