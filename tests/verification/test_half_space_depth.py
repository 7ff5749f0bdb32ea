"""The half-space in depth against Hooke's law, equilibrium, Love's surface and point forces."""

from functools import partial

import numpy as np
import pytest
from helpers.boussinesq import displacements, love_integral, stresses

from patchlaw.geometry import Material, PatchGrid
from patchlaw.support import InputError

LOADS = PatchGrid(grid=(2, 2), lengths=(1.0, 0.6), origin=(-0.2, 0.1))
POINTS = np.random.default_rng(7).uniform((-1.0, -1.0, 0.05), (1.5, 1.5, 1.0), (30, 3)).T
STEP = 1e-4


def material(nu):
    return Material(young_modulus=3.0, poisson_ratio=nu)


def slopes(evaluate):
    """Return central differences along x, y, z, shape (3, parts, n, M)."""
    steps = STEP * np.eye(3)[:, :, None]
    ends = [[evaluate(*(POINTS + sign * s), LOADS) for s in steps] for sign in (1, -1)]
    return np.subtract(*ends) / (2 * STEP)


@pytest.mark.parametrize("nu", [0.0, 0.15, 0.45])
def test_stresses_follow_from_displacements_by_hooke(nu):
    field = material(nu)
    gradient = slopes(partial(displacements, field))
    strain = 0.5 * (gradient + np.swapaxes(gradient, 0, 1))
    lame = 3.0 * nu / ((1 + nu) * (1 - 2 * nu))
    stress = 2 * field.shear_modulus * strain
    stress += lame * np.trace(strain) * np.eye(3)[:, :, None, None]
    expected = stress[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
    # differences: step² times third derivatives at depth 0.05 is 1e-5
    np.testing.assert_allclose(stresses(field, *POINTS, LOADS), expected, atol=3e-5)


def test_stresses_are_in_equilibrium():
    slope = slopes(partial(stresses, material(0.3)))
    for row in ((0, 5, 4), (5, 1, 3), (4, 3, 2)):
        # the terms are up to 10 / mm; differences as above
        total = sum(slope[axis, part] for axis, part in enumerate(row))
        np.testing.assert_allclose(total, 0.0, atol=1e-3)


def test_surface_sinks_by_love_and_carries_the_pressure_alone():
    field, x, y = material(0.3), *POINTS[:2]
    down = displacements(field, x, y, 0.0 * x, LOADS)[2]
    away = np.stack([x, y])[:, :, None] - LOADS.centres.T[:, None]
    love = love_integral(*away, *LOADS.half_sizes) / (np.pi * 3.0 / (1 - 0.3**2))
    np.testing.assert_allclose(down, love, rtol=1e-12)  # round-off
    stress = stresses(field, x, y, 0.0 * x, LOADS)
    inside = (np.abs(away) < np.array(LOADS.half_sizes)[:, None, None]).all(axis=0)
    assert inside.any() and not inside.all()
    np.testing.assert_allclose(stress[2], -1.0 * inside, atol=1e-13)
    np.testing.assert_allclose(stress[3:5], 0.0, atol=1e-13)


def test_far_away_it_is_boussinesqs_point_force():
    nu, field = 0.3, material(0.3)
    load = PatchGrid(grid=(1, 1), lengths=(0.02, 0.02), origin=(-0.01, -0.01))
    x, y, z = 10.0 * POINTS
    r = np.sqrt(x**2 + y**2 + z**2)
    scale = load.area / (4 * np.pi * field.shear_modulus)
    radial = z / r**3 - (1 - 2 * nu) / (r * (r + z))
    expected = scale * np.stack([x * radial, y * radial, 2 * (1 - nu) / r + z**2 / r**3])
    found = displacements(field, x, y, z, load)[:, :, 0]
    # (side / distance)² is below 1e-4; Johnson 1985, eq. 3.18
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())
    vertical = -3 * load.area * z**3 / (2 * np.pi * r**5)
    found = stresses(field, x, y, z, load)[2, :, 0]
    np.testing.assert_allclose(found, vertical, atol=1e-4 * np.abs(vertical).max())


def test_points_above_the_surface_are_refused():
    with pytest.raises(InputError, match="depths are not negative"):
        stresses(material(0.3), [0.0], [0.0], [-0.1], LOADS)
