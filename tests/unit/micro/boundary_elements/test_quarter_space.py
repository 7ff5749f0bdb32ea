"""The compliance that a free side adds to the half-space, wave by wave along the edge."""

import numpy as np
import pytest
from helpers.boussinesq import stresses
from helpers.uneven_grid import uneven_grid

from patchlaw.geometry import Material
from patchlaw.micro.boundary_elements.free_sides import side_compliance, side_traction

RATIOS = [-0.5, 0.0, 0.15, 0.45]


@pytest.mark.parametrize("nu", RATIOS)
def test_compliance_is_symmetric_and_positive(nu):
    found = side_compliance(nu, np.geomspace(1e-3, 5.0, 12), np.array([1.0]))[0]
    # the spline of a symmetric table is symmetric but for rounding
    np.testing.assert_allclose(found, found.T, rtol=1e-12, atol=1e-12)
    assert np.linalg.eigvalsh(found).min() > 0.0


@pytest.mark.parametrize("nu", RATIOS)
def test_long_waves_see_a_wedge_in_plane_strain(nu):
    # A force on the apex of a wedge of angle 2α, its component along the axis over α + ½ sin 2α and
    # that across over α − ½ sin 2α (Johnson 1985, eq. 2.32, for half the plane): what it works with
    # each e-fold of distance, less 2/π in the half-plane.
    across, along = np.pi / 4 - 0.5, np.pi / 4 + 0.5
    limit = 0.5 / across + 0.5 / along - 2.0 / np.pi
    near = side_compliance(nu, np.array([1e-4, 1e-3]), np.array([1.0]))[0]
    slope = (near[0, 0] - near[1, 1]) / np.log(10.0)
    # 0.04 to 0.2 %: from the end of the table at 1e-8, and waves that are not yet long
    assert slope == pytest.approx(limit, rel=3e-3)


def test_only_distances_in_waves_matter():
    x = np.array([0.02, 0.1, 0.7])
    shorter = side_compliance(0.3, 3.0 * x, np.array([1.0]))[0]
    np.testing.assert_allclose(side_compliance(0.3, x, np.array([3.0]))[0], shorter, rtol=1e-12)


def test_a_far_side_adds_nothing():
    assert not side_compliance(0.3, np.array([50.0, 60.0]), np.array([1.0]))[0].any()


@pytest.mark.parametrize("nu", RATIOS)
def test_traction_on_the_side_is_that_of_the_half_space(nu):
    """Loads on small squares at ±x, their stress on x = 0 transformed along the edge."""
    logs = np.log(np.array([0.05, 0.4, 1.0]))
    logs = np.sort(np.concatenate([np.linspace(-12.0, 3.6, 200), logs]))
    table = side_traction(logs, nu)
    half, depth, place = 1e-3, 0.4, 1.0
    loads = uneven_grid(ticks_x=(place - half, place + half), ticks_y=(-half, half))
    y, step = np.linspace(-200.0, 200.0, 80001, retstep=True)
    point = np.zeros_like(y), y, np.full_like(y, depth)
    stress = (
        -stresses(Material(young_modulus=1.0, poisson_ratio=nu), *point, loads)[0, :, 0]
        / (2.0 * half) ** 2
    )
    expected = 2.0 * step * float(stress @ np.cos(y))  # of both loads
    row, column = np.searchsorted(logs, np.log([depth, place]) - 1e-12)
    # 4e-4 at most, of the spline between 200 distances and the sum that ends at 200
    assert table[row, column] == pytest.approx(expected, rel=1e-3)
