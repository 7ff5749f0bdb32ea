"""Shape factors of elliptic contacts: limits, accuracy, refusals."""

import numpy as np
import pytest
from scipy.special import ellipe, ellipk

from patchlaw import InputError
from patchlaw.micro.closed_forms import factors_at, shape_factors


def paper_force_factor(e):
    """F1 as Waddad et al. 2016 print it below eq. 1; cancels for small e."""
    K, E = ellipk(e**2), ellipe(e**2)
    return np.pi / np.sqrt(2) / e * ((E / (1 - e**2) - K) * (K - E)) ** 0.25 * K**-1.5


@pytest.mark.parametrize("factor", ["force", "area", "axis"])
def test_circle_is_one(factor):
    # a few roundings of Carlson's integrals
    assert getattr(factors_at(0.0), factor) == pytest.approx(1.0, abs=4e-16)
    # Each factor is 1 + O(e²) with a coefficient below 1: no 0/0 and no noise on the way to e = 0.
    small = np.array([1e-12, 1e-9, 1e-6, 1e-4])
    assert np.all(np.abs(getattr(factors_at(small), factor) - 1.0) <= small**2 + 1e-15)


def test_factors_are_the_papers():
    e = np.array([0.3, 0.6, 0.9, 0.99])
    K = ellipk(e**2)
    F1, found = paper_force_factor(e), factors_at(e)
    # The paper's form loses about eps/e⁴ = 3e-14 at e = 0.3.
    assert found.force == pytest.approx(F1, rel=1e-13)
    assert found.axis == pytest.approx(2 * K * F1 / np.pi, rel=1e-13)
    assert found.area == pytest.approx(np.sqrt(1 - e**2) * (2 * K * F1 / np.pi) ** 2, rel=1e-13)


def test_slender_contact_follows_its_asymptote():
    # As β = b²/a² → 0: K → Λ, K − E → Λ − 1, E/β − K → 1/β with Λ = ln(4/√β), so that
    # R'/R'' → 1/(β (Λ − 1)); the next terms are of order β ln β, 1e-8 here.
    ratio = np.array([1e8, 1e10])
    beta = shape_factors(ratio, 1.0).axis_ratio_squared
    assert 1.0 / (beta * (np.log(4 / np.sqrt(beta)) - 1.0)) == pytest.approx(ratio, rel=1e-7)


def test_nearly_round_contact():
    # β = 1 − 4/3 ε + O(ε²) for R'/R'' = 1 + ε: no digit of ε is lost.
    excess = np.array([1e-12, 1e-9, 1e-6])
    ratio = 1.0 + excess
    exact_excess = ratio - 1.0
    assert 1.0 - shape_factors(ratio, 1.0).axis_ratio_squared == pytest.approx(
        4 / 3 * exact_excess, rel=2e-3
    )
    assert shape_factors(1.0, 1.0).axis_ratio == 1.0
    assert shape_factors(1.0, 1.0).eccentricity == 0.0


@pytest.mark.parametrize(
    "radii", [(1.0, 2.0), (1.0, 0.0), (-1.0, -2.0), (np.inf, 1.0), (np.nan, 1)]
)
def test_refuses_radii(radii):
    with pytest.raises(InputError, match=r"do not describe a summit.*finite R' ≥ R'' > 0"):
        shape_factors(*radii)
