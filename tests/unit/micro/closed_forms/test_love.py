"""Love's rectangle against direct integration, high precision and sums over cells."""

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from helpers.boussinesq import love_integral
from scipy.integrate import dblquad

from patchlaw.geometry import PatchGrid
from patchlaw.micro import influence_matrix
from patchlaw.micro.closed_forms import love_centre, love_mean, love_mutual, mutual_influence


def integrated(x, y, a, b):
    """Integrate 1/distance over the rectangle, split at the point's own coordinates."""

    def pieces(half, point):
        return pairwise(np.unique([-half, np.clip(point, -half, half), half]))

    return sum(
        dblquad(lambda v, u: 1 / np.hypot(u - x, v - y), x0, x1, y0, y1, epsabs=1e-9)[0]
        for x0, x1 in pieces(a, x)
        for y0, y1 in pieces(b, y)
    )


@pytest.mark.parametrize(("a", "b"), [(0.5, 0.5), (1.0, 0.25)])
@pytest.mark.parametrize("point", [(0.0, 0.0), (0.2, -0.1), (1.5, 0.3), (0.0, 2.0), (-3.0, -4.0)])
def test_integral_everywhere(point, a, b):
    # dblquad resolves the 1/r singularity at a corner of its pieces to about 1e-7.
    assert love_integral(*point, a, b) == pytest.approx(integrated(*point, a, b), rel=1e-6)


def test_square_of_side_one():
    # s p/E* times 1.122 at the centre, 0.946 in the mean, 0.561 in a corner (Love 1929).
    assert love_centre(0.5, 0.5) / np.pi == pytest.approx(4 * np.arcsinh(1) / np.pi, rel=1e-15)
    assert love_centre(0.5, 0.5) / np.pi == pytest.approx(1.1222, abs=5e-5)
    assert love_mean(0.5, 0.5) / np.pi == pytest.approx(0.9464, abs=5e-5)
    corner = love_integral([0.5, -0.5], [0.5, 0.5], 0.5, 0.5) / np.pi
    assert corner == pytest.approx(0.5611, abs=5e-5)


@pytest.mark.parametrize(("a", "b"), [(0.5, 0.5), (1.0, 0.1), (0.2, 3.0)])
def test_mean_is_the_average(a, b):
    nodes, weights = np.polynomial.legendre.leggauss(200)
    values = love_integral(a * nodes[:, None], b * nodes, a, b)
    average = 0.25 * weights @ values @ weights
    assert love_mean(a, b) == pytest.approx(average, rel=1e-8)  # the rule's own error is 1e-9
    assert love_centre(a, b) == pytest.approx(love_integral(0.0, 0.0, a, b), rel=1e-15)


@pytest.mark.parametrize("offset", [(1.0, 0.0), (1.0, 0.5), (0.3, 0.2), (4.0, -3.0)])
def test_mutual_mean(offset):
    a, b = 0.5, 0.25
    nodes, weights = np.polynomial.legendre.leggauss(200)
    values = love_integral(offset[0] + a * nodes[:, None], offset[1] + b * nodes, a, b)
    average = 0.25 * weights @ values @ weights
    # Borders of the source inside the target spoil the product rule: 4e-6 with overlap.
    assert love_mutual(*offset, a, b) == pytest.approx(average, rel=1e-5)
    # The two rectangles act on each other alike.
    opposite = love_mutual(-offset[0], -offset[1], a, b)
    assert love_mutual(*offset, a, b) == pytest.approx(opposite, rel=1e-13)


def test_far_away_is_a_point_force():
    distance = np.array([50.0, 200.0])
    far = love_integral(0.6 * distance, 0.8 * distance, 0.5, 0.5)
    # Next term of the expansion: 0 by symmetry of the square up to s²/(24 r²), 1.7e-5 at 50.
    assert far * distance == pytest.approx(np.ones(2), rel=2e-5)
    assert love_mutual(300.0, 400.0, 0.5, 0.5) * 500.0 == pytest.approx(1.0, rel=1e-5)


def test_finite_and_continuous_across_borders():
    for x, y in [(0.5, 0.5), (0.5, 0.1), (-0.5, 0.0), (0.0, 0.5)]:
        on = love_integral(x, y, 0.5, 0.5)
        near = love_integral(x + np.array([-1e-12, 1e-12, 1e-300]), y, 0.5, 0.5)
        assert np.all(np.isfinite(near))
        assert near == pytest.approx(np.full(3, on), rel=1e-10)  # slope is logarithmic: 30 · 1e-12


def _exact(dx, dy, a, b):
    """The closed form with 50 digits, from which nothing cancels."""
    with mpmath.workdps(50):
        dx, dy, a, b = map(mpmath.mpf, (dx, dy, a, b))

        def fourfold(u, v):
            rho = mpmath.sqrt(u * u + v * v)
            logs = u * mpmath.asinh(v / abs(u)) + v * mpmath.asinh(u / abs(v)) if u and v else 0
            return u * v * logs / 2 - rho**3 / 6

        total = sum(
            p * q * fourfold(dx + 2 * i * a, dy + 2 * j * b)
            for i, p in ((-1, 1), (0, -2), (1, 1))
            for j, q in ((-1, 1), (0, -2), (1, 1))
        )
        return float(total / (4 * a * b))


@pytest.mark.parametrize(
    ("a", "b", "error"), [(0.5, 0.5, 1e-12), (0.1, 0.5, 1e-11), (0.5, 0.05, 1e-10)]
)
def test_mutual_influence_at_any_distance(a, b, error):
    for k in (0, 1, 3, 4, 5, 6, 7, 8, 15, 40, 200, 5000):
        for m in (0, 1, 4, 16, 45, 70):
            dx, dy = 2 * a * k, 2 * b * m
            assert mutual_influence(dx, dy, a, b) == pytest.approx(_exact(dx, dy, a, b), rel=error)


def test_matrix_is_symmetric_with_loves_mean_on_the_diagonal():
    patches = PatchGrid(grid=(3, 5), lengths=(1.0, 1.3), origin=(0.2, -0.1))
    influence = influence_matrix(patches)
    assert np.array_equal(influence, influence.T)
    assert np.diag(influence) == pytest.approx(float(love_mean(*patches.half_sizes)), rel=1e-14)
    i, j = 3, 11
    apart = patches.centres[i] - patches.centres[j]
    direct = mutual_influence(*apart, *patches.half_sizes)
    assert influence[i, j] == pytest.approx(direct, rel=1e-12)


def test_finer_patches_sum_up_to_coarser_ones():
    coarse, fine = (PatchGrid(grid=grid, lengths=(1.0, 2.0)) for grid in ((2, 3), (8, 9)))
    owner = coarse.index_of(*fine.centres.T)
    gather = np.equal.outer(np.arange(coarse.count), owner)
    means = gather / gather.sum(axis=1, keepdims=True)
    # the same pressure on all parts; means of the parts' means
    assert means @ influence_matrix(fine) @ gather.T == pytest.approx(
        influence_matrix(coarse), rel=1e-12
    )
