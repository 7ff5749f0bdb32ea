"""Splines of many knots, against FITPACK's own values; work is counted, not timed."""

import pickle

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from geometry.blocked_spline import MOST_KNOTS, BlockedSpline


@pytest.fixture(scope="module", params=[(5, 3000), (3000, 6), (2100, 2100)])
def whole(request):
    shape = request.param
    samples = np.random.default_rng(0).normal(size=shape)
    return RectBivariateSpline(*(np.arange(count) + 0.5 for count in shape), samples, s=0)


@pytest.mark.parametrize("order", [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 2)])
def test_values_are_those_of_the_whole(whole, order):
    spline = whole.partial_derivative(*order) if any(order) else whole
    x, y = (
        np.concatenate([[0.5, knots[-1]], knots[::7], np.linspace(0.5, knots[-1], 401)])
        for knots in whole.get_knots()
    )
    dice = np.random.default_rng(1)
    px, py = (dice.choice(part, (40, 50)) for part in (x, y))
    blocked = BlockedSpline(spline)
    np.testing.assert_array_equal(blocked(px, py, grid=False), spline(px, py, grid=False))
    again = pickle.loads(pickle.dumps(blocked))
    np.testing.assert_array_equal(again(px[0], 0.7, grid=False), spline(px[0], 0.7, grid=False))


def test_points_are_looked_for_among_few_knots():
    """A long flat surface took minutes: each of its points was looked for from the first knot."""
    spline = RectBivariateSpline(np.arange(4), np.arange(5 * MOST_KNOTS), np.zeros((4, 10_000)))
    blocked = BlockedSpline(spline)
    assert not blocked(1.0, np.linspace(0.0, 5 * MOST_KNOTS - 1.0, 50), grid=False).any()
    longest = [max(map(len, block.get_knots())) for block in blocked.blocks.values()]
    assert len(longest) == 20 and max(longest) < MOST_KNOTS / 3


def test_no_points_at_all(whole):
    assert BlockedSpline(whole)(np.zeros(0), np.zeros(0), grid=False).shape == (0,)
