"""The kernel between asperities: symmetry, slopes, continuation where contacts merge."""

import numpy as np
import pytest
from helpers.asperity_states import places
from scipy.special import elliprf

from patchlaw.geometry.face_frame import mode_values
from patchlaw.micro import BodyModes, HertzContact
from patchlaw.micro.asperities.hertz_pairs import MERGING_SLOPE, HertzPairs, merging_parameter
from patchlaw.micro.boundary_elements.body_modes import BodyPoints
from patchlaw.micro.closed_forms import shape_factors


def interaction(asperities, circular):
    major = asperities.radius if circular else asperities.radius_major
    minor = asperities.radius if circular else asperities.radius_minor
    shape = shape_factors(major, minor)
    return HertzPairs(**places(asperities), shape=shape, circular=circular)


both_shapes = pytest.mark.parametrize("circular", [True, False], ids=["circular", "elliptic"])


def test_displacement_is_hertz_s_displacement(cluster):
    own = np.full(7, 2e-5)  # contacts small against the distances: nothing is continued
    caused = interaction(cluster, circular=False).evaluate(own)
    expected = np.zeros(7)
    for k in range(7):
        for i in set(range(7)) - {k}:
            contact = HertzContact(
                contact_modulus=1.0,
                radius_major=cluster.radius_major[i],
                radius_minor=cluster.radius_minor[i],
                indentation=own[i],
            )
            apart = (cluster.x[k] - cluster.x[i]) + 1j * (cluster.y[k] - cluster.y[i])
            local = apart * np.exp(-1j * cluster.angle[i])
            expected[k] += contact.displacement(local.real, local.imag)
    assert caused.displacement == pytest.approx(expected, rel=1e-13)  # same formula, pair by pair
    assert caused.overlapping_contacts == 0


@both_shapes
@pytest.mark.parametrize("depth", [1e-4, 3e-3, 3e-2])
def test_slopes_by_differences(cluster, circular, depth):
    rng = np.random.default_rng(0)
    own, kernel = depth * (0.5 + rng.random(7)), interaction(cluster, circular)
    own[3] = -depth  # out of contact: acts on nobody, has no column
    caused, step = kernel.evaluate(own), 1e-6 * depth
    assert caused.active.tolist() == [0, 1, 2, 4, 5, 6]
    for column, i in enumerate(caused.active):
        shift = np.where(np.arange(7) == i, step, 0.0)
        up, down = kernel.evaluate(own + shift), kernel.evaluate(own - shift)
        difference = (up.displacement - down.displacement) / (2 * step)
        # Truncation ~ step²; rounding of U over the step 1e-16/1e-6.
        assert caused.derivative[:, column] == pytest.approx(difference, abs=1e-8)
    assert np.all(caused.derivative <= MERGING_SLOPE + 1e-14)


@both_shapes
def test_continuation_is_smooth(summits, circular):
    pair = summits([0.5, 0.53], 0.5, major=[0.3, 0.1], minor=0.1, angle=0.4)
    kernel = interaction(pair, circular)
    depth = np.geomspace(1e-5, 1e-1, 4001)
    found = [kernel.evaluate(np.array([t, 0.0])) for t in depth]
    value = np.array([each.displacement[1] for each in found])
    slope = np.array([each.derivative[1, 0] for each in found])
    merged = np.array([each.overlapping_contacts for each in found]) > 0
    first = np.flatnonzero(merged)[0]
    assert 0 < first < 4000 and np.all(merged[first:])
    assert np.all(np.diff(slope) >= -1e-15) and np.all(np.abs(slope[merged] - slope[-1]) < 1e-15)
    # C¹: the slope jumps nowhere by more than its own growth over a step of 0.23 % in depth …
    assert np.diff(slope).max() < 3e-3
    # … and integrates to the displacement (trapezoidal rule, error ~ (step)² U''').
    area = np.sum(0.5 * (slope[1:] + slope[:-1]) * np.diff(depth))
    assert value[-1] - value[0] == pytest.approx(area, rel=1e-6)


def test_merging_parameter():
    beta = np.array([1.0, 0.5, 1e-2, 1e-6, 1e-12])
    integral = elliprf(0.0, beta, 1.0)
    v = merging_parameter(beta, integral)
    assert elliprf(1 + v, beta + v, v) / integral == pytest.approx(
        np.full(5, MERGING_SLOPE), rel=1e-14
    )
    assert 1 / np.sqrt(1 + v[0]) == pytest.approx(0.797, abs=5e-4)  # a/r where circles merge


def test_round_ellipses_are_circles(summits):
    rng = np.random.default_rng(3)
    balls = summits(*rng.random((2, 30)), major=0.02 + 0.1 * rng.random(30))
    own = 1e-3 * rng.random(30)
    circle, ellipse = (interaction(balls, circular).evaluate(own) for circular in (True, False))
    assert ellipse.displacement == pytest.approx(circle.displacement, rel=1e-12)
    assert ellipse.derivative == pytest.approx(circle.derivative, rel=1e-12, abs=0.0)


def test_body_between_points_counts_from_the_corner_of_its_top():
    rng = np.random.default_rng(2)
    half = rng.normal(size=(9, 9))
    body = BodyModes((2.0, 3.0), half @ half.T, (-0.5, -1.0))
    x, y = rng.random((2, 5))
    points = BodyPoints.at(body, x, y)
    along = mode_values(x + 0.5, 2.0, 3), mode_values(y + 1.0, 3.0, 3)
    modes = np.einsum("kp,lp->klp", *along).reshape(9, 5)
    expected = modes.T @ body.matrix @ modes
    np.testing.assert_allclose(points.by(points), expected, atol=1e-12 * np.abs(expected).max())
    force = rng.random(5)
    np.testing.assert_allclose(points.displacement(force), expected @ force, rtol=1e-10)
