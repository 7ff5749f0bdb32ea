"""The system of the loaded patches alone has the solution of the whole system."""

import numpy as np
import pytest

from patchlaw.multiscale.laws.interpolation import LawCurves, LawPoint, Tangent, _pchip_slopes
from patchlaw.multiscale.laws.rows import LawRows

RNG = np.random.default_rng(2)
COMPLIANCE = 1e-5 * (np.eye(12) + 0.05 * RNG.uniform(0.0, 1.0, (12, 12)))


def law_point(pressure, dclosure, dpressure):
    none = np.zeros(len(pressure))
    return LawPoint(
        closure=none, pressure=pressure, dclosure=dclosure, dpressure=dpressure,
        contact_area_fraction=none, separation=none, dseparation=-dclosure,
        contacts=none.astype(int),
    )  # fmt: skip


def point(loaded, falling=()):
    """Twelve patches of which some are loaded; the closure of some falls without load."""
    pressure, slope, closure = np.zeros(12), np.zeros(12), np.ones(12)
    pressure[loaded], slope[loaded] = 3.0, 4e4
    closure[loaded] = 0.7
    closure[list(falling)] = -0.2
    return law_point(pressure, closure, slope)


@pytest.mark.parametrize("loaded", [[2, 5, 11], [], list(range(12))])
@pytest.mark.parametrize("falling", [(), (4,)])
def test_is_the_whole_system(loaded, falling):
    at = point(loaded, falling if len(loaded) < 12 else ())
    whole = COMPLIANCE * at.dpressure + np.diag(at.dclosure)
    made = Tangent.of(at, COMPLIANCE)
    for right in (RNG.standard_normal(12), RNG.standard_normal((12, 3))):
        np.testing.assert_allclose(made.solve(right), np.linalg.solve(whole, right), rtol=1e-12)
    assert made.norm == pytest.approx(np.abs(whole).sum(axis=1).max(), rel=1e-14)


def test_only_loaded_patches_are_solved_for():
    assert list(Tangent.of(point([2, 5]), COMPLIANCE).loaded) == [2, 5]
    # first touch: no pressure yet, but the closure does not follow the approach alone
    assert list(Tangent.of(point([2, 5], falling=[7]), COMPLIANCE).loaded) == [2, 5, 7]


def test_a_singular_system_is_refused():
    at = law_point(np.ones(2), np.zeros(2), np.zeros(2))
    with pytest.raises(np.linalg.LinAlgError):
        Tangent.of(at, np.zeros((2, 2))).solve(np.ones(2))


def test_closures_that_stop_little_by_little_have_no_rigid_end():
    """Rows of −4^(−x): three rows at the end alone tell a slope of 0, that of a rigid law."""
    values = -(0.25 ** np.arange(4.0))
    secant = np.append(np.diff(values), 0.0)[:, None] * np.ones(4)
    found = _pchip_slopes(np.arange(4.0), secant, np.array([0]), np.array([3]))[-1]
    exact = np.log(4.0) * 0.25**3
    assert (0.5 * exact < found).all() and (found < exact).all()


def test_mean_gaps_of_rounding_are_none():
    """Whatever is left at the last row, the law is as stiff against its gap before."""
    approach = np.linspace(1e-3, 5e-3, 9)
    gap = 1e-3 * (1.0 - np.linspace(0.0, 1.0, 9)) ** 2
    stiffness = []
    for left in (-1e-12, 0.0, 1e-11):
        gap[-1] = left
        rows = LawRows(
            approach=approach, closure=2e-3 - gap, pressure=np.linspace(0.0, 40.0, 9),
            contact_area_fraction=np.linspace(0.0, 1.0, 9), contacts=np.ones(9, int),
            unresolved_displacement=np.zeros(9),
        )  # fmt: skip
        curves = LawCurves.through(rows, [9], [2e-3])
        point = curves.at(0, approach[-2] + np.array([1e-5, 2e-4]))
        stiffness.append(curves.interface_stiffness(0, point))
    np.testing.assert_allclose(stiffness, np.broadcast_to(stiffness[0], (3, 2)), rtol=1e-5)
    assert (stiffness[0] > 0.0).all()
