"""Splines of many knots at scattered points, against FITPACK's own values."""

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from patchlaw.geometry.interpolant import at_points


@pytest.fixture(scope="module", params=[(5, 3000), (3000, 6), (2100, 2100)])
def whole(request):
    shape = request.param
    samples = np.random.default_rng(0).normal(size=shape)
    return RectBivariateSpline(*(np.arange(count) + 0.5 for count in shape), samples, s=0)


@pytest.mark.long
@pytest.mark.parametrize("order", [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 2)])
def test_values_are_those_of_the_whole(whole, order):
    spline = whole.partial_derivative(*order) if any(order) else whole
    x, y = (
        np.concatenate([[0.5, knots[-1]], knots[::7], np.linspace(0.5, knots[-1], 401)])
        for knots in whole.get_knots()
    )
    dice = np.random.default_rng(1)
    px, py = (dice.choice(part, (40, 50)) for part in (x, y))
    # the same sums of 16 terms of up to ten, in another order
    np.testing.assert_allclose(at_points(spline, px, py), spline(px, py, grid=False), atol=1e-13)
    np.testing.assert_allclose(
        at_points(spline, px[0], 0.7), spline(px[0], 0.7, grid=False), atol=1e-13
    )


def test_points_are_not_looked_for_from_the_first_knot(monkeypatch):
    """A long flat surface took minutes: FITPACK looks for each of its points from there."""
    spline = RectBivariateSpline(np.arange(4), np.arange(10_000), np.zeros((4, 10_000)))
    monkeypatch.setattr(type(spline), "__call__", None)
    assert not at_points(spline, 1.0, np.linspace(0.0, 9999.0, 50)).any()


def test_no_points_at_all(whole):
    assert at_points(whole, np.zeros(0), np.zeros(0)).shape == (0,)
