"""Pressures on cells against non-negative least squares on the dense matrix, and hard cases."""

import numpy as np
import pytest
from helpers.free_motions import approach, contact_problem, solved
from scipy.optimize import nnls

from patchlaw import NotConverged
from patchlaw.micro.boundary_elements.grid_compliance import Compliance
from patchlaw.micro.complementarity.active_set import solve
from patchlaw.micro.complementarity.solver import nested_start

CASES = {
    "square": ((8, 8), (1.0, 1.0)),
    "strip": ((1, 40), (1.0, 1.0)),
    "column": ((33, 1), (0.2, 1.0)),
    "oblong cells": ((9, 7), (1.0, 3.0)),
}


def half_space(grid, spacing, *, periodic):
    return Compliance(periodic=periodic).on_grid(grid, spacing)


@pytest.fixture(params=CASES)
def case(request):
    grid, spacing = CASES[request.param]
    heights = np.random.default_rng(4).standard_normal(grid)
    return grid, spacing, heights - heights.max()


def oracle(grid, spacing, interference, *, periodic):
    """Minimise ½ pᵀG p − pᵀd over p ≥ 0 as |Lᵀp − L⁻¹d| with G = L Lᵀ."""
    elastic = half_space(grid, spacing, periodic=periodic)
    count = interference.size
    matrix = np.array([elastic.displacement(row.reshape(grid)).ravel() for row in np.eye(count)])
    if periodic:
        # The mean is free of stiffness, and stays so while some cell is open.
        matrix = matrix + 1e-11 * np.trace(matrix) / count
    factor = np.linalg.cholesky(0.5 * (matrix + matrix.T))
    pressure, _ = nnls(factor.T, np.linalg.solve(factor, interference.ravel()), maxiter=100 * count)
    return pressure.reshape(grid)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_least_squares_finds_the_same(case, share, periodic):
    grid, spacing, below = case
    # a part of the height range, or of the way to full contact
    interference = below + share * (-below.mean() if periodic else 2.0 * np.ptp(below))
    found = solved(interference, spacing, periodic=periodic).pressure
    expected = oracle(grid, spacing, interference, periodic=periodic)
    # round-off of a factor whose condition number is at most 1e6, squared in the periodic case
    assert found == pytest.approx(expected, abs=1e-7 * expected.max())
    assert np.array_equal(found > 0.0, expected > 1e-9 * expected.max())


@pytest.mark.parametrize("periodic", [False, True])
def test_given_force_is_the_same_contact(case, periodic):
    _, spacing, below = case
    asked = 0.6 * (-below.mean() if periodic else np.ptp(below))
    by_approach = solved(below + asked, spacing, periodic=periodic)
    motions = approach(below.shape, by_approach.pressure.sum())
    by_force = solved(below, spacing, motions, periodic=periodic)
    assert by_force.motion == pytest.approx([asked], rel=1e-9)  # both within 1e-11 in δ
    peak = by_approach.pressure.max()
    assert by_force.pressure == pytest.approx(by_approach.pressure, abs=1e-8 * peak)


@pytest.mark.parametrize("share", [1.0, 3.0])
def test_full_contact_of_a_period(case, share):
    grid, spacing, below = case
    q = [2.0 * np.pi * np.fft.fftfreq(n, step) for n, step in zip(grid, spacing, strict=True)]
    stiffness = 0.5 * np.hypot(q[0][:, None], q[1])
    flattening = np.fft.ifft2(stiffness * np.fft.fft2(below)).real
    mean = share * 1.001 * -flattening.min()  # just enough to close the deepest point, and more
    found = solved(below, spacing, approach(below.shape, mean * below.size), periodic=True)
    # flattening is linear; residual 1e-11, amplified by the stiffness of a single cell
    assert found.pressure == pytest.approx(mean + flattening, abs=1e-9 * mean)
    assert found.motion == pytest.approx([-below.mean()], rel=1e-10)


@pytest.mark.parametrize("seed", range(6))
def test_hostile_bodies(seed):
    # White noise and steps on needle-shaped cells: the periodic inverse is no M-matrix there.
    rng = np.random.default_rng(seed)
    grid = tuple(rng.integers(20, 80, 2))
    heights = -(rng.exponential(1.0, grid) ** 3) if seed % 2 else np.round(rng.normal(0, 2, grid))
    below = heights - heights.max()
    interference = below - 0.85 * below.mean()
    found = solved(interference, (1.0, 10.0), periodic=True, tolerance=1e-9)
    gap = half_space(grid, (1.0, 10.0), periodic=True).displacement(found.pressure) - below
    gap += 0.85 * below.mean()
    assert found.residual <= 1e-9
    # evaluated anew: round-off beside the residual
    assert gap.min() >= -1.01e-9 * (-0.85 * below.mean())
    touching = found.pressure > 0.0
    assert np.abs(gap[touching]).max() <= 1.01e-9 * (-0.85 * below.mean())


def test_coarse_start_saves_products_on_the_fine_grid():
    n = 128
    x = (np.arange(n) + 0.5) / n - 0.5
    interference = 0.02 - 0.5 * (x[:, None] ** 2 + x**2)
    problem = contact_problem(interference, (1 / n, 1 / n), tolerance=1e-8)
    cold = solve(problem, np.zeros((n, n)))
    nested = solve(problem, nested_start(problem))
    assert nested.iterations < 0.8 * cold.iterations
    assert nested.pressure.sum() == pytest.approx(cold.pressure.sum(), rel=1e-7)  # 2 ε dlnF/dlnδ


def test_gives_up_with_a_reason():
    interference = np.random.default_rng(0).random((8, 8))
    problem = contact_problem(interference, (1.0, 1.0), tolerance=1e-9)
    with pytest.raises(NotConverged, match=r"contact pressure \(residual .*, asked 1.0e-09\)"):
        solve(problem, np.zeros((8, 8)), most_steps=2)
