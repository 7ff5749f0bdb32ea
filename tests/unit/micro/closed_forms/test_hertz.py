"""Hertz contacts: records, shape factors, and the far field against Carlson's integrals."""

import numpy as np
import pytest
from scipy.special import ellipe, ellipk

from patchlaw import InputError
from patchlaw.micro import HertzContact
from patchlaw.micro.closed_forms import (
    NEAREST,
    confocal_parameter,
    elliptic_field,
    factors_at,
    far_field,
    shape_factors,
)


def test_sphere():
    E, R, w = 3000.0, 0.4, 0.002
    sphere = HertzContact(contact_modulus=E, radius_major=R, radius_minor=R, indentation=w)
    assert sphere.force == pytest.approx(4 / 3 * E * np.sqrt(R) * w**1.5)
    assert sphere.area == pytest.approx(np.pi * R * w)
    assert (sphere.semi_major, sphere.semi_minor) == pytest.approx((np.sqrt(R * w),) * 2)
    assert sphere.peak_pressure == pytest.approx(2 * E / np.pi * np.sqrt(w / R))


def test_ellipse_is_consistent():
    contact = HertzContact(
        contact_modulus=4000.0, radius_major=1.0, radius_minor=0.1, indentation=[1e-4, 1e-2]
    )
    assert contact.area == pytest.approx(np.pi * contact.semi_major * contact.semi_minor)
    assert contact.peak_pressure == pytest.approx(1.5 * contact.force / contact.area)
    ratio = contact.semi_minor / contact.semi_major
    assert ratio == pytest.approx(0.22225, abs=5e-6)  # 5 digits; see test_hertz_eccentricity


def test_no_indentation_no_contact():
    contact = HertzContact(
        contact_modulus=1.0, radius_major=2.0, radius_minor=1.0, indentation=[0.0, 0.1]
    )
    for values in (contact.force, contact.area, contact.peak_pressure, contact.semi_major):
        assert values[0] == 0.0 < values[1]
    assert contact.pressure(0.0, 0.0)[0] == 0.0
    assert contact.displacement(0.3, 0.0)[0] == 0.0


def test_fields_broadcast():
    contact = HertzContact(
        contact_modulus=1.0, radius_major=[2.0, 1.0], radius_minor=1.0, indentation=0.1
    )
    x, y = np.zeros((5, 1, 1)), np.zeros((3, 1))
    assert contact.pressure(x, y).shape == contact.displacement(x, y).shape == (5, 3, 2)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"contact_modulus": 0.0}, "0.0: the contact modulus must be positive"),
        ({"contact_modulus": np.inf}, "the contact modulus must be positive"),
        ({"indentation": [0.1, -0.2]}, "-0.2: an indentation is negative"),
        ({"indentation": np.nan}, "an indentation is negative or not a number"),
        ({"radius_minor": 3.0}, "these principal radii do not describe a summit"),
    ],
)
def test_refuses_contacts(change, problem):
    good = {"contact_modulus": 1.0, "radius_major": 2.0, "radius_minor": 1.0, "indentation": 0.1}
    with pytest.raises(InputError, match=problem):
        HertzContact(**(good | change))


BETA = np.array([1.0, 0.7, 0.1, 1e-4, 1e-9])


@pytest.mark.parametrize("v", [NEAREST, 100.0, 1e6])
@pytest.mark.parametrize("direction", [0.0, 0.6, np.pi / 2])
def test_series_is_exact(v, direction):
    # Points of the confocal ellipse v around five contacts with a = 0.1.
    x2 = 0.01 * (1 + v) * np.cos(direction) ** 2 * np.ones(5)
    y2 = 0.01 * (BETA + v) * np.sin(direction) ** 2
    s = np.full(5, 0.01)
    field, slope = far_field(x2, y2, s, BETA, np.full(5, v))
    exact_field, exact_slope = elliptic_field(x2, y2, s, BETA)
    assert field == pytest.approx(exact_field, rel=3e-15)  # truncated at 0.0222^9 = 1e-15
    assert slope == pytest.approx(exact_slope, rel=3e-15)


def test_series_fails_near_the_ellipse():
    # The threshold is needed: at v = 1 nine terms are worth three digits.
    x2, one = np.array([2.0]), np.array([1.0])
    _, slope = far_field(x2, 0 * x2, one, np.array([0.1]), one)
    _, exact = elliptic_field(x2, 0 * x2, one, np.array([0.1]))
    assert abs(slope / exact - 1) > 1e-6


def test_large_arrays_equal_single_points():
    rng = np.random.default_rng(2)
    x2, y2 = 10 ** rng.uniform(-4, 4, (2, 40, 50))
    s, beta = 10 ** rng.uniform(-2, 0, 50), rng.uniform(0.01, 1.0, 50)
    v = confocal_parameter(x2 / s, y2 / s, beta)
    assert (v == 0).any() and (v > NEAREST).any() and ((v > 0) & (v < NEAREST)).any()
    v_min = rng.uniform(0.0, 0.5, 50)
    field, slope = elliptic_field(x2, y2, s, beta, v_min)
    for k in range(40):  # rows of 50 points take Carlson's integrals throughout
        row_field, row_slope = elliptic_field(x2[k], y2[k], s, beta, v_min)
        assert field[k] == pytest.approx(row_field, rel=1e-14)
        assert slope[k] == pytest.approx(row_slope, rel=1e-14)


def paper_force_factor(e):
    """F1 as Waddad et al. 2016 print it below eq. 1; cancels for small e."""
    K, E = ellipk(e**2), ellipe(e**2)
    return np.pi / np.sqrt(2) / e * ((E / (1 - e**2) - K) * (K - E)) ** 0.25 * K**-1.5


@pytest.mark.parametrize("factor", ["force", "area", "axis"])
def test_circle_is_one(factor):
    # a few roundings of Carlson's integrals
    assert getattr(factors_at(0.0), factor) == pytest.approx(1.0, abs=4e-16)
    # Each factor is 1 + O(e²) with a coefficient below 1: no 0/0 and no noise on the way to e = 0.
    small = np.array([1e-12, 1e-9, 1e-6, 1e-4])
    assert np.all(np.abs(getattr(factors_at(small), factor) - 1.0) <= small**2 + 1e-15)


def test_factors_are_the_papers():
    e = np.array([0.3, 0.6, 0.9, 0.99])
    K = ellipk(e**2)
    F1, found = paper_force_factor(e), factors_at(e)
    # The paper's form loses about eps/e⁴ = 3e-14 at e = 0.3.
    assert found.force == pytest.approx(F1, rel=1e-13)
    assert found.axis == pytest.approx(2 * K * F1 / np.pi, rel=1e-13)
    assert found.area == pytest.approx(np.sqrt(1 - e**2) * (2 * K * F1 / np.pi) ** 2, rel=1e-13)


def test_slender_contact_follows_its_asymptote():
    # As β = b²/a² → 0: K → Λ, K − E → Λ − 1, E/β − K → 1/β with Λ = ln(4/√β), so that
    # R'/R'' → 1/(β (Λ − 1)); the next terms are of order β ln β, 1e-8 here.
    ratio = np.array([1e8, 1e10])
    beta = shape_factors(ratio, 1.0).axis_ratio_squared
    assert 1.0 / (beta * (np.log(4 / np.sqrt(beta)) - 1.0)) == pytest.approx(ratio, rel=1e-7)


def test_nearly_round_contact():
    # β = 1 − 4/3 ε + O(ε²) for R'/R'' = 1 + ε: no digit of ε is lost.
    excess = np.array([1e-12, 1e-9, 1e-6])
    ratio = 1.0 + excess
    exact_excess = ratio - 1.0
    assert 1.0 - shape_factors(ratio, 1.0).axis_ratio_squared == pytest.approx(
        4 / 3 * exact_excess, rel=2e-3
    )
    assert shape_factors(1.0, 1.0).axis_ratio == 1.0
    assert shape_factors(1.0, 1.0).eccentricity == 0.0


@pytest.mark.parametrize(
    "radii", [(1.0, 2.0), (1.0, 0.0), (-1.0, -2.0), (np.inf, 1.0), (np.nan, 1)]
)
def test_refuses_radii(radii):
    with pytest.raises(InputError, match=r"do not describe a summit.*finite R' ≥ R'' > 0"):
        shape_factors(*radii)
