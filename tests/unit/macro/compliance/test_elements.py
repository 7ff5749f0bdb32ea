"""Elements of high order along a line: what their shapes span, and integrals in closed form."""

from itertools import pairwise

import numpy as np
import pytest

from patchlaw.geometry.face_frame import mode_values
from patchlaw.macro.compliance.elements import across, nodal, upwards

TICKS = np.array([-1.0, -0.3, 0.0])
LENGTH = 1.2


def places(count):
    """Return the points of the line across the top that has so many."""
    return 0.5 * LENGTH * (1.0 + np.polynomial.legendre.leggauss(count)[0])


def test_functions_upwards_vanish_at_the_bottom_and_one_is_1_at_the_top():
    line = upwards(TICKS, (3, 5))
    assert sorted(line.last) == [0.0] * 7 + [1.0]
    t = np.polynomial.legendre.leggauss(6)[0]
    z = np.concatenate([
        low + 0.5 * (high - low) * (1.0 + t) for low, high in pairwise(TICKS)
    ])  # fmt: skip
    # by integration by parts against z + 1 and its square: ∫ N' f + ∫ N f' = [N f]
    for power in (1, 2):
        f, rise = (z + 1.0) ** power, power * (z + 1.0) ** (power - 1)
        found = (line.slopes * f + line.values * rise) @ line.weights
        np.testing.assert_allclose(found, line.last, atol=1e-14)
    assert line.weights.sum() == pytest.approx(1.0, rel=1e-15)
    share, *_ = np.linalg.lstsq(line.values.T, (z + 1.0) ** 3, rcond=None)
    np.testing.assert_allclose(share @ line.values, (z + 1.0) ** 3, atol=1e-14)
    np.testing.assert_allclose(share @ line.slopes, 3.0 * (z + 1.0) ** 2, atol=1e-12)


@pytest.mark.parametrize("odd", [0, 1])
def test_polynomials_of_the_parity_are_spanned(odd):
    line = across(LENGTH, 8, 2).of_parity(odd)
    x = places(9) - 0.5 * LENGTH
    for power in range(odd, 8, 2):
        share, *_ = np.linalg.lstsq(line.values.T, x**power, rcond=None)
        np.testing.assert_allclose(share @ line.values, x**power, atol=1e-14)
        risen = power * x ** max(power - 1, 0)
        np.testing.assert_allclose(share @ line.slopes, risen, atol=1e-12)


@pytest.mark.parametrize("odd", [0, 1])
def test_functions_but_one_vanish_at_the_sides(odd):
    line = across(LENGTH, 8, 2).of_parity(odd)
    assert line.last.tolist() == [1.0] + [0.0] * (len(line.last) - 1)
    assert not line.held().last.any() and len(line.held().values) == len(line.values) - 1
    x = places(9)
    # ∫ N' x + ∫ N is the value at the far side, times the length
    found = (line.slopes * x + line.values) @ line.weights
    np.testing.assert_allclose(found, LENGTH * line.last, atol=1e-14)


def test_mode_integrals_are_exact():
    line, finer = across(LENGTH, 9, 7), across(LENGTH, 40, 7)
    modes = mode_values(places(41), LENGTH, 7) * finer.weights
    # the functions of a degree are among those of a higher one
    for whole, part in (
        (line.modes, modes @ finer.values[:10].T),
        (line.mode_slopes, modes @ finer.slopes[:10].T),
    ):
        np.testing.assert_allclose(whole, part, atol=1e-13 * np.abs(part).max())


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cells", [4, 5])
def test_nodal_functions_of_both_parities_span_those_of_the_elements(degree, cells):
    ticks, borders = LENGTH * np.linspace(0.0, 1.0, cells + 1), np.array([0.1, 0.35, LENGTH])
    line = nodal(ticks, degree, borders)
    assert len(line.values) == degree * cells + 1
    even, odd = line.of_parity(0), line.of_parity(1)
    np.testing.assert_allclose((even.values * line.weights) @ odd.values.T, 0.0, atol=1e-15)
    # ∫ N' x^k + ∫ N k x^(k - 1) is the value at the far side times its power
    ones = np.linalg.lstsq(line.values.T, np.ones_like(line.weights), rcond=None)[0]
    np.testing.assert_allclose(ones @ line.values, 1.0, rtol=1e-13)
    np.testing.assert_allclose(ones @ line.slopes, 0.0, atol=1e-12)
    np.testing.assert_allclose(line.modes @ ones, np.diff(borders), rtol=1e-13)
    assert ones @ line.last == pytest.approx(1.0, rel=1e-13)


def test_diagonalised_functions_are_orthonormal_and_so_are_their_slopes():
    line, squares = across(LENGTH, 8, 2).of_parity(0).diagonalised()
    masses = (line.values * line.weights) @ line.values.T
    np.testing.assert_allclose(masses, np.eye(len(masses)), atol=1e-13)
    stiffness = (line.slopes * line.weights) @ line.slopes.T
    np.testing.assert_allclose(stiffness, np.diag(squares), atol=1e-13 * squares.max())
    assert squares[0] < 1e-12 * squares[1]  # the constant
