"""The interpolant of heights: what it reproduces, its maxima, splines of many knots."""

import pickle

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from patchlaw.geometry import Surface
from patchlaw.geometry.interpolant import Interpolant, at_points


def cap(x, y):
    return 1.0 + x - 2.0 * y + 0.4 * x * y - 0.9 * x**2 - 0.7 * y**2


def test_quadratics_that_curve_downwards_are_reproduced_up_to_the_border():
    lengths = (1.0, 2.0)
    blank = Surface(heights=np.zeros((7, 9)), lengths=lengths)
    x, y = np.meshgrid(blank.x, blank.y, indexing="ij")
    h = Interpolant(cap(x, y), lengths)
    px, py = np.meshgrid(np.linspace(0.0, 1.0, 11), np.linspace(0.0, 2.0, 11), indexing="ij")
    # so are its heights on the border, which nothing bounds; rounding grows near the border
    np.testing.assert_allclose(h(px, py), cap(px, py), atol=1e-12)
    np.testing.assert_allclose(h(px, py, dx=1), 1.0 + 0.4 * py - 1.8 * px, atol=1e-11)
    np.testing.assert_allclose(h(px, py, dx=1, dy=1), np.full(px.shape, 0.4), atol=1e-10)


@pytest.mark.parametrize("shape", [(4, 4), (5, 31), (40, 8)])
@pytest.mark.parametrize("periodic", [False, True])
def test_samples_are_met(shape, periodic):
    heights = np.random.default_rng(3).normal(size=shape)
    surface = Surface(heights=heights, lengths=(1.0, 2.0), periodic=periodic)
    x, y = np.meshgrid(surface.x, surface.y, indexing="ij")
    np.testing.assert_allclose(surface.height_at(x, y), heights, atol=1e-13)  # rounding


@pytest.mark.parametrize("dx, dy", [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)])
def test_periodic_interpolant_is_smooth_over_the_border(dx, dy):
    heights = np.random.default_rng(4).normal(size=(8, 9))
    h = Interpolant(heights, (1.0, 1.0), periodic=True)
    t = np.linspace(0.0, 1.0, 17)
    # wrapped padding decays to 1e-16 of the samples; two derivatives cost (8 cells per mm)²
    np.testing.assert_allclose(h(0.0, t, dx=dx, dy=dy), h(1.0 - 1e-15, t, dx=dx, dy=dy), atol=1e-10)
    np.testing.assert_allclose(h(t, -0.3, dx=dx, dy=dy), h(t + 2.0, 1.7, dx=dx, dy=dy), atol=1e-10)


def test_periodic_interpolant_is_the_periodic_spline():
    from scipy.interpolate import make_interp_spline

    heights = np.random.default_rng(5).normal(size=(12, 6))
    x = (np.arange(13) + 0.5) / 12
    y = (np.arange(7) + 0.5) / 6
    wrapped = np.pad(heights, ((0, 1), (0, 1)), mode="wrap")
    along_x = make_interp_spline(x, wrapped, k=3, bc_type="periodic")
    px, py = np.random.default_rng(6).uniform(1 / 6, 1.0, (2, 50))
    exact = [
        make_interp_spline(y, along_x(a), k=3, bc_type="periodic")(b)
        for a, b in zip(px, py, strict=True)
    ]
    h = Interpolant(heights, (1.0, 1.0), periodic=True)
    np.testing.assert_allclose(h(px, py), exact, atol=1e-12)  # padding error 1e-16, rounding


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("seed", [0, 1, 19, 73])  # the last two: not below the best fine sample
def test_maximum_of_noise_against_dense_sampling(seed, periodic):
    # white noise is the hardest case: the interpolant overshoots far from its samples
    heights = np.random.default_rng(seed).normal(size=(12, 15))
    surface = Surface(heights=heights, lengths=(1.2, 1.5), periodic=periodic)
    x, y = np.linspace(0.0, 1.2, 601), np.linspace(0.0, 1.5, 751)
    dense = surface.height_at(x[:, None], y[None, :]).max()
    # dense sampling misses the top by at most |h''| d²/4 ≈ 10 · 50² / 10⁴ (d = 0.02 cells) ≈ 2e-3
    assert dense - 1e-12 <= surface.highest <= dense + 2e-3
    x_top, y_top = surface.highest_point
    assert surface.height_at(x_top, y_top) == pytest.approx(surface.highest, abs=1e-12)


@pytest.mark.parametrize("value", [0.0, -3.7])
@pytest.mark.parametrize("shape", [(4, 4), (64, 64), (200, 200)])
def test_maximum_of_a_flat_surface(value, shape):
    surface = Surface(heights=np.full(shape, value), lengths=(1.0, 1.0))
    assert surface.highest == pytest.approx(value, abs=1e-13)  # rounding of the spline's sums


@pytest.mark.parametrize("periodic", [False, True])
def test_what_heights_count_from_does_not_matter(periodic):
    level = Interpolant(np.full((8, 9), 3.0), (1.0, 1.0), periodic=periodic)
    t = np.linspace(0.0, 1.0, 12)
    assert np.all(level(t[:, None], t) == 3.0) and level.maximum()[2] == 3.0
    assert np.all(level(t, t, dx=1) == 0.0)
    heights = np.round(np.random.default_rng(8).normal(size=(9, 8)), 3)
    low, high = (Interpolant(heights + base, (1.0, 1.0), periodic=periodic) for base in (0.0, 1e6))
    # the heights themselves are rounded to 1e-10 at 1e6, by 8 cells per mm in a slope
    np.testing.assert_allclose(high(t, t, dx=1), low(t, t, dx=1), atol=1e-8)
    np.testing.assert_allclose(high.maximum()[:2], low.maximum()[:2], atol=1e-8)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("far", [1.0, 1.7])
@pytest.mark.parametrize(("dx", "dy"), [(0, 0), (1, 0), (1, 1)])
def test_lattices_are_evaluated_like_points(periodic, far, dx, dy):
    heights = np.random.default_rng(7).normal(size=(9, 12))
    h = Interpolant(heights, (1.0, 2.0), periodic=periodic)
    if not periodic:
        far = 1.0
    # falling ones, and those that go around a periodic surface, are points like others
    for x in (np.linspace(0.0, far, 30), np.linspace(far, 0.0, 30)):
        y = np.linspace(0.0, 2.0 * far, 21)
        points = h(*np.meshgrid(x, y, indexing="ij"), dx=dx, dy=dy)
        lattice = h(x[:, None], y[None, :], dx=dx, dy=dy)
        np.testing.assert_allclose(lattice, points, atol=1e-12 * np.abs(points).max())  # rounding


def test_derivatives_are_not_pickled():
    heights = np.random.default_rng(6).normal(size=(64, 64))
    h = Interpolant(heights, (1.0, 1.0))
    place = np.random.default_rng(7).uniform(size=(2, 50))
    orders = [(0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)]
    values = [h(*place, dx=dx, dy=dy) for dx, dy in orders]
    content = pickle.dumps(h)
    assert len(content) < 8 * heights.size + 4_000  # the spline's coefficients, and its knots
    again = pickle.loads(content)
    for (dx, dy), value in zip(orders, values, strict=True):
        np.testing.assert_array_equal(again(*place, dx=dx, dy=dy), value)
    np.testing.assert_array_equal(h(*place, dx=1), values[1])  # what was pickled still has them


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
