"""Stresses by free sides on cells: transposes, symmetries, refinement and the free side itself."""

import numpy as np
import pytest
from helpers.love_stresses import love_stresses

from patchlaw.geometry import Material
from patchlaw.micro import FreeSides, SideStresses

SIDES = FreeSides(lengths=(1.0, 1.5), poisson_ratio=0.2, decay_length=0.25)
GRID, SPACING = (20, 30), (0.05, 0.05)


@pytest.fixture(scope="module")
def cells():
    return SideStresses(SIDES, SPACING)


def random(seed, shape=GRID):
    return np.random.default_rng(seed).normal(size=shape)


def test_adjoint_is_the_transpose(cells):
    p, fields = random(1), random(2, (3, *GRID))
    # rounding
    assert np.vdot(fields, cells.stresses(p)) == pytest.approx(
        np.vdot(cells.adjoint(fields[None])[0], p), rel=1e-12
    )


@pytest.mark.parametrize("axis", [0, 1])
def test_opposite_sides_are_alike(cells, axis):
    p = random(3)
    turned = np.flip(cells.stresses(np.flip(p, axis)), axis + 1)
    turned[2] *= -1.0
    np.testing.assert_allclose(turned, cells.stresses(p), rtol=1e-10, atol=1e-13)


def test_axes_may_change_places(cells):
    p = random(4)
    other = FreeSides(lengths=(1.5, 1.0), poisson_ratio=0.2, decay_length=0.25)
    turned = SideStresses(other, SPACING).stresses(p.T)[[1, 0, 2]].transpose(0, 2, 1)
    np.testing.assert_allclose(turned, cells.stresses(p), rtol=1e-10, atol=1e-13)


def test_finer_cells_tell_the_same(cells):
    p = random(5)
    finer = SideStresses(SIDES, (0.025, 0.025)).stresses(np.kron(p, np.ones((2, 2))))
    means = finer.reshape(3, GRID[0], 2, GRID[1], 2).mean((2, 4))
    # 0.9 % of the largest, next to the sides, for waves shorter than a cell that are left out
    assert np.abs(means - cells.stresses(p)).max() < 0.015 * np.abs(means).max()


@pytest.mark.parametrize(
    "nu", [0.45, *(pytest.param(nu, marks=pytest.mark.long) for nu in (0.0, 0.15))]
)
def test_a_side_is_free_of_traction(nu):
    """Beside a smooth pressure at a side, normal stress and shear vanish there with the cells."""
    half_space, left = zip(*(at_the_side(nu, n) for n in (64, 256)), strict=True)
    # of the pressure's maximum: 0.6 % of normal stress, 0.9 % of shear, where without the side
    # they are up to 75 % and 22 %
    assert (left[1] < 0.015).all()
    assert left[1][1] < 0.5 * left[0][1]  # shear falls with the cells
    assert half_space[1][0] > 0.4


def at_the_side(nu, n):
    """Return the largest normal stress and shear, of the half-space's and of all, at x = 0."""
    sides = FreeSides(lengths=(1.0, 1.0), poisson_ratio=nu, decay_length=0.25)
    spacing = 1.0 / n, 1.0 / n
    x = (np.arange(n) + 0.5) / n
    pressure = np.exp(-((x[:, None] - 0.05) ** 2 + (x - 0.5) ** 2) / 0.1**2)
    alone = love_stresses(Material(young_modulus=1.0, poisson_ratio=nu), pressure, spacing)
    fields = alone, alone + SideStresses(sides, spacing).stresses(pressure)
    near = np.abs(x - 0.5) < 0.2
    return [
        np.abs(1.5 * field[[0, 2], 0] - 0.5 * field[[0, 2], 1])[:, near].max(axis=1)
        for field in fields
    ]
