"""Pressures up to a bound: the conditions of the contact, which prove a solution."""

import numpy as np
import pytest
from helpers.free_motions import approach, contact_problem, solved, turning

TOLERANCE = 1e-9


def rough(grid, seed):
    """Return heights of a few waves."""
    dice = np.random.default_rng(seed)
    x, y = (np.arange(n) / n for n in grid)
    heights = sum(
        dice.normal() * np.cos(2.0 * np.pi * (k * x[:, None] + j * y) + dice.uniform(0.0, 6.3))
        for k in range(1, 4)
        for j in range(-2, 3)
    )
    return heights - heights.max()


@pytest.mark.parametrize("grid", [(20, 17), (70, 50)], ids=["one grid", "coarse grids"])
@pytest.mark.parametrize("given", ["approach", "force", "free"])
def test_conditions_hold_with_a_bound(given, grid):
    heights, bound = rough(grid, 3), 0.4
    spacing = 20.0 / grid[0], 20.0 / grid[1]
    x, y = ((np.arange(n) + 0.5 - 0.5 * n) / n for n in grid)
    force = 0.15 * bound * heights.size
    motions = {"approach": None, "force": approach(grid, force), "free": turning(x, y, force)}
    interference = heights + 6.0 if given == "approach" else heights
    problem = contact_problem(
        interference, spacing, motions[given], tolerance=TOLERANCE, hardness=bound
    )
    found = solved(interference, spacing, motions[given], tolerance=TOLERANCE, hardness=bound)
    p, nearer = found.pressure, interference + problem.motions.displacement(found.motion)
    gap = problem.grid.displacement(p) - nearer
    slack = TOLERANCE * nearer.max() * (1.0 + 1e-6)
    at_bound = p == bound
    assert p.min() == 0.0 and np.all(p <= bound)
    assert 10 < at_bound.sum() < 0.95 * (p > 0.0).sum()  # both kinds of cells are there
    assert np.abs(gap[(p > 0.0) & ~at_bound]).max() <= slack
    assert gap[p == 0.0].min() >= -slack and gap[at_bound].max() <= slack
    if problem.motions.count:
        loads = problem.motions.modes_of(np.arange(p.size)) @ p.ravel()
        assert loads == pytest.approx(problem.motions.loads, abs=1e-11 * force)
