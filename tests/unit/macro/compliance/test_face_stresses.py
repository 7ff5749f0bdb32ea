"""Stresses in a block's contact face, and what its compliance gains with its height."""

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw.macro import Material, face_compliance
from patchlaw.macro.compliance import elements
from patchlaw.macro.compliance.elements import ProductStiffness, block_lines, levels
from patchlaw.support import InputError

MODULUS, LENGTHS, COUNT = 3000.0, (1.0, 1.4), 4


def face(height=0.8, nu=0.3, sides="free", lengths=LENGTHS, count=COUNT):
    material = Material(young_modulus=MODULUS, poisson_ratio=nu)
    return face_compliance(lengths, height, material, sides, count, MPI.COMM_SELF)


def test_rollers_leave_uniaxial_strain():
    nu, area = 0.3, LENGTHS[0] * LENGTHS[1]
    found = face(nu=nu, sides="roller")
    uniform = np.eye(COUNT**2)[0] / area
    for part in found.stresses[:2]:
        np.testing.assert_allclose(part[:, 0], -nu / (1.0 - nu) * uniform, atol=1e-9)
    np.testing.assert_allclose(found.stresses[2, :, 0], 0.0, atol=1e-9)
    modulus = MODULUS * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu))
    np.testing.assert_allclose(found.growth[0], uniform / modulus, atol=1e-9 / modulus)


def test_a_column_without_lateral_contraction_has_no_lateral_stress():
    found = face(nu=0.0)
    np.testing.assert_allclose(found.stresses[:, :, 0], 0.0, atol=1e-9)
    assert found.growth[0, 0] == pytest.approx(1.0 / (MODULUS * np.prod(LENGTHS)), rel=1e-9)


@pytest.mark.parametrize("sides", ["free", "roller"])
def test_growth_is_the_change_with_height(sides):
    step = 1e-3
    higher, lower = face(0.8 + step, sides=sides), face(0.8 - step, sides=sides)
    expected = (higher.normal - lower.normal) / (2.0 * step)
    found = face(sides=sides).growth
    # 6e-7 of the largest, of the finite step
    np.testing.assert_allclose(found, expected, atol=3e-6 * np.abs(expected).max())


def test_stresses_and_growth_are_those_of_one_field():
    """A higher block gains ∫ (σ_zz ε_zz − σ_t : ε_t) dA over its face (Eshelby)."""
    nu, few = 0.3, 3
    found = face(nu=nu, count=8)
    xx, yy, xy = found.stresses * np.prod(LENGTHS)
    lateral = xx.T @ (xx - nu * yy) + yy.T @ (yy - nu * xx) + 2.0 * (1.0 + nu) * xy.T @ xy
    expected = (np.eye(len(lateral)) - lateral) / MODULUS / np.prod(LENGTHS)
    smooth = np.add.outer(8 * np.arange(few), np.arange(few)).ravel()
    both = np.ix_(smooth, smooth)  # stresses by finer modes have parts beyond the eighth mode
    error = np.abs(found.growth - expected)[both].max() / expected[0, 0]
    assert error < 1e-3  # 4e-4


def test_exchanged_axes_exchange_stresses():
    turned = face(lengths=LENGTHS[::-1]).stresses.reshape(3, *4 * (COUNT,))
    expected = turned[[1, 0, 2]].transpose(0, 2, 1, 4, 3).reshape(3, COUNT**2, COUNT**2)
    np.testing.assert_allclose(face().stresses, expected, atol=1e-8)


def test_a_square_is_solved_as_a_rectangle_is():
    square = face(lengths=(1.0, 1.0)).stresses
    nearly = face(lengths=(1.0, 1.0 + 1e-9)).stresses
    np.testing.assert_allclose(square, nearly, atol=1e-6)


SOFT = Material(young_modulus=1.0, poisson_ratio=0.3)


def compliance(lengths, height, sides="free", count=4, material=SOFT, **options):
    return face_compliance(lengths, height, material, sides, count, MPI.COMM_SELF, **options)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
@pytest.mark.parametrize("count", [1, 4, 5])
def test_confined_block_shortens_by_its_confined_modulus(nu, count):
    material = Material(young_modulus=2.0, poisson_ratio=nu)
    found = compliance((1.0, 1.5), 0.8, "roller", count, material)
    # exact up to rounding: the solution is a polynomial
    exact = 0.8 / (material.confined_modulus * 1.5)
    assert found.normal[0, 0] == pytest.approx(exact, rel=1e-12)
    np.testing.assert_allclose(found.normal[1:, 0], 0.0, atol=1e-12 * exact)


def test_slender_free_column_shortens_by_youngs_modulus():
    short, tall = (compliance((1.0, 1.0), height).normal[0, 0] for height in (4.0, 6.0))
    # the clamped end drops out of the difference, to 1e-7 here
    assert tall - short == pytest.approx(2.0, rel=1e-6)


def test_column_bends_as_a_beam():
    """A moment on top, by the mode that is linear along x."""
    short, tall = (compliance((1.0, 1.0), height, count=2).normal[2, 2] for height in (4.0, 6.0))
    # φ = √3 (2x − 1): unit pressure φ has the moment √3/6, turns the top by 12 M Δh, whose
    # displacement has the mean with φ of √3/6 of the turn
    assert tall - short == pytest.approx(12.0 * (3.0 / 36.0) * 2.0, rel=1e-5)


def test_exchanging_the_axes_exchanges_the_modes():
    one = compliance((1.0, 1.4), 0.7, count=3)
    other = compliance((1.4, 1.0), 0.7, count=3)
    order = np.arange(9).reshape(3, 3).T.ravel()
    np.testing.assert_allclose(
        other.normal[np.ix_(order, order)], one.normal, rtol=0, atol=1e-11 * one.normal[0, 0]
    )


def test_a_square_is_the_limit_of_rectangles():
    square = compliance((1.0, 1.0), 1.0, count=3)
    nearly = compliance((1.0, 1.0 + 1e-9), 1.0, count=3)
    np.testing.assert_allclose(nearly.normal, square.normal, atol=1e-8)


def test_modes_do_not_depend_on_their_number():
    few, many = (compliance((1.0, 1.0), 1.0, count=count) for count in (3, 7))
    same = many.normal.reshape(4 * (7,))[:3, :3, :3, :3].reshape(9, 9)
    # the elements differ: by 5e-5 of the mean compliance
    np.testing.assert_allclose(few.normal, same, atol=2e-4 * same[0, 0])


@pytest.mark.parametrize(
    ("height", "nu", "mean", "summed"),
    [
        (1.0, 0.15, 4e-5, 0.02),
        (1.0, 0.45, 2e-3, 0.02),
        (0.1, 0.3, 1e-3, 0.1),
        pytest.param(10.0, 0.3, 1e-4, 2e-3, marks=pytest.mark.long),
    ],
)
def test_coarser_elements_are_stiffer_and_tell_the_error(height, nu, mean, summed, monkeypatch):
    material = Material(young_modulus=1.0, poisson_ratio=nu)
    usual = compliance((1.0, 1.0), height, count=8, material=material).normal
    for degree in ("_MORE", "_AT_TOP", "_BETWEEN", "_AT_BOTTOM"):
        monkeypatch.setattr(elements, degree, getattr(elements, degree) - 2)
    coarse = compliance((1.0, 1.0), height, count=8, material=material).normal
    lost = usual - coarse
    assert np.linalg.eigvalsh(lost).min() > -1e-9 * usual[0, 0]  # nested spaces
    assert 0.0 < lost[0, 0] < mean * usual[0, 0]
    assert np.trace(lost) < summed * usual[0, 0]


def test_elements_cover_the_block():
    for height in (0.02, 0.1, 0.3, 0.7, 1.0, 2.0, 5.0, 50.0):
        for count in (1, 8, 20):
            ticks = levels((1.0, 1.3), height, count)
            assert ticks[0] == -height and ticks[-1] == 0.0
            assert np.all(np.diff(ticks) > 0.0)


def test_impossible_blocks_are_refused():
    with pytest.raises(InputError, match="a top has one mode at least"):
        compliance((1.0, 1.0), 1.0, count=0)
    with pytest.raises(InputError, match="the block has no such size"):
        compliance((1.0, 1.0), -1.0)


def test_cached_compliance_is_the_one_computed(monkeypatch, tmp_path):
    monkeypatch.setenv("PATCHLAW_CACHE", str(tmp_path))
    block = ((1.0, 1.0), 1.0, SOFT, "free", 3, MPI.COMM_SELF)
    first = face_compliance(*block, use_cache=True)
    (path,) = tmp_path.iterdir()
    written = path.stat().st_ino
    second = face_compliance(*block, use_cache=True)
    for name in ("normal", "growth", "stresses"):
        np.testing.assert_array_equal(getattr(second, name), getattr(first, name))
    assert path.stat().st_ino == written  # it was read
    face_compliance((1.0, 1.0), 1.1, *block[2:], use_cache=True)  # another block is not found
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("sides", ["free", "roller"])
@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize("nu", [0.0, 0.49])
def test_displacements_alone_are_those_of_the_whole_solution(nu, count, sides):
    block = (1.0, 1.0), 0.7, sides, count, Material(young_modulus=4e3, poisson_ratio=nu)
    whole, alone = compliance(*block), compliance(*block, normal_alone=True)
    size = np.sqrt(np.diag(whole.normal))
    # half the iterations leave 3e-6 of displacements, and the square of it of works: 1e-11
    np.testing.assert_allclose(alone.normal, whole.normal, rtol=0.0, atol=4e-11 * size.max() ** 2)
    np.testing.assert_array_equal(np.isnan(alone.growth), whole.growth != 0.0)
    assert np.isnan(alone.stresses).any()


def stiffness(lengths, odd):
    """Return the stiffness of a block under pressures of one parity along both axes."""
    x, y, z = block_lines(lengths, 0.7, 5)
    lines = [
        [x.of_parity((odd + (axis == 0)) % 2), y.of_parity((odd + (axis == 1)) % 2), z]
        for axis in range(3)
    ]
    return ProductStiffness(lines, Material(young_modulus=4000.0, poisson_ratio=0.3))


@pytest.mark.parametrize("odd", [0, 1])
def test_a_mirrored_load_displaces_as_if_solved_for_by_itself(odd, monkeypatch):
    block, solved, solve = stiffness((1.0, 1.0), odd), [], ProductStiffness._solved

    def counted(self, forces, left):
        solved.append(forces.shape[1])
        return solve(self, forces, left)

    monkeypatch.setattr(ProductStiffness, "_solved", counted)
    x, y, _ = block.lines[2]
    load = np.random.default_rng(3).normal(size=(len(x.values), len(y.values)))
    tops, every = block.solve({2: np.stack([load, load.T])})
    assert sum(solved) == 1
    alone, coefficients = block.solve({2: load.T[None]})
    assert sum(solved) == 2
    # iterations end at 1e-11 of the load
    for found, exact in zip([*tops, every], [*alone, coefficients], strict=True):
        assert found[..., 1] == pytest.approx(exact[..., 0], abs=1e-9 * np.abs(exact).max())


def test_a_rectangle_has_no_mirrored_loads():
    block = stiffness((1.0, 1.2), 0)
    x, y, _ = block.lines[2]
    load = np.random.default_rng(4).normal(size=(len(x.values), len(y.values)))
    tops, _ = block.solve({2: np.stack([load, load.T])})
    alone, _ = block.solve({2: load.T[None]})
    for found, exact in zip(tops, alone, strict=True):
        assert found[..., 1] == pytest.approx(exact[..., 0], abs=1e-9 * np.abs(exact).max())
