"""Free rigid motions: loads met within bounds, infeasible ones found, coarse grids."""

import numpy as np
import pytest
from helpers.free_motions import approach, turning

GRID = (9, 8)
X, Y = np.linspace(-0.7, 0.7, 9), np.linspace(-0.6, 0.6, 8)


@pytest.fixture
def dice():
    return np.random.default_rng(11)


@pytest.fixture
def pressure(dice):
    found = dice.random(GRID)
    return np.where(found > 0.4, found, 0.0)


def loads(motions, pressure):
    return motions.modes_of(np.arange(pressure.size)) @ pressure.ravel()


@pytest.mark.parametrize("total", [None, 0.3, 400.0], ids=["approach", "light", "heavy"])
def test_scaled_pressures_meets_the_loads(pressure, total):
    motions = turning(X, Y, total)
    found = motions.scaled_to_loads(pressure)
    scale = np.abs(motions.modes_of(np.arange(72))) @ found.ravel()
    assert np.abs(loads(motions, found) - motions.loads).max() < 1e-13 * scale.max()
    assert np.array_equal(found > 0.0, pressure > 0.0)
    # what is changed least in the sense of the relative entropy: p exp(Σ μ ℓ)
    cells = np.flatnonzero(pressure)
    change = np.log(found.ravel()[cells] / pressure.ravel()[cells])
    modes = motions.modes_of(cells)
    rest = change - modes.T @ np.linalg.lstsq(modes.T, change, rcond=None)[0]
    assert np.abs(rest).max() < 1e-12


@pytest.mark.parametrize("share", [0.3, 0.9, 0.999])
def test_scaled_pressures_keeps_the_upper_bound(pressure, share):
    """A share of the most that the cells can carry without a moment, up to nearly all."""
    even = turning(X, Y, 1.0).scaled_to_loads(np.where(pressure > 0.0, 1.0, 0.0))
    upper = 0.2
    motions = turning(X, Y, share * upper * even.sum() / even.max())
    found = motions.scaled_to_loads(pressure, upper)
    assert found.max() <= upper
    assert loads(motions, found) == pytest.approx(motions.loads, abs=1e-12 * found.sum())
    assert np.array_equal(found > 0.0, pressure > 0.0)


@pytest.mark.parametrize("share", [1e-7, 0.9, 0.999])
def test_approach_alone_scales_what_is_below_its_bound(pressure, dice, share):
    """Some pressures stay as they are."""
    upper = 0.9
    fixed = (pressure > 0.0) & (dice.random(GRID) > 0.8)
    scaled = (pressure > 0.0) & ~fixed
    load = pressure[fixed].sum() + share * upper * scaled.sum()
    found = approach(GRID, load).scaled_to_loads(pressure, upper, fixed)
    assert found.sum() == pytest.approx(load, rel=1e-14)  # rounding
    assert np.array_equal(found[~scaled], pressure[~scaled])
    below = scaled & (found < upper)
    factor = found[below] / np.minimum(pressure, upper)[below]
    assert factor == pytest.approx(factor[0], rel=1e-14)
    bounded = scaled & ~below
    assert np.all(factor[0] * np.minimum(pressure, upper)[bounded] >= upper * (1 - 1e-13))
    assert bounded.any() == (share > 0.5)


def test_loads_beyond_reach_are_told(pressure):
    full = np.ones(GRID)
    assert turning(X, Y, 72.001).scaled_to_loads(full, 1.0) is None
    assert turning(X, Y, 71.999).scaled_to_loads(full, 1.0) is not None
    assert approach(GRID, 72.001).scaled_to_loads(full, 1.0) is None
    one_side = np.where(X[:, None] > 0.0, pressure, 0.0)
    assert turning(X, Y, 1.0).scaled_to_loads(one_side) is None
    assert turning(X, Y, None).scaled_to_loads(one_side) is None
    corner = np.zeros(GRID)
    corner[0, 0] = 1.0
    assert turning(X, Y, 1.0).scaled_to_loads(corner) is None


def test_nothing_carries_nothing():
    nothing = np.zeros(GRID)
    for motions in (turning(X, Y, 1.0), approach(GRID, 1.0)):
        assert motions.scaled_to_loads(nothing) is None
    assert not turning(X, Y, None).scaled_to_loads(nothing).any()


def test_best_motion_is_exact_for_light_cells_too():
    """Cells that touch without pressure have a weight of 1e-8 of the others."""
    motions, cells = turning(X, Y, 1.0), np.array([3, 60, 29])
    weights, gap = np.zeros(GRID), motions.displacement(np.array([1.0, -0.3, 0.7]))
    weights.ravel()[cells] = [1.0, 0.8, 1e-8]
    left = gap - motions.displacement(motions.closing(weights, gap))
    assert np.abs(left.ravel()[cells]).max() < 1e-15
