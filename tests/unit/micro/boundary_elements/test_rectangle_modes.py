"""The half-space and its free sides in modes, against patches and cells of pressure."""

import numpy as np
import pytest
from helpers.free_side_points import side_displacements
from helpers.uneven_grid import uneven_grid

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.face_frame import mode_means
from patchlaw.micro import FreeSides, half_space_modes, influence_matrix, side_modes
from patchlaw.micro.boundary_elements.side_cells import side_cells
from patchlaw.micro.closed_forms import love_mean

SHAPES = [(1.0, 1.0), (1.0, 2.5), (3.0, 0.2)]


@pytest.mark.parametrize("lengths", SHAPES)
def test_mean_by_uniform_pressure_is_loves(lengths):
    found = half_space_modes(lengths, 4)[0, 0] * lengths[0] * lengths[1]
    mean = love_mean(0.5 * lengths[0], 0.5 * lengths[1]) / np.pi
    assert found == pytest.approx(float(mean), rel=1e-12)


@pytest.mark.parametrize("lengths", SHAPES)
def test_more_points_change_nothing(lengths):
    """Twelve modes more take twelve points more in both directions, and 24 in the shifts."""
    found = half_space_modes(lengths, 6)
    more = half_space_modes(lengths, 18).reshape(4 * (18,))[:6, :6, :6, :6]
    # 1e-11 on the slenderest face
    np.testing.assert_allclose(more.reshape(found.shape), found, rtol=0, atol=1e-9 * found[0, 0])


def in_modes(patches, compliance, lengths, count):
    """Return a compliance of equal patches in modes, whose pressures are their means on them."""
    modes = np.kron(
        *(
            mode_means(b, side, count)
            for b, side in zip((patches.borders_x, patches.borders_y), lengths, strict=True)
        )
    )
    return modes @ compliance @ modes.T / (patches.count * lengths[0] * lengths[1])


@pytest.mark.parametrize("lengths", [(1.0, 1.0), (1.0, 2.5)])
def test_half_space_is_the_limit_of_patches(lengths):
    exact, errors = half_space_modes(lengths, 3), []
    for cells in (10, 20, 40):
        patches = PatchGrid(grid=(cells, cells), lengths=lengths)
        found = in_modes(patches, influence_matrix(patches) / np.pi, lengths, 3)
        errors.append(np.abs(found - exact).max() / exact[0, 0])
    # of second order: 0.017, 0.0043, 0.0011 on the square
    assert errors[2] < 2e-3
    assert errors[0] / errors[1] > 3.0 and errors[1] / errors[2] > 3.0


@pytest.mark.parametrize("lengths", [(1.0, 1.0), (1.0, 2.0)])
def test_sides_in_modes_are_those_of_cells(lengths):
    sides = FreeSides(lengths=lengths, poisson_ratio=0.3, decay_length=0.2)
    grid = (96, 96 * round(lengths[1] / lengths[0]))
    every = side_cells(sides, (lengths[0] / 96, lengths[0] / 96)).among(*map(np.arange, grid))
    means = [
        mode_means(np.linspace(0.0, side, n + 1), side, 3)
        for side, n in zip(lengths, grid, strict=True)
    ]
    exact, area = side_modes(sides, 3), lengths[0] * lengths[1]
    cell = area / (grid[0] * grid[1])
    for k, one in enumerate(means[0]):
        for m, other in enumerate(means[1]):
            displaced = means[0] @ every.displacement(np.outer(one, other)) @ means[1].T
            found = displaced.ravel() * cell / area**2
            # both interpolate over the distance to 1e-3
            np.testing.assert_allclose(found, exact[:, 3 * k + m], atol=4e-3 * exact[0, 0])
    np.testing.assert_array_equal(exact, exact.T)


def test_sides_on_patches_are_those_of_points():
    lengths = (1.0, 1.5)
    sides = FreeSides(lengths=lengths, poisson_ratio=0.15, decay_length=0.25)
    patches = uneven_grid(ticks_x=(0.0, 0.1, 0.5, 1.0), ticks_y=(0.0, 0.6, 1.5))
    found = sides.patch_compliance(patches)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    places = [
        (0.5 * (b[1:] + b[:-1])[:, None] + 0.5 * np.diff(b)[:, None] * nodes).ravel()
        for b in (patches.borders_x, patches.borders_y)
    ]
    top = side_displacements(sides, *places, patches).reshape(3, 12, 2, 12, 6)
    means = np.einsum("a,b,iajbn->ijn", weights / 2, weights / 2, top).reshape(6, 6)
    # Gauss' rule against the logarithm at the side
    np.testing.assert_allclose(found, means, atol=3e-3 * means.max())
    shared = found / patches.areas
    np.testing.assert_allclose(shared, shared.T, atol=1e-12 * shared.max())
