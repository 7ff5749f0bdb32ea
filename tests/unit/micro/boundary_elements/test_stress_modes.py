"""Surface stresses in Legendre modes: half-space, free sides, and what a body adds on cells."""

import numpy as np
import pytest
from numpy.polynomial import legendre

from patchlaw.geometry.face_frame import mode_means, mode_values
from patchlaw.micro import (
    BodyStresses,
    FreeSides,
    SideStresses,
    half_space_stress_modes,
    side_stress_modes,
)
from patchlaw.support import InputError

LENGTHS, COUNT, NU = (1.0, 1.5), 4, 0.2
SIDES = FreeSides(lengths=LENGTHS, poisson_ratio=NU, decay_length=0.25)


def borders(cells):
    return [np.linspace(0.0, length, cells + 1) for length in LENGTHS]


def half_space_stresses(x, y, low, high):
    """Return σ_xx, σ_yy, σ_xy at points of the plane by unit pressure on a rectangle.

    ∂_α ∂_β of the logarithmic potential of a rectangle is a sum over its corners.
    """
    xx = yy = xy = 0.0
    for sign_x, a in ((1.0, low[0]), (-1.0, high[0])):
        for sign_y, b in ((1.0, low[1]), (-1.0, high[1])):
            sign = sign_x * sign_y / (2.0 * np.pi)
            xx = xx + sign * np.arctan((y - b) / (x - a))
            yy = yy + sign * np.arctan((x - a) / (y - b))
            xy = xy + sign * np.log(np.hypot(x - a, y - b))
    pressure = ((x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1])).astype(float)
    side = 1.0 - 2.0 * NU
    return np.stack(
        [-2.0 * NU * pressure - side * xx, -2.0 * NU * pressure - side * yy, -side * xy]
    )


def test_half_space_stresses_by_uniform_pressure_are_the_closed_form():
    nodes, weights = legendre.leggauss(200)
    x, y = (0.5 * length * (1.0 + nodes) for length in LENGTHS)
    fields = half_space_stresses(x[:, None], y, (0.0, 0.0), LENGTHS)
    tests = [mode_values(at, length, COUNT) for at, length in zip((x, y), LENGTHS, strict=True)]
    along_x, along_y = (0.5 * part * weights for part in tests)
    expected = (along_x @ fields @ along_y.T).reshape(3, -1)
    found = half_space_stress_modes(LENGTHS, NU, COUNT)[:, :, 0] * np.prod(LENGTHS)
    np.testing.assert_allclose(found, expected, atol=1e-8)  # 5e-10, of the rule in this test


def by_rectangles(cells):
    """Return the stresses by modes, uniform on cells and seen at their centres."""
    means = [
        mode_means(t, length, COUNT) for t, length in zip(borders(cells), LENGTHS, strict=True)
    ]
    width = np.array(LENGTHS) / cells
    apart = np.arange(1 - cells, cells) + 1e-9
    kernel = half_space_stresses(apart[:, None] * width[0], apart * width[1], -width / 2, width / 2)
    i = np.subtract.outer(np.arange(cells), np.arange(cells)) + cells - 1
    fields = np.einsum("axiyj,ki,lj->aklxy", kernel[:, i][:, :, :, i], *means, optimize=True)
    seen = np.einsum("mx,ny,aklxy->amnkl", *means, fields, optimize=True) / cells**2
    return seen.reshape(3, COUNT**2, COUNT**2) / np.prod(LENGTHS)


def test_half_space_stresses_by_all_modes_are_those_of_many_rectangles():
    found = half_space_stress_modes(LENGTHS, NU, COUNT)
    largest = np.abs(found).max()
    errors = [np.abs(found - by_rectangles(cells)).max() / largest for cells in (16, 32)]
    # 7.8 and 2.0 %, with the square of the cells
    assert errors[1] < 0.025
    assert errors[1] < 0.3 * errors[0]


def test_stresses_by_free_sides_are_those_of_cells():
    found = side_stress_modes(SIDES, COUNT)
    errors = []
    for cells in (48, 96):
        means = [
            mode_means(t, length, COUNT) for t, length in zip(borders(cells), LENGTHS, strict=True)
        ]
        on_cells = SideStresses(SIDES, tuple(length / cells for length in LENGTHS))
        expected = np.empty_like(found)
        for mode in range(COUNT**2):
            pressure = np.outer(means[0][mode // COUNT], means[1][mode % COUNT])
            fields = on_cells.stresses(pressure) / np.prod(LENGTHS)
            expected[:, :, mode] = (means[0] @ fields @ means[1].T).reshape(3, -1) / cells**2
        errors.append(np.abs(found - expected).max() / np.abs(found).max())
    # 3.0 and 0.9 %: cells are coarse for stresses that change fast at the sides
    assert errors[1] < 0.012
    assert errors[1] < 0.4 * errors[0]


@pytest.fixture(scope="module")
def matrix():
    return np.random.default_rng(1).normal(size=(3, COUNT**2, COUNT**2))


def test_body_stresses_follow_the_moments_of_the_pressure(matrix):
    grid = 12, 10
    means = [
        mode_means(np.linspace(0.0, length, cells + 1), length, COUNT)
        for cells, length in zip(grid, LENGTHS, strict=True)
    ]
    found = BodyStresses(LENGTHS, grid, matrix).stresses(np.ones(grid))
    column = matrix[:, :, 0].reshape(3, COUNT, COUNT) * np.prod(LENGTHS)  # the mean mode alone
    np.testing.assert_allclose(found, means[0].T @ column @ means[1], rtol=1e-10)


def test_a_margin_is_around_the_cells(matrix):
    """Cells of 0.1 mm, the outermost of them without pressure."""
    pressure = np.pad(np.random.default_rng(3).random((10, 15)), 1)
    lengths = LENGTHS[0] * 12 / 10, LENGTHS[1] * 17 / 15
    whole = BodyStresses(lengths, (12, 17), matrix).stresses(pressure)
    inner = BodyStresses(lengths, (10, 15), matrix, margin=0.1).stresses(pressure[1:-1, 1:-1])
    np.testing.assert_allclose(inner, whole[:, 1:-1, 1:-1], rtol=1e-10)


def test_body_stresses_have_a_transpose(matrix):
    grid = 9, 14
    rng = np.random.default_rng(2)
    body = BodyStresses(LENGTHS, grid, matrix)
    pressure, fields = rng.normal(size=grid), rng.normal(size=(3, *grid))
    work = np.sum(fields * body.stresses(pressure))
    assert np.sum(body.adjoint(fields[None])[0] * pressure) == pytest.approx(work, rel=1e-12)


@pytest.mark.parametrize("shape", [(3, 5, 5), (2, 4, 4), (3, 4, 9), (3, 0, 0)])
def test_stresses_that_are_not_in_modes_are_refused(shape):
    with pytest.raises(InputError, match=r"not those of K × K modes .*K ≥ 1"):
        BodyStresses(LENGTHS, (4, 4), np.zeros(shape))


def test_stresses_that_are_not_finite_are_refused(matrix):
    with pytest.raises(InputError, match=r"not those of K × K modes .*finite"):
        BodyStresses(LENGTHS, (4, 4), np.where(matrix > 2.0, np.nan, matrix))
