"""Stresses in a block's contact face, and what its compliance gains with its height."""

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw.macro import Material, face_compliance

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
