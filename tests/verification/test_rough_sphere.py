"""A crowned face with a law of rough contact: the rough sphere of Greenwood & Tripp 1967."""

import numpy as np
import pytest
from helpers.rough_sphere_on_block import forces_on_strips
from helpers.rough_sphere_oracle import EXPONENTIAL, gaussian, moment, rough_sphere
from scipy.integrate import quad

GAUSSIAN = gaussian()


@pytest.mark.parametrize("u", [-14.0, -9.5, -1.0, 0.0, 2.5])
def test_moments_of_gaussian_heights(u):
    def integrand(s):
        return (s - u) ** 1.5 * np.exp(-0.5 * s * s) / np.sqrt(2.0 * np.pi)

    exact, _ = quad(integrand, u, 12.0, epsrel=1e-10, points=[0.0], limit=200)
    assert moment(1.5, u) == pytest.approx(exact, rel=1e-6)
    assert GAUSSIAN.force(u) == pytest.approx(exact, rel=1e-6)


@pytest.mark.long
def test_a_smooth_sphere_is_hertz():
    errors = []
    for alpha in (0.02, 0.01, 0.005):
        found = rough_sphere(17.0, alpha, GAUSSIAN, rings=600)
        errors.append((found.radius - 1.0, 1.0 - found.peak))
    radius, peak = np.array(errors).T
    # first order in α, once the summits are stiff
    assert np.all((0.0 < radius) & (radius < 1.0 * np.array([0.02, 0.01, 0.005])))
    assert np.all((0.0 < peak) & (peak < 1.3 * np.array([0.02, 0.01, 0.005])))
    assert np.all(np.diff(radius) < 0.0) and np.all(np.diff(peak) < 0.0)


def test_light_loads_have_a_radius_of_their_own():
    """Where the body is hardly displaced p ~ exp(−ρ²): the radius tends to (3/4) sqrt(2π R σ)."""
    found = rough_sphere(4.0, 100.0, EXPONENTIAL, beyond=5.0)
    assert found.radius * found.hertz == pytest.approx(0.75 * np.sqrt(np.pi), rel=2e-4)


def test_exponential_heights_do_not_know_the_number_of_summits():
    """μ exp(−u) is exp(−(u − ln μ)): only the separation changes."""
    few, many = (rough_sphere(mu, 0.5, EXPONENTIAL) for mu in (4.0, 17.0))
    np.testing.assert_allclose(few.pressure, many.pressure, rtol=1e-9)
    assert many.separation - few.separation == pytest.approx(np.log(17.0 / 4.0), rel=1e-9)


@pytest.mark.parametrize("mu", [4.0, 17.0])
def test_hertz_errs_by_seven_percent_at_most_up_to_a_roughness_of_a_twentieth(mu):
    """What Greenwood, Johnson & Matsubara 1984 read off (doi 10.1016/0043-1648(84)90005-X)."""
    found = rough_sphere(mu, 0.05, GAUSSIAN)
    assert 0.03 < 1.0 - found.peak < 0.07
    assert 0.02 < found.radius - 1.0 < 0.07
    rougher = rough_sphere(mu, 0.5, GAUSSIAN)
    assert rougher.peak < 0.75 and rougher.radius > 1.2


def check(found, exact, allowed):
    """Compare the distribution of the pressure, and effective radii."""
    assert np.abs(found - exact).max() < allowed * exact.max()
    middle = len(found) // 2
    # the force over the middle strip, up to a factor that both have
    assert found.sum() / found[middle] == pytest.approx(exact.sum() / exact[middle], rel=allowed)


@pytest.mark.long
def test_a_rough_sphere_on_a_coarse_mesh():
    # cells of 0.4 Hertz' radii
    check(*forces_on_strips(4.0, 0.5, EXPONENTIAL, cells=15, beyond=3.0), allowed=0.02)


@pytest.mark.long
@pytest.mark.parametrize(
    ("mu", "alpha", "cells"),
    [
        pytest.param(4.0, 0.05, 27, marks=pytest.mark.slow),
        pytest.param(17.0, 0.5, 25, marks=pytest.mark.slow),
        (4.0, 5.0, 17),
    ],
)
def test_rough_spheres(mu, alpha, cells):
    check(*forces_on_strips(mu, alpha, GAUSSIAN, cells=cells, beyond=2.5), allowed=0.012)
