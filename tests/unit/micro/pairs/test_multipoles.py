"""The far field as a series of moments."""

import numpy as np
import pytest

from micro.closed_forms.ellipse import shape_factors
from micro.closed_forms.hertz_field import elliptic_field
from micro.pairs.multipoles import angular_polynomials, moments, pair_terms, series_coefficients


def test_coefficients_are_those_of_the_transform():
    # 3 (sin κ − κ cos κ)/κ³ = Σ c_j (−κ²)^j
    kappa = np.array([0.3, 1.0, 2.0])
    exact = 3.0 * (np.sin(kappa) - kappa * np.cos(kappa)) / kappa**3
    series = sum(c * (-(kappa**2)) ** j for j, c in enumerate(series_coefficients(12)))
    assert series == pytest.approx(exact, rel=1e-13)


def test_polynomials_are_derivatives():
    # D (1/r) by central differences with a² = 1; truncation h²/12 · 4th derivative ~ 1e-6.
    beta, (x, y), h = np.array([0.3]), (0.8, 0.7), 1e-3

    def inverse(u, v):
        return 1.0 / np.hypot(u, v)

    xx = (inverse(x + h, y) - 2 * inverse(x, y) + inverse(x - h, y)) / h**2
    yy = (inverse(x, y + h) - 2 * inverse(x, y) + inverse(x, y - h)) / h**2
    r, angle = np.hypot(x, y), np.arctan2(y, x)
    _, second = pair_terms(
        np.array([r]), np.array([np.cos(2 * angle)]), angular_polynomials(beta, 2)
    )
    assert second == pytest.approx([xx + 0.3 * yy], rel=1e-5)


@pytest.mark.parametrize("ratio", [1.0, 3.0, 30.0])
@pytest.mark.parametrize(("terms", "reach"), [(5, 8.0), (3, 6.0)])
def test_series_is_the_field(ratio, terms, reach):
    shape = shape_factors(ratio, 1.0)
    size, t = 0.1 * shape.axis**2, 1e-3
    angle = np.linspace(0.0, np.pi, 19)
    for distance in (reach, 2 * reach, 10 * reach):
        r = distance * np.sqrt(size * t)
        x, y = r * np.cos(angle), r * np.sin(angle)
        field, _ = elliptic_field(x**2, y**2, size * t, shape.axis_ratio_squared)
        exact = field / (size * shape.integral)
        parts = moments(np.atleast_1d(t), size, shape.integral, terms)
        polynomials = angular_polynomials(np.atleast_1d(shape.axis_ratio_squared), terms)
        series = sum(
            moment * term
            for moment, term in zip(
                parts, pair_terms(np.full(19, r), np.cos(2 * angle), polynomials), strict=True
            )
        )
        # The first term left out, 3/((2j + 1)(2j + 3)) (a/r)^2j; rounding beyond.
        bound = 3.0 / ((2 * terms + 1) * (2 * terms + 3)) * distance ** (-2.0 * terms)
        assert series == pytest.approx(exact, rel=1.1 * bound + 1e-13)
