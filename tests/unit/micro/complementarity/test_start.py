"""Clearance of a body that may turn, against a linear programme over all cells."""

import numpy as np
import pytest
from helpers.free_motions import turning
from scipy.optimize import linprog

from patchlaw.micro.complementarity.cell_problem import clearance


def brute_force(required, modes):
    """Return the least largest overlap by any motion."""
    count = len(modes)
    found = linprog(
        np.append(np.zeros(count), 1.0),
        A_ub=np.column_stack((modes.T, -np.ones(modes.shape[1]))),
        b_ub=-required.ravel(),
        bounds=[(None, None)] * (count + 1),
        method="highs",
    )
    return found.x[-1]


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e6])
@pytest.mark.parametrize("seed", range(5))
def test_is_that_of_all_cells(seed, scale):
    dice = np.random.default_rng(seed)
    grid = tuple(dice.integers(3, 14, 2))
    required = scale * (dice.standard_normal(grid) - dice.uniform(0.0, 2.0))
    motions = turning(np.linspace(-0.7, 0.7, grid[0]), np.linspace(-0.6, 0.6, grid[1]), None)
    found = clearance(required, motions)
    modes = motions.modes_of(np.arange(required.size))
    best = scale * brute_force(required / scale, modes)
    assert found.interference == pytest.approx(best, abs=1e-9 * scale)  # HiGHS's tolerance is 1e-7
    assert (required + motions.displacement(found.motion)).max() == pytest.approx(
        found.interference
    )
    # what holds the body is in balance and, by duality, proves that no motion is better
    assert found.support.min() >= 0.0 and found.support.sum() == pytest.approx(1.0)
    assert modes @ found.support.ravel() == pytest.approx([0.0, 0.0], abs=1e-9)
    assert np.vdot(found.support, required) == pytest.approx(found.interference, abs=1e-9 * scale)


def test_turns_clear_of_a_corner():
    x = np.linspace(-0.7, 0.7, 10)
    required = np.full((10, 10), -1.1e-2)
    required[0, 0] = 1e-2
    found = clearance(required, turning(x, x, None))
    # the corner opposite comes as much nearer: they meet halfway
    assert found.interference == pytest.approx(-5e-4, rel=1e-9)
    assert found.motion.sum() == pytest.approx(1.05e-2 / 0.7, rel=1e-9)


def test_a_contact_in_the_middle_cannot_be_turned_away():
    x = np.linspace(-0.7, 0.7, 11)
    required = np.full((11, 11), -1.0)
    required[5, 5] = 3e-3
    assert clearance(required, turning(x, x, None)).interference == pytest.approx(3e-3)
