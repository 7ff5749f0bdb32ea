"""Kernels of the half-space and the convolution that applies them."""

import numpy as np
import pytest
from helpers.boussinesq import love_integral
from scipy import fft

from patchlaw.micro import FreeSides
from patchlaw.micro.boundary_elements.grid_compliance import Compliance
from patchlaw.micro.boundary_elements.half_space_grid import (
    Cells,
    Convolution,
    love_kernel,
    padded_spectrum,
)
from patchlaw.micro.boundary_elements.side_cells import SideTerm

GRIDS = [(16, 16), (15, 22), (7, 1), (1, 30), (1, 1)]
SPACING = (0.1, 0.13)


def half_space(grid, spacing, *, periodic):
    return Compliance(periodic=periodic).on_grid(grid, spacing)


def cells_where(mask):
    return Cells.of(np.flatnonzero(mask), mask.shape)


def direct(grid, pressure):
    """Sum Love's rectangles over all pairs of cells."""
    x, y = np.indices(grid).reshape(2, -1) * np.reshape(SPACING, (2, 1))
    dx, dy = x[:, None] - x, y[:, None] - y
    compliance = love_integral(dx, dy, 0.5 * SPACING[0], 0.5 * SPACING[1]) / np.pi
    return (compliance @ pressure.ravel()).reshape(grid)


def test_kernel_is_loves_rectangle():
    i, j = np.indices((40, 30))
    expected = love_integral(i * 0.1, j * 0.13, 0.05, 0.065) / np.pi
    # differences of corner integrals round at 1e-16 (distance / cell)², 40² here
    assert love_kernel((40, 30), SPACING) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("grid", GRIDS)
def test_displacement_is_the_direct_sum(grid):
    pressure = np.random.default_rng(1).random(grid)
    elastic = half_space(grid, SPACING, periodic=False)
    assert elastic.displacement(pressure) == pytest.approx(direct(grid, pressure), rel=1e-12)
    mask = pressure > 0.4
    expected = direct(grid, np.where(mask, pressure, 0.0))[mask]
    # in single precision, also where the numbers themselves would not fit
    some = elastic.apply_compliance(cells_where(mask), 1e-60 * pressure[mask])
    assert some == pytest.approx(1e-60 * expected, rel=1e-5, abs=0.0)


@pytest.mark.parametrize("waves", [(1, 0), (0, 3), (2, 5)])
def test_periodic_displacement_of_a_wave(waves):
    # Johnson 1985, eq. 13.7: p cos(q·x) displaces by 2/(E* |q|) p cos(q·x)
    grid = (12, 15)
    i, j = np.indices(grid)
    wave = np.cos(2.0 * np.pi * (waves[0] * i / grid[0] + waves[1] * j / grid[1]))
    lengths = np.multiply(grid, SPACING)
    q = 2.0 * np.pi * np.hypot(*(np.array(waves) / lengths))
    elastic = half_space(grid, SPACING, periodic=True)
    assert elastic.displacement(wave) == pytest.approx(2.0 / q * wave, abs=1e-14)
    assert elastic.displacement(np.ones(grid)) == pytest.approx(0.0, abs=1e-14)


@pytest.mark.long
@pytest.mark.parametrize("periodic", [False, True])
def test_resistance_preconditions(periodic):
    # on a disc of cells the condition number falls, and does so the more the finer the grid
    ratios = []
    for n in (16, 32):
        elastic = half_space((n, n), (1.0 / n, 1.0 / n), periodic=periodic)
        i, j = np.indices((n, n)) - 0.5 * (n - 1)
        cells = cells_where(np.hypot(i, j) < 0.35 * n)
        identity = np.eye(cells.flat.size)
        compliance = np.array([elastic.apply_compliance(cells, row) for row in identity])
        inverse = elastic.inverse_on(cells)
        resistance = np.array([inverse(row) for row in identity])
        # single precision, to which it is symmetric
        assert resistance == pytest.approx(resistance.T, abs=1e-6 * resistance.max())
        eigenvalues = np.sort(np.linalg.eigvals(resistance @ compliance).real)
        assert eigenvalues[0] > 0.0
        ratios.append(np.linalg.cond(compliance) / (eigenvalues[-1] / eigenvalues[0]))
    assert ratios[0] > 2.0
    assert ratios[1] > 1.3 * ratios[0]


def test_convolution_keeps_precision_and_works_in_place():
    grid, padded = (9, 10), (20, 20)
    spectrum = padded_spectrum(padded, SPACING)
    field = np.random.default_rng(2).random(grid)
    whole = np.concatenate([spectrum, spectrum[-2:0:-1]])  # of a kernel that is even in x
    expected = fft.irfft2(fft.rfft2(field, s=padded) * whole, s=padded)[: grid[0], : grid[1]]
    for kind, tolerance in ((np.float64, 1e-13), (np.float32, 1e-5)):
        work = np.empty(spectrum.shape, np.result_type(kind, np.complex64))
        convolution = Convolution(spectrum.astype(kind), grid, padded, work)
        own = field.astype(kind)
        assert convolution(own) is own and own.dtype == kind
        assert own == pytest.approx(expected, rel=tolerance)


def test_convolution_of_some_rows():
    grid, padded = (300, 200), (600, 400)  # several blocks of rows
    spectrum = padded_spectrum(padded, SPACING)
    convolution = Convolution(spectrum, grid, padded, np.empty(spectrum.shape, complex))
    rows = np.random.default_rng(0).permutation(300)[:170]
    rows.sort()
    field = np.zeros(grid)
    field[rows] = np.random.default_rng(1).random((170, 200))
    part = convolution(field[rows], rows)
    assert part == pytest.approx(convolution(field)[rows], rel=1e-12)


@pytest.mark.parametrize("periodic", [False, True])
def test_threads_do_not_change_a_bit(monkeypatch, periodic):
    grid, results = (130, 97), []
    pressure = np.random.default_rng(4).random(grid)
    cells = cells_where(pressure > 0.9)
    for threads in ("1", "3"):
        monkeypatch.setenv("OMP_NUM_THREADS", threads)
        monkeypatch.setattr("patchlaw.micro.boundary_elements.half_space_grid.BLOCK", 4000)
        elastic = half_space(grid, SPACING, periodic=periodic)
        some = elastic.apply_compliance(cells, pressure.ravel()[cells.flat])
        results.append((elastic.displacement(pressure).tobytes(), some.tobytes()))
    assert results[0] == results[1]


def test_half_spaces_are_cached_but_not_without_end():
    grids = Compliance(periodic=False)
    first = grids.half_space((4, 4), SPACING)
    assert grids.half_space((4, 4), SPACING) is first
    for n in range(5, 40):
        grids.on_grid((4, n), SPACING)
    assert grids.half_space((4, 4), SPACING) is not first


@pytest.mark.parametrize("scale", [1.0, 1e-60])
def test_rough_displacements_are_those_in_single_precision(scale):
    sides = FreeSides(lengths=(0.8, 1.0), poisson_ratio=0.3, decay_length=0.2)
    body = Compliance(periodic=False, terms=[SideTerm(sides)])
    pressure = scale * np.random.default_rng(4).random((150, 160))
    exact, rough = (
        body.on_grid(pressure.shape, (0.8 / 150, 1.0 / 160), rough=one).displacement(pressure)
        for one in (False, True)
    )
    # rounding of single precision in transforms of 300 × 320 cells was 3e-7 of the largest
    assert 0.0 < np.abs(rough - exact).max() <= 1e-6 * exact.max()
