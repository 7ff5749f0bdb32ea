"""Fields below modes of pressure, against Love's closed form and the modes' own moments."""

import numpy as np
import pytest
from helpers.boussinesq import stresses

from patchlaw.geometry import Material, PatchGrid
from patchlaw.geometry.face_frame import mode_values
from patchlaw.micro import RectangleFields, half_space_modes, half_space_stress_modes

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
