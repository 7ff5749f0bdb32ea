"""The series of the far field against Carlson's integrals, one point at a time."""

import numpy as np
import pytest

from patchlaw.micro.closed_forms import NEAREST, confocal_parameter, elliptic_field, far_field

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
