"""Extension of displacements around contacts, and the inverse that it makes accurate."""

from functools import partial

import numpy as np
import pytest

from patchlaw.geometry import Control, Spectrum, Surface, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.boundary_elements import half_space_grid
from patchlaw.micro.boundary_elements.half_space_grid import Cells, HalfSpaceGrid
from patchlaw.micro.boundary_elements.inverse import Extension

SINGLE = 1e-5
"""Rounding of a few operations in single precision."""


def matrix_of(extension, count, period):
    """Return an extension as a matrix, from the cells to all cells of the period."""
    columns = np.empty((*period, count), np.float32)
    for values, column in zip(np.eye(count), np.moveaxis(columns, -1, 0), strict=True):
        field = np.full(period, np.nan, np.float32)  # all of it is overwritten
        extension.extended(values, field)
        column[:] = field
    return columns.reshape(-1, count)


@pytest.mark.parametrize(
    ("grid", "period"), [((24, 20), (32, 32)), ((16, 48), (16, 48)), ((27, 15), (27, 15))]
)
def test_extension_and_transpose(grid, period):
    rng = np.random.default_rng(3)
    cells = Cells.of(np.flatnonzero(rng.random(grid) < 0.15), grid)
    extension = Extension(cells, period)
    matrix = matrix_of(extension, cells.flat.size, period)
    on_period = np.ravel_multi_index(np.divmod(cells.flat, grid[1]), period)
    assert np.array_equal(matrix[on_period], np.eye(cells.flat.size))  # values stay as they are
    assert 0.0 <= matrix.min() and matrix.sum(axis=1).max() <= 1.0 + SINGLE
    field = rng.standard_normal(period).astype(np.float32)
    assert extension.gathered(field.copy()) == pytest.approx(matrix.T @ field.ravel(), abs=SINGLE)


def test_extension_does_not_depend_on_threads(monkeypatch):
    grid, results = (700, 300), []
    cells = Cells.of(np.flatnonzero(np.random.default_rng(0).random(grid) < 0.1), grid)
    values = np.random.default_rng(1).standard_normal(cells.flat.size)
    for threads in ("1", "3"):
        monkeypatch.setenv("OMP_NUM_THREADS", threads)
        extension, field = Extension(cells, grid), np.empty(grid, np.float32)
        extension.extended(values, field)
        results.append((field.copy(), extension.gathered(field)))
    for one, other in zip(*results, strict=True):
        assert np.array_equal(one, other)


def condition(inverse, compliance):
    """Return the condition number of a compliance, preconditioned, under a given force."""
    resistance = np.array([inverse(row) for row in np.eye(len(compliance))])
    # single precision, to which it is symmetric
    assert resistance == pytest.approx(resistance.T, abs=1e-5 * resistance.max())
    mean_free = np.eye(len(compliance)) - 1.0 / len(compliance)
    both = mean_free @ resistance @ mean_free @ compliance @ mean_free
    eigenvalues = np.sort(np.linalg.eigvals(both).real)
    assert abs(eigenvalues[0]) < 1e-5 < eigenvalues[1]  # the mean is left out
    return eigenvalues[-1] / eigenvalues[1]


@pytest.mark.long
@pytest.mark.parametrize("periodic", [False, True])
def test_inverse_is_accurate_for_all_waves(monkeypatch, periodic):
    # lattices of discs, ever more of them: cut down, the inverse is wrong for waves longer than
    # their distance
    monkeypatch.setattr(half_space_grid, "_MANY", 1)
    found = []
    for discs in (2, 4):
        n = 12 * discs
        half_space = HalfSpaceGrid((n, n), (1.0 / n, 1.0 / n), periodic=periodic)
        i, j = np.indices((n, n)) % 12 - 5.5
        cells = Cells.of(np.flatnonzero(np.hypot(i, j) < 2.3), (n, n))
        compliance = np.empty((cells.flat.size, cells.flat.size))
        for column, cell in zip(compliance.T, cells.flat, strict=True):
            load = np.zeros((n, n))
            load.ravel()[cell] = 1.0
            column[:] = half_space.compliance(load).ravel()[cells.flat]
        inverse = half_space.inverse
        inverses = (
            partial(inverse.on_cells, cells),
            partial(Extension(cells, inverse.grid).inverse, inverse),
        )
        found.append([condition(inverse, compliance) for inverse in inverses])
    cut, extended = np.transpose(found)
    assert cut[1] > 1.15 * cut[0]
    assert extended.max() < 1.3


@pytest.mark.parametrize("periodic", [False, True])
def test_both_inverses_lead_to_one_solution(monkeypatch, periodic):
    # waves down to four cells, 10 % of contact
    spectrum = Spectrum(hurst=0.8, waves=(4, 48), rms_slope=0.1, seed=1)
    heights = synthesise(spectrum, grid=(192, 192), lengths=(1.0, 1.0)).heights
    surface = Surface(heights=heights, lengths=(1.0, 1.0), periodic=periodic)
    found = []
    for many in (1, 10**9):
        monkeypatch.setattr(half_space_grid, "_MANY", many)
        model = HalfSpaceModel(
            surface=surface, contact_modulus=1.0, periodic=periodic, tolerance=1e-10
        )
        found.append(model.press(Control(force=0.0047)))
    extended, cut = found
    assert extended.plane.approach == pytest.approx(cut.plane.approach, rel=1e-10)
    assert np.array_equal(extended.pressures > 0.0, cut.pressures > 0.0)
    largest = cut.pressures.max()
    assert extended.pressures == pytest.approx(cut.pressures, abs=1e-7 * largest)
    assert extended.iterations <= 25 < 0.7 * cut.iterations
