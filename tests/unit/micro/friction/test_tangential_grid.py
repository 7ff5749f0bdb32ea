"""The tangential compliance of cells: Cerruti's kernel, its products, its inverse."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from patchlaw.micro.boundary_elements.half_space_grid import Cells
from patchlaw.micro.friction.tangential_grid import TangentialGrid, cerruti_kernels
from patchlaw.support import parallel

SPACING = 0.13, 0.21
RATIO = 0.37


def point_force(x, y, component, poisson_ratio):
    """Return π E* times the displacement by a unit point force (Johnson 1985, eq. 3.75)."""
    distance, kappa = np.hypot(x, y), poisson_ratio / (1.0 - poisson_ratio)
    if component == "xy":
        return kappa * x * y / distance**3
    along = x if component == "xx" else y
    return 1.0 / distance + kappa * along**2 / distance**3


@pytest.mark.parametrize("place", [(1, 0), (0, 1), (2, 3), (4, 1)])
@pytest.mark.parametrize("number", range(3))
def test_kernels_are_cerrutis_point_force_integrated_over_cells(place, number):
    component = ("xx", "yy", "xy")[number]
    kernels = cerruti_kernels((5, 4), SPACING, RATIO)
    (x, y), (a, b) = np.multiply(place, SPACING), np.multiply(0.5, SPACING)
    exact, error = dblquad(
        lambda v, u: point_force(u, v, component, RATIO), x - a, x + a, y - b, y + b
    )
    assert kernels[number][place] == pytest.approx(exact / np.pi, rel=1e-9, abs=10 * error)


def dense(grid, poisson_ratio):
    """Return the matrix of all cells by the kernels, distance by distance; slow, and obvious."""
    xx, yy, xy = cerruti_kernels(grid, SPACING, poisson_ratio)
    places = [(i, j) for i in range(grid[0]) for j in range(grid[1])]
    matrix = np.zeros((2, len(places), 2, len(places)))
    for m, (i, j) in enumerate(places):
        for n, (k, q) in enumerate(places):
            at, sign = (abs(i - k), abs(j - q)), np.sign((i - k) * (j - q))
            matrix[:, m, :, n] = [[xx[at], sign * xy[at]], [sign * xy[at], yy[at]]]
    return matrix.reshape(2 * len(places), -1)


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.37, 0.49, -0.6])
def test_products_are_those_of_the_matrix_which_is_positive(poisson_ratio):
    grid = 7, 6
    matrix = dense(grid, poisson_ratio)
    assert matrix == pytest.approx(matrix.T, rel=1e-14)
    assert np.linalg.eigvalsh(matrix)[0] > 0.0
    tractions = np.random.default_rng(1).normal(size=(2, *grid))
    half_space = TangentialGrid(grid, SPACING, poisson_ratio=poisson_ratio, periodic=False)
    exact = (matrix @ tractions.ravel()).reshape(2, *grid)
    assert half_space.displacement(tractions) == pytest.approx(exact, rel=1e-12, abs=1e-13)
    cells = Cells.of(np.array([2, 9, 14, 15, 16, 33]), grid)
    some = tractions.reshape(2, -1)[:, cells.flat]
    among = np.concatenate([cells.flat, 42 + cells.flat])
    part = (matrix[np.ix_(among, among)] @ some.ravel()).reshape(2, -1)
    assert half_space.displacement_of(cells, some) == pytest.approx(part, rel=1e-12, abs=1e-13)
    assert half_space.roughly(cells, some) == pytest.approx(part, rel=1e-5, abs=1e-6)
    assert half_space.products == 3


@pytest.mark.parametrize("waves", [(2, 0), (0, 3), (3, 2), (5, -1)])
def test_periodic_waves_have_the_compliance_of_their_direction(waves):
    grid = 16, 12
    lengths = np.multiply(grid, SPACING)
    k = 2.0 * np.pi * np.array(waves) / lengths
    x, y = (np.arange(n) * step for n, step in zip(grid, SPACING, strict=True))
    wave, size = np.cos(k[0] * x[:, None] + k[1] * y), np.hypot(*k)
    half_space = TangentialGrid(grid, SPACING, poisson_ratio=RATIO, periodic=True)
    # tractions along the wave feel G/(1 − ν) = E*/2, those across it G
    for direction, modulus in (k / size, 1.0), (k[::-1] * [-1, 1] / size, 1.0 - RATIO):
        tractions = direction[:, None, None] * wave
        moved = half_space.displacement(tractions)
        assert moved == pytest.approx(2.0 / (size * modulus) * tractions, abs=1e-14)


def test_the_inverse_undoes_the_compliance_of_a_period():
    grid = 12, 10
    half_space = TangentialGrid(grid, SPACING, poisson_ratio=RATIO, periodic=True)
    tractions = np.random.default_rng(2).normal(size=(2, *grid))
    tractions -= tractions.mean(axis=(1, 2), keepdims=True)
    moved = half_space.displacement(tractions).astype(np.float32)
    assert half_space.inverse(moved) == pytest.approx(tractions, abs=1e-5)


def test_small_grids_start_no_threads(monkeypatch):
    """Starting them takes eight times as long as the product."""

    def refuse(count):
        raise AssertionError("threads were started")

    monkeypatch.setattr(parallel, "_pool", refuse)
    grid = TangentialGrid((32, 32), (0.1, 0.1), poisson_ratio=0.3, periodic=True)
    with parallel.allocated(2):
        assert grid.displacement(np.ones((2, 32, 32))).shape == (2, 32, 32)
