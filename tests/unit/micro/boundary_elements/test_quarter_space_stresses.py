"""The surface stresses that a free side adds to the half-space's, wave by wave along the edge."""

import numpy as np
import pytest
from helpers.boussinesq import stresses
from helpers.uneven_grid import uneven_grid

from patchlaw.geometry import Material
from patchlaw.micro.boundary_elements.free_sides import side_pressure_stresses, side_stresses

RATIOS = [-0.5, 0.0, 0.15, 0.45]


@pytest.mark.parametrize("nu", RATIOS)
def test_the_side_is_free(nu):
    """At the side, the half-space's stresses by a line load are taken off."""
    places = np.array([0.1, 0.4, 1.0, 3.0])
    found = side_stresses(nu, np.concatenate([[1e-6], places]), np.ones(1))[:, 0, 0, 1:]
    half_space = (0.5 - nu) * np.exp(-places)
    # 2e-4 and 2e-5: from the end of the table at 1e-11, and the distance 1e-6
    assert found[0] == pytest.approx(-half_space, abs=4e-4)
    assert found[2] == pytest.approx(half_space, abs=5e-5)


@pytest.mark.parametrize("nu", RATIOS)
def test_a_line_load_at_the_edge_presses_a_wedge(nu):
    # Force P along one face of a wedge of 90°: at the distance r on the other face the radial
    # stress P/2r (1/(π/4 − ½) − 1/(π/4 + ½)) (Johnson 1985, eq. 2.32), in plane strain.
    expected = 0.5 / (np.pi / 4 - 0.5) - 0.5 / (np.pi / 4 + 0.5)
    found = side_stresses(nu, np.array([1e-4, 1.0]), np.array([1e-4]))[:, 0, 1, 0]
    # 2e-4: from the place of the load, and waves that are not yet long
    assert found[0] == pytest.approx(expected, rel=1e-3)
    assert found[1] == pytest.approx(nu * expected, abs=1e-3)
    assert abs(found[2]) < 1e-3


def test_only_distances_in_waves_matter():
    x = np.array([0.02, 0.1, 0.7])
    shorter = 3.0 * side_stresses(0.3, 3.0 * x, np.ones(1))
    np.testing.assert_allclose(side_stresses(0.3, x, np.array([3.0])), shorter, rtol=1e-12)


def test_a_far_side_adds_nothing():
    assert not side_stresses(0.3, np.array([50.0, 60.0]), np.ones(1)).any()


@pytest.mark.parametrize("nu", RATIOS)
def test_stresses_by_pressure_on_the_side_are_those_of_the_half_space(nu):
    """Loads on small squares at ±z on the side, their stresses transformed along the edge."""
    logs = np.log(np.array([0.4, 1.0]))
    logs = np.sort(np.concatenate([np.linspace(-12.0, 3.6, 200), logs]))
    row, column = np.searchsorted(logs, np.log([0.4, 1.0]) - 1e-12)
    table = side_pressure_stresses(logs, nu)[:, row, column]
    half, depth, place = 1e-3, 0.4, 1.0  # depth below the side is distance on the top
    loads = uneven_grid(ticks_x=(place - half, place + half), ticks_y=(-half, half))
    y, step = np.linspace(-200.0, 200.0, 80001, retstep=True)
    points = np.zeros_like(y), y, np.full_like(y, depth)
    # xx, yy, zz, yz, zx, xy about the side's surface: its z is the top's x
    stress = (
        stresses(Material(young_modulus=1.0, poisson_ratio=nu), *points, loads)[:, :, 0]
        / (2.0 * half) ** 2
    )
    cosine, sine = (2.0 * step * wave(y) for wave in (np.cos, np.sin))
    expected = stress[2] @ cosine, stress[1] @ cosine, stress[3] @ sine
    # 4e-4 at most, of the spline between 200 distances and the sum that ends at 200
    assert table == pytest.approx(np.array(expected), rel=1e-3, abs=2e-4)
