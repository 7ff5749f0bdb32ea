"""The contact ellipse's axis ratio against a brute-force root of the defining integrals."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from patchlaw.micro.closed_forms import factors_at, shape_factors


def complete_integrals(beta):
    """K and E by quadrature of their definitions, with m = 1 − β."""

    def root(phi):
        return np.sqrt(np.cos(phi) ** 2 + beta * np.sin(phi) ** 2)

    options = {"epsabs": 0.0, "epsrel": 1e-13, "limit": 400}
    # The integrand of K varies over cos φ ~ √β: break the interval there.
    edge = np.pi / 2 - 3 * np.sqrt(beta)
    edges = [0.0, edge, np.pi / 2] if edge > 0 else [0.0, np.pi / 2]
    pieces = list(pairwise(edges))
    K = sum(quad(lambda phi: 1 / root(phi), lo, hi, **options)[0] for lo, hi in pieces)
    E = sum(quad(root, lo, hi, **options)[0] for lo, hi in pieces)
    return K, E


def radius_ratio(beta):
    """R'/R'' of a contact with b²/a² = β (Johnson 1985, eq. 4.25)."""
    K, E = complete_integrals(beta)
    return (E / beta - K) / (K - E)


@pytest.mark.parametrize("ratio", [1.1, 2.0, 10.0, 1e3, 1e5, 1e8])
def test_exact_root(ratio):
    log_beta = brentq(
        lambda t: np.log(radius_ratio(np.exp(t)) / ratio), -1.6 * np.log(ratio), -1e-3, xtol=1e-14
    )
    # K − E loses up to two digits at 1.1, quad keeps 1e-13.
    shape = shape_factors(ratio, 1.0)
    assert shape.axis_ratio == pytest.approx(np.exp(0.5 * log_beta), rel=1e-11)
    assert shape.eccentricity == pytest.approx(np.sqrt(-np.expm1(log_beta)), rel=1e-10)


@pytest.mark.parametrize("e", [0.2, 0.7, 0.99])
def test_force_factor(e):
    K, E = complete_integrals(1 - e**2)
    F1 = np.pi / np.sqrt(2) / e * ((E / (1 - e**2) - K) * (K - E)) ** 0.25 * K**-1.5
    assert factors_at(e).force == pytest.approx(F1, rel=1e-11)  # cancellation in the reference
