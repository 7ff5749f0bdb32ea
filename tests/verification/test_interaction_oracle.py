"""Few interacting asperities against independence, brute force and by shielding."""

import numpy as np
import pytest
from helpers.asperity_states import displacement, interference, pressed
from helpers.interaction_cases import E_STAR, oracle, summits
from helpers.truncated_newton import SOLVERS, solve_by

from patchlaw.micro import AsperityModel

CASES = {
    "equal spheres": (summits([0.47, 0.53], 0.5, major=0.1), 4e-3, [0, 1]),
    "unequal spheres": (summits([0.46, 0.53], 0.5, z=[-1e-3, 0], major=[0.05, 0.2]), 4e-3, [0, 1]),
    "ellipsoids across": (
        summits([0.45, 0.55], [0.5, 0.52], major=[0.3, 0.2], minor=0.05, angle=[1.2, 0.3]),
        5e-3,
        [0, 1],
    ),
    "three, one shielded": (
        summits([0.45, 0.5, 0.55], 0.5, z=[0, -2.5e-3, 0], major=[0.2, 0.05, 0.1], minor=0.05),
        3e-3,
        [0, 2],
    ),
    "five": (
        summits(
            [0.4, 0.5, 0.6, 0.45, 0.6],
            [0.4, 0.5, 0.42, 0.62, 0.6],
            z=[0, -1e-3, -5e-4, 0, -1.5e-3],
            major=[0.2, 0.05, 0.1, 0.3, 0.08],
            minor=0.05,
            angle=[0, 1, 2, 3, 0.5],
        ),
        4e-3,
        [0, 1, 2, 3, 4],
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("case", CASES)
def test_against_brute_force(case, solver, monkeypatch):
    solve_by(solver, monkeypatch)
    asperities, approach, contacting = CASES[case]
    force, moved = oracle(asperities, approach, contacting)
    model = AsperityModel("elliptic", asperities, contact_modulus=E_STAR)
    state = pressed(model, approach)
    assert np.flatnonzero(state.ellipses.force).tolist() == contacting
    assert state.overlapping_contacts == 0  # the oracle has the exact kernel
    # The oracle's quadratures are good to 1e-10 at these distances, the solver stops at 1e-10.
    assert state.ellipses.force == pytest.approx(E_STAR * force, rel=1e-7, abs=1e-12)
    assert displacement(model, state) == pytest.approx(moved, rel=1e-8)


def test_shielded_summit_is_in_the_inequality():
    asperities, approach, _ = CASES["three, one shielded"]
    model = AsperityModel("elliptic", asperities, contact_modulus=E_STAR)
    state = pressed(model, approach)
    required = interference(asperities, state)[1]
    assert required == pytest.approx(5e-4)  # it would touch if it were alone
    assert displacement(model, state)[1] > 1.5 * required  # the others push it further
    assert state.ellipses.force[1] == 0.0
    alone = AsperityModel("elliptic-independent", asperities, contact_modulus=E_STAR)
    assert pressed(alone, approach).ellipses.force[1] > 0.0


@pytest.mark.parametrize("name", ["elliptic", "circular"])
def test_far_apart_is_independent(name):
    # The other's displacement is P/(π E* r), 4/(3π) sqrt(R w)/r of the own one.
    for radius in (1e-6, 1e-8):
        pair = summits([0.1, 0.9], 0.5, major=2 * radius, minor=radius)
        approach = 0.01 * radius
        state = pressed(AsperityModel(name, pair, contact_modulus=E_STAR), approach)
        alone = pressed(
            AsperityModel(f"{name}-independent", pair, contact_modulus=E_STAR), approach
        )
        lost = 1 - state.ellipses.force / alone.ellipses.force
        expected = 1.5 * alone.ellipses.force / (np.pi * E_STAR * 0.8 * approach)
        assert lost == pytest.approx(expected, rel=1e-3)  # next order: the loss itself, 1e-7
        assert np.all(lost < 0.2 * radius)
