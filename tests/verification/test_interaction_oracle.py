"""Interacting asperities: brute force, shielding, thousands of them, and nearly coincident ones."""

import numpy as np
import pytest
from helpers.asperity_states import displacement, interference, pressed
from helpers.interaction_cases import E_STAR, oracle, summits
from helpers.truncated_newton import SOLVERS, solve_by
from scipy.optimize import brentq

from patchlaw.geometry import Asperities
from patchlaw.micro import MODELS, AsperityModel, HertzContact

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


def scattered(count, seed=0, depth=2e-3):
    """Asperities at random places, some of them close together; radii of a wide spread."""
    rng = np.random.default_rng(seed)
    minor = 0.3 / count**0.5 * np.exp(rng.normal(0.0, 0.6, count))
    x, y = rng.random((2, count))
    return Asperities(
        x=x,
        y=y,
        z=-rng.exponential(depth, count),
        radius_major=minor * (1.0 + rng.exponential(1.0, count)),
        radius_minor=minor,
        angle=np.pi * rng.random(count),
        lengths=(1.0, 1.0),
        highest=0.0,
        mean_height=-0.02,
    )


@pytest.mark.slow
def test_contact_conditions_of_2500_asperities_above_the_plane():
    many = scattered(2500)
    approach = 2e-3 + float(-many.z.min())  # the undisplaced plane lies below every summit
    model = AsperityModel("elliptic", many, contact_modulus=E_STAR)
    state = pressed(model, approach)
    required, found = interference(many, state), displacement(model, state)
    assert required.min() > 0.0
    on = np.flatnonzero(state.ellipses.force)
    assert 300 < len(on) < 2500
    fields = HertzContact(
        contact_modulus=E_STAR,
        radius_major=many.radius_major[on],
        radius_minor=many.radius_minor[on],
        indentation=state.indentation[on],
    )
    assert state.ellipses.force[on] == pytest.approx(fields.force, rel=1e-12)
    # Far from all contacts that merge with it, a summit is displaced by Hertz's exact fields.
    for k in np.random.default_rng(1).choice(2500, 40, replace=False):
        dx, dy = many.x[k] - many.x[on], many.y[k] - many.y[on]
        cos, sin = np.cos(many.angle[on]), np.sin(many.angle[on])
        moved = fields.displacement(cos * dx + sin * dy, cos * dy - sin * dx)
        if np.any((np.hypot(dx, dy) < 1.3 * fields.semi_major) & (on != k)):
            continue
        assert found[k] == pytest.approx(moved.sum(), rel=1e-11)
        gap = moved.sum() - required[k]
        assert gap >= -1e-9 * approach  # solved to 1e-10
        assert (gap <= 1e-9 * approach) or state.ellipses.force[k] == 0.0


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
