"""Hard contacts: summits that coincide nearly, ellipses that are lines or circles nearly."""

import numpy as np
import pytest
from helpers.asperity_states import pressed
from helpers.interaction_cases import E_STAR, summits
from scipy.optimize import brentq

from patchlaw.micro import MODELS, AsperityModel

every_model = pytest.mark.parametrize("name", MODELS)


@pytest.mark.parametrize("name", ["circular", "elliptic"])
@pytest.mark.parametrize("apart", [1e-9, 1e-13])
def test_two_summits_that_nearly_coincide(name, apart):
    # hard: the interaction matrix is singular to 1e-7 and less; both together carry one's force
    pair = AsperityModel(name, summits([0.5, 0.5 + apart], 0.5), contact_modulus=E_STAR)
    one = pressed(AsperityModel(name, summits(0.5, 0.5), contact_modulus=E_STAR), 0.02)
    found = pressed(pair, 0.02)
    # the gap between the summits changes the force by its square over the radius
    assert found.ellipses.force.sum() == pytest.approx(one.ellipses.force[0], rel=1e-6)
    assert found.residual <= 1e-10 and found.iterations <= 30


@pytest.mark.parametrize("name", ["circular", "elliptic"])
def test_a_twin_a_little_lower_overlaps(name):
    # hard: the lower of two takes none or all of the load, by the last digit of its height
    forces = []
    for lower in (0.0, 1e-12, 1e-9, 1e-6, 1e-3):
        twins = summits([0.5, 0.5 + 1e-9], 0.5, z=[0.0, -lower])
        state = pressed(AsperityModel(name, twins, contact_modulus=E_STAR), 0.02)
        assert state.residual <= 1e-10
        forces.append(state.ellipses.force.sum())
    np.testing.assert_allclose(forces[:3], forces[0], rtol=1e-6)
    assert np.all(np.isfinite(forces))


@every_model
def test_radii_from_a_circle_to_a_line(name):
    # hard: eccentricities 1e-8 to 1 − 1e-12, where differences of elliptic integrals vanish
    ratios = np.array([1.0, 1.0 + 1e-14, 1.0 + 1e-9, 1.0 + 1e-6, 1e2, 1e6])
    forces = []
    for ratio in ratios:
        # the same R = √(R'R'') of 0.1 mm
        one = summits(0.5, 0.5, major=0.1 * np.sqrt(ratio), minor=0.1 / np.sqrt(ratio))
        state = pressed(AsperityModel(name, one, contact_modulus=E_STAR), 1e-3)
        forces.append(float(state.ellipses.force[0]))
    # F1(e) = 1 + O(ε²)
    np.testing.assert_allclose(forces[:4], forces[0], rtol=1e-9)
    if name.startswith("circular"):
        np.testing.assert_allclose(forces, forces[0], rtol=1e-12)
    else:
        # as β = b²/a² → 0, R'/R'' = 1/(β (Λ − 1)) and F1 → π/√2 ((Λ − 1)/β)^(1/4) Λ^(−3/2) with
        # Λ = ln(4/√β); next terms are of order β ln β, 1e-6 here
        beta = brentq(lambda b: 1.0 / (b * (np.log(4 / np.sqrt(b)) - 1.0)) - 1e6, 1e-12, 1e-3)
        log = np.log(4 / np.sqrt(beta))
        factor = np.pi / np.sqrt(2) * ((log - 1.0) / beta) ** 0.25 * log**-1.5
        assert forces[5] / forces[0] == pytest.approx(factor, rel=1e-5)


def test_needles_side_by_side():
    # hard: axes of 1 : 2e4 that interact; as far apart as a hundred widths they are alone
    radii = {"major": 0.1 * 1e3, "minor": 0.1 / 1e3}
    two = summits([0.2, 0.8], 0.5, angle=np.pi / 2, **radii)
    model = AsperityModel("elliptic", two, contact_modulus=E_STAR)
    state = pressed(model, 1e-4)
    alone = pressed(AsperityModel("elliptic-independent", two, contact_modulus=E_STAR), 1e-4)
    assert state.residual <= 1e-10
    assert state.ellipses.force[0] == pytest.approx(state.ellipses.force[1], rel=1e-9)
    assert (
        0.3 < state.ellipses.force.sum() / alone.ellipses.force.sum() < 1.0
    )  # each sinks by the other
