"""Half-space and free sides in modes, on patches, and the fields below them."""

import numpy as np
import pytest
from helpers.boussinesq import stresses
from helpers.free_side_points import side_displacements
from helpers.uneven_grid import uneven_grid

from patchlaw.geometry import Material, PatchGrid
from patchlaw.geometry.face_frame import mode_means, mode_values
from patchlaw.geometry.patches import field_means, mean_shares
from patchlaw.micro import (
    BodyModes,
    FreeSides,
    RectangleFields,
    half_space_modes,
    half_space_stress_modes,
    influence_matrix,
    side_modes,
)
from patchlaw.micro.boundary_elements.grid_compliance import Compliance
from patchlaw.micro.boundary_elements.side_cells import SideTerm, side_cells
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


MATERIAL = Material(young_modulus=3000.0, poisson_ratio=0.2)
LENGTHS = (1.0, 0.7)
PLACES = np.array(
    [[0.0, 0.3, -0.01], [0.4, 0.2, -0.3], [1.0, 0.7, -1e-4], [2.0, -1.0, -0.5], [-0.02, 0.1, -2.0]]
)


def fields(count=1, **changes):
    return RectangleFields(lengths=LENGTHS, count=count, material=MATERIAL, **changes)


def test_uniform_pressure_is_loves():
    rectangle = PatchGrid(grid=(1, 1), lengths=LENGTHS)
    expected = stresses(MATERIAL, PLACES[:, 0], PLACES[:, 1], -PLACES[:, 2], rectangle)[..., 0]
    xx, yy, zz, yz, xz, xy = expected
    found = fields()(PLACES)[1][..., 0]
    # the rules leave 1e-8; z points out of the half-space here
    for (i, j), part in {(0, 0): xx, (1, 1): yy, (2, 2): zz, (0, 1): xy}.items():
        np.testing.assert_allclose(found[:, i, j], part, atol=1e-7)
    np.testing.assert_allclose(found[:, 0, 2], -xz, atol=1e-7)
    np.testing.assert_allclose(found[:, 1, 2], -yz, atol=1e-7)


@pytest.mark.parametrize("axis", range(3))
def test_displacements_have_the_stresses_by_hookes_law(axis):
    field, step = fields(4, axis=axis), 1e-4
    place = np.array([0.3, 0.6, -0.2])
    ends = place + step * np.array([s * e for s in (1.0, -1.0) for e in np.eye(3)])
    values = field(ends)[0]
    gradient = (values[:3] - values[3:]) / (2.0 * step)  # ∂_i u_j
    strain = 0.5 * (gradient + gradient.transpose(1, 0, 2))
    first, shear = MATERIAL.lame
    trace = np.einsum("iik->k", strain)
    expected = 2.0 * shear * strain + first * np.eye(3)[..., None] * trace
    np.testing.assert_allclose(field(place[None])[1][0], expected, atol=1e-4)  # step² × curvature


@pytest.mark.parametrize("axis", range(2))
def test_below_the_surface_the_stress_is_the_traction(axis):
    inside, outside = fields(axis=axis)(np.array([[0.4, 0.3, -1e-6], [1.3, 0.3, -1e-6]]))[1]
    expected = np.eye(3)[axis]
    np.testing.assert_allclose(inside[:, 2, 0], expected, atol=1e-5)  # as much as the depth
    np.testing.assert_allclose(outside[:, 2, 0], 0.0, atol=1e-5)


@pytest.mark.long
@pytest.mark.parametrize("axis", range(2))
def test_displacements_in_the_surface_have_the_modes_own_moments_in_all_directions(axis):
    count, sides = 2, (True, False, False, True)
    (x, along_x), (y, along_y) = (graded(count, length) for length in LENGTHS)
    places = np.stack(np.meshgrid(x, y, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    tests = np.kron(along_x, along_y) / np.prod(LENGTHS) ** 2
    for extended in ((False,) * 4, sides):
        field = fields(count, axis=axis, extended=extended)
        displacement, expected = field(places)[0], field.displacement_modes()
        for part, (i, sign) in zip(expected, enumerate((1.0, 1.0, -1.0)), strict=True):
            # steeper at the sides than across them
            atol = 5e-5 * np.abs(expected).max()
            np.testing.assert_allclose(sign * tests @ displacement[:, i], part, atol=atol)


def graded(count, length):
    nodes, weights = np.polynomial.legendre.leggauss(16)
    t = 0.5 * (1.0 + nodes)
    x = length * t**2 * (3.0 - 2.0 * t)
    return x, mode_values(x, length, count) * (3.0 * length * t * (1.0 - t) * weights)


def test_fields_in_the_surface_have_the_modes_own_moments():
    count = 3
    (x, along_x), (y, along_y) = (graded(count, length) for length in LENGTHS)
    places = np.stack(np.meshgrid(x, y, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    displacement, stress = fields(count)(places)
    tests = np.kron(along_x, along_y) / np.prod(LENGTHS) ** 2
    normal = half_space_modes(LENGTHS, count) / MATERIAL.contact_modulus
    np.testing.assert_allclose(-tests @ displacement[:, 2], normal, atol=1e-5 * normal.max())
    parts = half_space_stress_modes(LENGTHS, MATERIAL.poisson_ratio, count)
    for part, (i, j) in zip(parts, ((0, 0), (1, 1), (0, 1)), strict=True):
        # logarithms at the sides, of which the graded points leave this
        np.testing.assert_allclose(tests @ stress[:, i, j], part, atol=2e-3)


@pytest.mark.parametrize("side", range(4))
def test_pressures_go_on_smoothly_beyond_a_side(side):
    axis, high = divmod(side, 2)
    sides = np.arange(4) == side
    field = fields(5, extended=tuple(sides.tolist()))
    edge = high * LENGTHS[axis]
    across = edge + 1e-3 * np.linspace(-1.0, 1.0, 5)
    places = np.full((5, 3), [0.4, 0.3, -1e-6])
    places[:, axis] = across
    pressure = -field(places)[1][:, 2, 2]
    # a polynomial of degree 2 to the third order: its differences of third order are small
    jumps = np.abs(np.diff(pressure, 3, axis=0)).max()
    assert jumps < 2e-3 * np.abs(pressure).max()
    beyond = np.array([[0.4, 0.3, -1e-6]])
    beyond[0, axis] = edge + (1.0 if high else -1.0) * 1.1 * field.reach[axis]
    assert np.abs(field(beyond)[1][:, 2, 2]).max() < 1e-3  # nothing presses there


def test_moments_of_smooth_extensions_are_those_of_the_field():
    field = fields(2, extended=(True, False, False, True))
    normal, stress = field.modes()
    (x, along_x), (y, along_y) = (graded(2, length) for length in LENGTHS)
    places = np.stack(np.meshgrid(x, y, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    displacement, found = field(places)
    tests = np.kron(along_x, along_y) / np.prod(LENGTHS) ** 2
    np.testing.assert_allclose(-tests @ displacement[:, 2], normal, atol=1e-5 * normal.max())
    np.testing.assert_allclose(tests @ found[:, 0, 0], stress[0], atol=2e-3)


OBLONG, GRID = (1.0, 0.75), (40, 30)
PATCHES = {
    "along cells": PatchGrid(grid=(5, 3), lengths=OBLONG),
    "across cells": PatchGrid(grid=(3, 4), lengths=(0.7, 0.6), origin=(0.13, 0.07)),
}
SIDES = SideTerm(FreeSides(lengths=OBLONG, poisson_ratio=0.3, decay_length=0.2))


@pytest.mark.parametrize("patches", PATCHES.values(), ids=PATCHES)
@pytest.mark.parametrize("bounded", [False, True], ids=["half-space", "body with sides"])
def test_patches_are_displaced_as_their_cells_in_the_mean(patches, bounded):
    draws = np.random.default_rng(5)
    half = draws.normal(size=(9, 9))
    terms = [SIDES, BodyModes(OBLONG, 1e-4 * (half + half.T))] if bounded else []
    spacing = OBLONG[0] / GRID[0], OBLONG[1] / GRID[1]
    body = Compliance(periodic=False, modulus=4000.0, terms=terms).on_grid(GRID, spacing)
    few, pressure = draws.permutation(np.prod(GRID))[:60], np.zeros(GRID)
    pressure.ravel()[few] = draws.random(60)
    found = body.on_patches(few, mean_shares(patches, OBLONG, GRID)) @ pressure.ravel()[few]
    exact = field_means(body.displacement(pressure), OBLONG, patches)
    # rounding of transforms of 1200 cells
    assert found == pytest.approx(exact, rel=1e-12, abs=1e-14 * np.abs(exact).max())
