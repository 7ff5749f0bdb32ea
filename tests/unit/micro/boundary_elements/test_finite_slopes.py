"""The finite-slope term: symmetry, invariance, orders against a solution without expansion."""

from dataclasses import replace

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Control, Material, Spectrum, Surface, synthesise
from patchlaw.micro import FiniteSlopes, FreeSides, HalfSpaceModel, SideStresses, coarse_grid


def displaced(heights, pressure, shear, nu):
    """Return −u_z on the surface z = h of a half-space, without its mean, shape (n, n).

    Every wave of the plane carries three solutions that decay with depth: shear, the gradient
    of a harmonic function φ, and Papkovich's (3 − 4ν) ψ e_z − z ∇ψ. Their tractions meet −p e_z per
    area of the plane at the grid's points. The period is 2π, n odd, and p has no mean.
    """
    n = len(heights)
    x = 2.0 * np.pi * np.arange(n) / n
    points = np.stack([*np.meshgrid(x, x, indexing="ij"), heights]).reshape(3, -1)
    slopes = _gradient(heights).reshape(2, -1)
    columns, lifts = [], []
    for kx, ky in _wave_vectors(n):
        for field in _solutions(kx, ky, points, nu):
            u, gradient = field
            stress = shear * (gradient + gradient.swapaxes(0, 1))
            trace = np.trace(gradient) * 2.0 * shear * nu / (1.0 - 2.0 * nu)
            stress += trace * np.eye(3)[:, :, None]
            traction = stress[:, 2] - slopes[0] * stress[:, 0] - slopes[1] * stress[:, 1]
            columns.append(traction.ravel())
            lifts.append(u[2])
    wanted = np.zeros((3, n * n))
    wanted[2] = -pressure.ravel()
    shares, *_ = np.linalg.lstsq(np.stack(columns, axis=1), wanted.ravel(), rcond=None)
    found = -(np.stack(lifts, axis=1) @ shares).real.reshape(n, n)
    return found - found.mean()


def _wave_vectors(n):
    numbers = np.arange(n) - n // 2
    return [(kx, ky) for kx in numbers for ky in numbers if (kx, ky) != (0, 0)]


def _gradient(heights):
    n = len(heights)
    k = 1j * np.fft.fftfreq(n, 1.0 / n)
    waves = np.fft.fft2(heights)
    return np.stack([np.fft.ifft2(k[:, None] * waves).real, np.fft.ifft2(k * waves).real])


def _solutions(kx, ky, points, nu):
    """Yield displacements (3, m) and their gradients [i, j] = ∂u_i/∂x_j, shape (3, 3, m)."""
    k = np.hypot(kx, ky)
    z = points[2]
    wave = np.exp(1j * (kx * points[0] + ky * points[1]) + k * z)
    d = np.array([1j * kx, 1j * ky, k])  # of the wave
    for u in (np.array([-ky, kx, 0.0]) / k, d / k):
        yield u[:, None] * wave, np.multiply.outer(np.outer(u, d), wave)
    up = np.array([0.0, 0.0, 1.0])
    constant, falling = (3.0 - 4.0 * nu) * up, -d
    gradient = np.multiply.outer(np.outer(constant, d) + np.outer(falling, up), wave)
    gradient = gradient + np.multiply.outer(np.outer(falling, d), z * wave)
    yield constant[:, None] * wave + falling[:, None] * (z * wave), gradient


MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.3)
DICE = np.random.default_rng(7)


def rough(grid=(48, 40), lengths=(1.0, 0.9)):
    return synthesise(
        Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.2, seed=3), grid=grid, lengths=lengths
    )


def beside_of(surface):
    sides = FreeSides(lengths=surface.lengths, poisson_ratio=0.3, decay_length=0.5)
    spacing = tuple(
        length / count for length, count in zip(surface.lengths, coarse_grid(surface), strict=True)
    )
    return [SideStresses(sides, spacing)]


def term(surface, around="nothing", **options):
    if around == "block":
        options["edge_stresses"] = beside_of(surface)
    return FiniteSlopes(surface, MATERIAL, periodic=around == "periodic", **options)


def pressed(surface, periodic=False, approach=2e-3):
    model = HalfSpaceModel(surface=surface, contact_modulus=4000.0 / 0.91, periodic=periodic)
    return model.press(Control(approach=approach)).pressure


NEARLY_FLAT = 1e-7
"""Factor on heights whose second order is rounding."""
GRIDS = pytest.mark.parametrize("grid", [(48, 40), (128, 130)], ids=["own", "coarse"])
AROUND = pytest.mark.parametrize("around", ["nothing", "periodic", "block"])


@GRIDS
@AROUND
def test_first_order_is_symmetric(grid, around):
    slopes = term(rough(grid).scaled(NEARLY_FLAT), around)
    p, q = DICE.standard_normal((2, *grid))
    moved = slopes.displacement(p), slopes.displacement(q)
    scale = np.linalg.norm(q) * np.linalg.norm(moved[0])
    assert abs(np.sum(q * moved[0]) - np.sum(p * moved[1])) < 1e-5 * scale


@GRIDS
@AROUND
def test_second_order_is_symmetric_up_to_its_share(grid, around):
    """It is a symmetric map times a factor that depends on the pressures: s(p) L p."""
    surface = rough(grid)
    first, both = term(surface.scaled(NEARLY_FLAT), around), term(surface, around)
    fields = np.abs(DICE.standard_normal((3, *grid)))
    second = np.array([both.displacement(p) - first.displacement(p) / NEARLY_FLAT for p in fields])
    work = np.tensordot(second, fields, axes=((1, 2), (1, 2)))
    # the factors cancel around a circle of three
    one, other = work[0, 1] * work[1, 2] * work[2, 0], work[1, 0] * work[2, 1] * work[0, 2]
    assert one == pytest.approx(other, rel=1e-5) and one != 0.0


@pytest.mark.parametrize("around", ["nothing", "periodic"])
def test_the_half_space_is_the_same_a_tenth_of_a_millimetre_lower(around):
    """But for a constant by what is cut off far away, 1 % of the largest displacement at most.

    A periodic body that ends lower is under the mean pressure there.
    """
    surface = rough()
    pressure = pressed(surface, around == "periodic")
    here = term(surface, around).displacement(pressure)
    scale = np.abs(here).max()
    for plane in (-0.1, 0.1):  # the heights span 0.07 mm
        change = term(surface, around, plane=plane).displacement(pressure) - here
        more = (surface.mean_height - plane) * pressure.mean() / MATERIAL.young_modulus
        assert change.mean() == pytest.approx(more * (around == "periodic"), abs=0.02 * scale)
        assert change == pytest.approx(change.mean(), abs=1e-3 * scale)  # single precision


@pytest.mark.parametrize("around", ["nothing", "periodic", "block"])
def test_heights_count_from_anywhere(around):
    surface = rough()
    pressure = pressed(surface)
    lower = Surface(heights=surface.heights - 5.0, lengths=surface.lengths, periodic=True)
    found = [term(given, around).displacement(pressure) for given in (surface, lower)]
    assert found[1] == pytest.approx(found[0], abs=1e-5 * np.abs(found[0]).max())


@pytest.mark.parametrize(("grid", "shift"), [((17, 22), (5, 9)), ((128, 256), (64, 26))])
def test_a_period_begins_anywhere(grid, shift):
    """On cells twice as wide by whole ones; but for rounding."""
    surface = rough(grid)
    assert coarse_grid(surface) == ((17, 22) if grid[0] == 17 else (64, 128))
    moved = replace(surface, heights=np.roll(surface.heights, shift, (0, 1)))
    pressure = pressed(surface, periodic=True)
    rolled = np.roll(pressure, shift, (0, 1))
    one, other = term(surface, "periodic"), term(moved, "periodic")
    here, there = one.displacement(pressure), other.displacement(rolled)
    assert there == pytest.approx(np.roll(here, shift, (0, 1)), abs=1e-10 * np.abs(here).max())
    assert other.error(rolled) == pytest.approx(one.error(pressure), rel=1e-10)


def test_second_order_counts_heights_from_anywhere():
    surface = rough()
    pressure = pressed(surface)
    slopes = term(surface)
    here = slopes.displacement(pressure)
    slopes._below = slopes._below + np.float32(0.05)  # the heights span 0.07 mm
    there = slopes.displacement(pressure)
    # but for what is cut off far away
    assert there == pytest.approx(here, abs=5e-3 * np.abs(here).max())


@pytest.mark.parametrize("where", [0, 1, 20], ids=["side", "beside a side", "middle"])
def test_constant_heights_have_no_second_order(where):
    """However small the cells are, and however fast the loads change from cell to cell."""
    slopes = term(rough((48, 48)), "block")
    slopes._below = np.full(slopes.grid, -0.05)  # 2.4 cells
    pressure = np.zeros(slopes.grid)
    pressure[where, 10:30:3] = 1.0
    second = slopes.orders(pressure)[0][1]
    # but for rounding; as large as the displacement of a cell where heights count from the top
    assert np.abs(second).max() < 1e-12 * slopes.spacing[0] / MATERIAL.young_modulus


@pytest.mark.parametrize("around", ["nothing", "periodic", "block"])
@pytest.mark.parametrize("grid", [(18, 15), (20, 24)])
def test_a_mirrored_surface_moves_as_in_a_mirror(grid, around):
    """Down to waves of two cells, which run neither way."""
    surface = rough(grid)
    pressure = pressed(surface, around == "periodic")
    own = term(surface, around)
    found = own.displacement(pressure)
    for axis in (0, 1):
        mirrored = replace(surface, heights=np.flip(surface.heights, axis))
        other = term(mirrored, around)
        moved = other.displacement(np.flip(pressure, axis))
        assert np.flip(moved, axis) == pytest.approx(found, abs=1e-9 * np.abs(found).max())
        # loads near a border, where gradients are those of the surface that continues around it
        beside = np.zeros(surface.grid)
        beside[2, 1] = 1.0
        error = other.error(np.flip(beside, axis))
        assert error == pytest.approx(own.error(beside), rel=1e-9)


@pytest.mark.parametrize("held", [False, True])
def test_displacement_of_a_periodic_surface_counts_from_the_flat_body(held):
    """Mean pressures p' load the heights: to first order ∫ h (p p'/E − σ : e(σ')) dA, σ' by p'."""
    surface = rough()
    pressure = pressed(surface, periodic=True)
    flat = term(surface.scaled(NEARLY_FLAT), "periodic", held=held)
    found = flat.displacement(pressure).mean() / NEARLY_FLAT
    heights, nu = surface.heights - surface.mean_height, MATERIAL.poisson_ratio
    expected = np.mean(heights * pressure) / MATERIAL.young_modulus
    if held:  # σ' = −ν/(1 − ν) p' along both, and σ_xx + σ_yy of waves −(1 + 2ν) p
        expected *= 1.0 - nu * (1.0 + 2.0 * nu)
    assert found == pytest.approx(expected, rel=1e-2)  # heights are filtered


def test_first_order_is_linear_in_heights_and_softens_a_sphere():
    x = (np.arange(64) + 0.5) / 64 - 0.5
    sphere = Surface(heights=-(x[:, None] ** 2 + x**2), lengths=(1.0, 1.0))
    pressure = pressed(sphere)
    whole, tenth = (
        term(sphere.scaled(factor * NEARLY_FLAT)).displacement(pressure) for factor in (1.0, 0.1)
    )
    assert np.sum(whole * pressure) > 0.0
    assert tenth == pytest.approx(0.1 * whole, abs=1e-5 * np.abs(whole).max())


WAVES = 13


def field(n, phases, numbers):
    """Return a smooth field without a mean at the centres of n × n cells of (2π)²."""
    x = 2.0 * np.pi * np.arange(n) / n
    x, y = np.meshgrid(x, x, indexing="ij")
    return sum(np.cos(i * x + j * y + at) for (i, j), at in zip(numbers, phases, strict=True))


def heights_of(n):
    return 0.02 * field(n, (0.0, 0.7, 2.0), ((1, 0), (0, 1), (1, 1)))


def pressure_of(n):
    return field(n, (0.3, 1.1, 0.2), ((1, 0), (1, 1), (2, -1)))


@pytest.fixture(scope="module")
def expansion_errors():
    """Errors of the work of the pressures by heights × 1 and × ½, to first and second order."""
    shear, nu = MATERIAL.shear_modulus, MATERIAL.poisson_ratio
    small, large = pressure_of(WAVES), pressure_of(60)
    flat = displaced(np.zeros_like(small), small, shear, nu)
    errors = []
    for factor in (1.0, 0.5):
        exact = np.mean(small * (displaced(factor * heights_of(WAVES), small, shear, nu) - flat))
        surface = Surface(
            heights=factor * heights_of(60), lengths=(2.0 * np.pi,) * 2, periodic=True
        )
        found = [
            np.mean(large * term(surface.scaled(scale), "periodic").displacement(large)) / scale
            for scale in (NEARLY_FLAT, 1.0)
        ]
        errors.append([value / exact - 1.0 for value in found])
    return np.array(errors)


def test_two_orders_meet_the_solution_without_expansion(expansion_errors):
    first, second = np.abs(expansion_errors[0])
    assert second < 0.1 * first
    assert second < 0.02


@pytest.mark.parametrize(("order", "least"), [(1, 0.9), (2, 1.9)])
def test_errors_fall_with_the_order_of_the_heights(expansion_errors, order, least):
    """Relative to what slopes change, which is of first order itself; measured 1.2 and 3.4."""
    whole, half = np.abs(expansion_errors[:, order - 1])
    assert np.log2(whole / half) > least


def test_flat_half_space_of_the_oracle():
    shear, nu = MATERIAL.shear_modulus, MATERIAL.poisson_ratio
    x = 2.0 * np.pi * np.arange(WAVES) / WAVES
    pressure = np.cos(x)[:, None] * np.cos(2.0 * x)
    found = displaced(np.zeros_like(pressure), pressure, shear, nu)
    assert found == pytest.approx((1.0 - nu) / (shear * np.sqrt(5.0)) * pressure, abs=1e-12)


def test_cells_are_as_coarse_as_heights_allow():
    assert coarse_grid(rough((48, 40))) == (48, 40)
    assert coarse_grid(rough((128, 128))) == (64, 64)
    assert coarse_grid(rough((512, 256))) == (128, 64)
    noise = Surface(heights=DICE.standard_normal((256, 256)), lengths=(1.0, 1.0))
    assert coarse_grid(noise) == (256, 256)


def test_cells_of_a_periodic_surface_stay_as_coarse_when_it_is_shifted():
    along = 2.0 * np.pi * (np.arange(128) + 0.5) / 128.0
    # gradients of waves beyond the coarse cells are 0.098 of all of them
    heights = 0.01 * (np.cos(along) + np.sqrt(0.098 / 0.902) / 40.0 * np.cos(40.0 * along))
    waves = np.tile(heights[:, None], 128)
    surface = Surface(heights=waves, lengths=(1.0, 1.0), periodic=True)
    shifts = (0, 13, 32, 77)
    shifted = [replace(surface, heights=np.roll(surface.heights, n, 0)) for n in shifts]
    assert [coarse_grid(one) for one in shifted] == 4 * [(64, 64)]


def test_coarse_cells_make_little_difference():
    surface = rough((128, 128), (1.0, 1.0))
    pressure = pressed(surface, approach=8e-3)
    coarse, fine = (
        np.sum(pressure * term(surface, grid=grid).displacement(pressure))
        for grid in (None, surface.grid)
    )
    assert coarse == pytest.approx(fine, rel=0.01)  # of some 3 % of the displacement


def test_surface_that_does_not_continue():
    surface = Surface(heights=rough().heights, lengths=(1.0, 0.9))
    with pytest.raises(InputError, match="periodic slopes need a periodic surface"):
        term(surface, "periodic")


@AROUND
def test_slopes_on_a_half_space_keep_their_cells(around):
    """Those of another grid would count its error as one of the body."""
    slopes = term(rough((64, 48)), around, grid=(24, 20))
    alone = slopes.on_half_space()
    assert slopes.grid == alone.grid == (24, 20)
    pressure = pressed(rough((64, 48)), around == "periodic")
    expected = term(
        rough((64, 48)), "periodic" if around == "periodic" else "nothing", grid=(24, 20)
    )
    np.testing.assert_array_equal(alone.displacement(pressure), expected.displacement(pressure))
