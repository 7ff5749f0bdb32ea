"""The preconditioner of tractions that are partly free: symmetric, positive, and accurate."""

import numpy as np
import pytest

from patchlaw.micro.boundary_elements.half_space_grid import Cells
from patchlaw.micro.boundary_elements.inverse import Extension
from patchlaw.micro.friction.stick_slip import FreeInverse, across
from patchlaw.micro.friction.tangential_grid import TangentialGrid

GRID = 16, 14
SINGLE = 1e-5
"""Rounding of a few operations in single precision."""


def contact(slip, stiffness, *, periodic=False):
    """Return cells of two discs, the outer part of which slips, and its directions and springs."""
    rng = np.random.default_rng(4)
    x, y = np.meshgrid(np.arange(GRID[0]), np.arange(GRID[1]), indexing="ij")
    distance = np.minimum(np.hypot(x - 5, y - 5), np.hypot(x - 11, y - 9) + 1)
    cells = Cells.of(np.flatnonzero(distance < 4.5), GRID)
    slips = distance.ravel()[cells.flat] > 4.5 * (1.0 - slip)
    angle = rng.uniform(-0.5, 0.5, len(cells.flat))
    normal = slips * np.stack([np.cos(angle), np.sin(angle)])
    grid = TangentialGrid(GRID, (0.1, 0.13), poisson_ratio=0.3, periodic=periodic)
    spread = 10.0 ** rng.uniform(-1.0, 1.0, len(cells.flat))
    return grid, cells, normal, slips * stiffness * spread * grid.self_compliance


def free_matrices(grid, cells, normal, added):
    """Return the compliance of free tractions and its approximate inverse, on a basis of them."""
    count = 2 * len(cells.flat)
    units = np.eye(count).reshape(count, 2, -1)
    compliance = np.stack([grid.displacement_of(cells, one).ravel() for one in units])
    compliance += np.diag(np.tile(added, 2))
    inverse = FreeInverse(grid, cells, normal, added)
    approximate = np.stack([inverse(one.ravel()) for one in units])
    projection = np.stack([across(normal, one).ravel() for one in units])
    values, vectors = np.linalg.eigh(projection)
    basis = vectors[:, values > 0.5]
    return basis.T @ compliance @ basis, basis.T @ approximate @ basis


@pytest.mark.long
@pytest.mark.parametrize(
    ("slip", "stiffness", "periodic"),
    [(0.0, 1.0, True), (0.5, 0.0, False), (0.5, 1.0, True), (0.5, 30.0, False), (1.0, 1.0, True)],
)
def test_the_inverse_is_symmetric_and_accurate(slip, stiffness, periodic):
    compliance, inverse = free_matrices(*contact(slip, stiffness, periodic=periodic))
    assert inverse == pytest.approx(inverse.T, abs=SINGLE * inverse.max())
    product = np.linalg.eigvals(compliance @ inverse).real
    assert product.min() > 0.0
    assert product.max() / product.min() < 4.0  # measured: 1.5 to 2.7


def test_tractions_along_the_slip_stay():
    grid, cells, normal, added = contact(0.5, 1.0)
    wanted = np.random.default_rng(1).normal(size=(2, len(cells.flat)))
    change = FreeInverse(grid, cells, normal, added)(wanted.ravel()).reshape(2, -1)
    assert (normal * change).sum(axis=0) == pytest.approx(0.0, abs=1e-12 * np.abs(change).max())


def test_weighted_interpolation_and_its_transpose():
    rng, period = np.random.default_rng(5), (32, 32)
    cells = Cells.of(np.flatnonzero(rng.random(GRID) < 0.3), GRID)
    count = len(cells.flat)
    extension = Extension(cells, period, rng.uniform(0.0, 1.0, count))
    columns = []
    for unit in np.eye(count):
        field = np.full(period, np.nan, np.float32)
        extension.interpolated(unit, field)
        columns.append(field.ravel())
    matrix = np.stack(columns, axis=1)
    field = rng.standard_normal(period).astype(np.float32)
    assert extension.collected(field) == pytest.approx(matrix.T @ field.ravel(), abs=SINGLE)
