"""Stresses below the cells of a half-space against closed forms."""

import numpy as np
import pytest

from patchlaw.micro.closed_forms import stresses_below

NU = 0.3


def hertz(cells, radius):
    """Return Hertz' pressures with p0 = 1 about the middle of a cell of a unit square."""
    place = (np.arange(cells) + 0.5) / cells
    x = place - place[cells // 2]
    return np.sqrt(np.maximum(1.0 - (x[:, None] ** 2 + x**2) / radius**2, 0.0))


def below(cells, radius, depths):
    """Return the stresses on the axis of a Hertz contact."""
    spacing = 1.0 / cells, 1.0 / cells
    row = cells // 2
    return stresses_below(hertz(cells, radius), spacing, NU, depths, row)[:, row]


def test_stresses_on_the_axis_of_a_hertz_contact():
    radius, ratio = 0.1, np.linspace(0.0, 3.0, 31)
    found = below(256, radius, radius * ratio)
    # Johnson 1985, eqs. 3.45
    vertical = -1.0 / (1.0 + ratio**2)
    radial = -(1.0 + NU) * (1.0 - ratio * np.arctan2(1.0, ratio)) - 0.5 * vertical
    # cells of 1/26 of the radius, and copies of the contact twenty radii away: see the rate below
    np.testing.assert_allclose(found[:, 2, 2], vertical, atol=1e-3)
    for axis in (0, 1):
        np.testing.assert_allclose(found[:, axis, axis], radial, atol=2e-3)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        assert np.abs(found[:, i, j]).max() < 1e-12


def test_largest_shear_lies_at_048_radii():
    depths = np.linspace(0.04, 0.06, 81)
    found = below(256, 0.1, depths)
    shear = 0.5 * np.abs(found[:, 0, 0] - found[:, 2, 2])
    # Johnson 1985, section 4.2: 0.31 p0 at 0.48 a for ν = 0.3; he gives two digits
    assert depths[shear.argmax()] == pytest.approx(0.048, abs=0.0005)
    assert shear.max() == pytest.approx(0.31, abs=0.003)


def test_copies_of_the_contact_fade_with_the_size_of_the_grid():
    errors = []
    for radius in (0.1, 0.05):
        found = below(256, radius, np.array([radius]))[0]
        errors.append(abs(found[2, 2] + 0.5) + abs(found[0, 0] + 1.3 * (1 - np.pi / 4) - 0.25))
    assert errors[1] < 0.5 * errors[0]


def test_a_force_on_one_cell_is_boussinesqs():
    cells, depth = 256, 0.04
    pressure = np.zeros((cells, cells))
    at = cells // 2
    pressure[at, at] = cells**2  # 1 N
    off = 6  # rows beside the force, so that no component vanishes
    found = stresses_below(pressure, (1 / cells,) * 2, NU, np.array([depth]), at + off)[0]
    x, y = (np.arange(cells) - at) / cells, off / cells
    near = np.abs(x) < 0.1
    r2 = x**2 + y**2
    rho = np.sqrt(r2 + depth**2)
    # Johnson 1985, eqs. 3.20, turned from polar coordinates
    flat = (1 - 2 * NU) * (1 - depth / rho) / r2
    radial = (flat - 3 * depth * r2 / rho**5) / (2 * np.pi)
    hoop = ((1 - 2 * NU) * depth / rho**3 - flat) / (2 * np.pi)
    expected = {
        (0, 0): (radial * x**2 + hoop * y**2) / r2,
        (1, 1): (radial * y**2 + hoop * x**2) / r2,
        (2, 2): -3 * depth**3 / (2 * np.pi * rho**5),
        (0, 1): (radial - hoop) * x * y / r2,
        (0, 2): -3 * x * depth**2 / (2 * np.pi * rho**5),
        (1, 2): -3 * y * depth**2 / (2 * np.pi * rho**5),
    }
    scale = np.abs(expected[2, 2]).max()
    for (i, j), closed in expected.items():
        # ten cells deep only the copies of the force are seen
        np.testing.assert_allclose(found[near, i, j], closed[near], atol=3e-4 * scale)
        np.testing.assert_array_equal(found[:, i, j], found[:, j, i])
