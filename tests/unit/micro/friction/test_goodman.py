"""What Goodman's assumption neglects: its kernels, its symmetry, and bodies without it."""

import pickle

import numpy as np
import pytest
from scipy.integrate import dblquad

from patchlaw.geometry import Material, MaterialPair
from patchlaw.micro import FrictionModel
from patchlaw.micro.friction.tangential_grid import CrossCompliance

GRID, SPACING = (8, 6), (0.13, 0.21)
SOFT = Material(young_modulus=1300.0, poisson_ratio=0.12)
RIGID = MaterialPair(first=SOFT)


def test_dundurs_beta_and_the_mean_of_poissons_ratios():
    assert RIGID.dundurs_beta == pytest.approx((1 - 0.24) / (2 * 0.88), rel=1e-12)
    assert RIGID.tangential_poisson_ratio == pytest.approx(0.12, rel=1e-12)
    like = MaterialPair(first=SOFT, second=SOFT)
    assert like.dundurs_beta == 0.0
    other = Material(young_modulus=5200.0, poisson_ratio=0.41)
    pair, turned = MaterialPair(first=SOFT, second=other), MaterialPair(first=other, second=SOFT)
    assert pair.dundurs_beta == pytest.approx(-turned.dundurs_beta, rel=1e-12)
    # compliances (1 − ν/2)/G of both bodies, the mean over all directions, add up
    nu, modulus = pair.tangential_poisson_ratio, pair.contact_modulus
    one = (1 - nu / 2) * 2 / (modulus * (1 - nu))
    both = sum((1 - m.poisson_ratio / 2) / m.shear_modulus for m in (SOFT, other))
    assert one == pytest.approx(both, rel=1e-12)


@pytest.mark.parametrize("place", [(1, 0), (0, 2), (3, 2)])
def test_pressures_pull_the_surface_towards_them(place):
    pressure = np.zeros(GRID)
    pressure[2, 1] = 7.0
    moved = CrossCompliance(GRID, SPACING, RIGID, periodic=False).sideways(pressure)
    (x, y), (a, b) = np.multiply(place, SPACING), np.multiply(0.5, SPACING)
    # Johnson 1985, eq. 3.18: u = −(1 − 2ν)/(4π G) P/ρ, along ρ
    factor = -7.0 * (1 - 2 * SOFT.poisson_ratio) / (4 * np.pi * SOFT.shear_modulus)
    for component in range(2):
        exact, _ = dblquad(
            lambda v, u, c=component: (u, v)[c] / (u * u + v * v), x - a, x + a, y - b, y + b
        )
        found = moved[component, 2 + place[0], 1 + place[1]]
        assert found == pytest.approx(factor * exact, rel=1e-8, abs=1e-16)


@pytest.mark.parametrize("periodic", [False, True])
def test_both_couplings_are_transposed(periodic):
    cross = CrossCompliance(GRID, SPACING, RIGID, periodic=periodic)
    rng = np.random.default_rng(4)
    pressure, tractions = rng.uniform(size=GRID), rng.normal(size=(2, *GRID))
    one = float(np.vdot(cross.sideways(pressure), tractions))
    # Betti: work of each load on the displacements by the other
    assert float(np.vdot(cross.across(tractions), pressure)) == pytest.approx(one, rel=1e-10)


@pytest.mark.parametrize("grid", [(8, 7), (7, 8), (8, 6), (7, 9)])
@pytest.mark.parametrize("periodic", [False, True])
def test_mirrored_pressures_pull_the_other_way(periodic, grid):
    """Waves of two cells run either way."""
    pressure = np.random.default_rng(5).uniform(size=grid)
    cross = CrossCompliance(grid, SPACING, RIGID, periodic=periodic)
    moved = cross.sideways(pressure)
    for axis in range(2):
        other = np.flip(cross.sideways(np.flip(pressure, axis)), axis + 1)
        other[axis] *= -1.0
        # rounding of transforms
        np.testing.assert_allclose(other, moved, atol=1e-12 * np.abs(moved).max())


def test_a_model_can_be_sent_to_other_ranks_after_it_was_used():
    model = FrictionModel(materials=RIGID, coefficient=0.3, spacing=SPACING)
    pressure = np.random.default_rng(5).uniform(size=GRID)
    found = model.cross(GRID).sideways(pressure)
    sent = pickle.loads(pickle.dumps(model))
    np.testing.assert_array_equal(sent.cross(GRID).sideways(pressure), found)


def test_a_periodic_wave_of_pressure():
    x, length = np.arange(GRID[0]) * SPACING[0], GRID[0] * SPACING[0]
    k = 2 * np.pi / length
    pressure = np.repeat(np.cos(k * x)[:, None], GRID[1], axis=1)
    moved = CrossCompliance(GRID, SPACING, RIGID, periodic=True).sideways(pressure)
    # plane strain: (1 − 2ν)/(2G k), a quarter of a wave beside
    size = (1 - 2 * SOFT.poisson_ratio) / (2 * SOFT.shear_modulus * k)
    assert np.abs(moved[0, :, 0]) == pytest.approx(size * np.abs(np.sin(k * x)), abs=1e-12)
    assert not moved[1].any()
    assert moved[0, 1, 0] < 0.0  # towards the crest at 0
