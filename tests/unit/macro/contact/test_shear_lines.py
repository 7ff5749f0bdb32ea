"""Sliders as lines: where a sample reaches its curve along the stiffness of the body."""

import numpy as np
import pytest
from helpers.contact_laws import RangedLaw
from scipy.optimize import brentq, root

from patchlaw.geometry import Control, ShearControl
from patchlaw.geometry.sliders import SliderResponse, Sliders
from patchlaw.geometry.spring_bed import springs_of_law
from patchlaw.macro.contact.face_sliders import find_shift, shear_lines


def test_lines_touch_the_sliders_where_the_bodys_stiffness_leads():
    n, along, law = 30, 60.0, RangedLaw(4e6, power=2.0, end=2e-3)
    rng = np.random.default_rng(5)
    sliders = Sliders([springs_of_law(law)], np.array([1.2]), np.zeros(n, int), 0.3)
    closure = rng.uniform(2e-4, 2e-3, n)
    pressure, rate = law.pressure(closure), law.stiffness(closure)
    before = sliders.at_rest

    def respond(slip, *, sticks=False, rows=slice(None)):
        at = closure[rows], slip, pressure[rows], rate[rows]
        return sliders.respond(before, *at, sticks=sticks, rows=np.arange(n)[rows])

    slip = rng.normal(0.0, 2e-3, (n, 2))  # far beyond full slip at most samples
    stress = rng.normal(0.0, 3.0, (n, 2))
    lines = shear_lines(respond, slip, closure, stress, along)

    def left(at):
        found = respond(at.reshape(n, 2)).stress
        return (found - stress).ravel() + along * (at - slip.ravel())

    exact = root(left, np.zeros(2 * n), method="df-sane", options={"maxfev": 20000}).x.reshape(n, 2)
    assert np.abs(left(exact.ravel())).max() < 1e-6
    there = respond(exact)
    expected = there.stress + np.einsum("nij,nj->ni", there.by_slip, slip - exact)
    # Newton's steps end at 1e-4 of the largest stress; what lines change from there is more
    close = 1e-3 * np.abs(there.stress).max()
    np.testing.assert_allclose(lines.at(slip, closure), expected, atol=close)
    slipped = np.hypot(*there.stress.T) > 0.999 * 0.3 * pressure
    assert 0 < slipped.sum() < n
    assert lines.response.stress == pytest.approx(there.stress, abs=close)


def test_the_plane_is_found_where_the_body_has_moved_far():
    """A body that spreads moves samples by thousands of the ways over which they stick."""
    n, bound, stiffness = 400, 3.0, 2e4
    moved = np.random.default_rng(4).uniform(-0.2, 1.0, n)
    force = -0.6 * bound * n

    def stress(shift):
        return np.clip(stiffness * (shift - moved), -bound, bound)

    def respond(shift):
        sticks = np.abs(stress(shift[0])) < bound
        by_slip = stiffness * sticks[:, None, None] * np.eye(2)
        found = np.column_stack([stress(shift[0]), np.zeros(n)])
        known = dict.fromkeys(SliderResponse._fields) | {"stress": found, "by_slip": by_slip}
        return SliderResponse(**known | {"sticking": np.full(n, stiffness)})

    control = Control(force=1.0, shear=ShearControl(force=(force, 0.0)))
    shift, found = find_shift(
        respond, lambda values: values.sum(axis=0), np.ones(2), control, bound * n
    )
    exact = brentq(lambda at: stress(at).sum() - force, -1.0, 1.0, xtol=1e-15)
    assert shift[0] == pytest.approx(exact, abs=1e-9)
    assert found.stress.sum(axis=0) == pytest.approx([force, 0.0], abs=1e-6)


def test_samples_reach_their_curves_from_stresses_that_earlier_steps_left():
    """After unloading, whole steps go from slip to slip the other way on springs this stiff."""
    n, along, law = 300, 60.0, RangedLaw(4e7, power=2.0, end=4e-3)
    rng = np.random.default_rng(7)
    sliders = Sliders([springs_of_law(law)], np.array([1.2]), np.zeros(n, int), 0.3)

    def at(closure, before, slip):
        return sliders.respond(before, closure, slip, law.pressure(closure), law.stiffness(closure))

    high, low = rng.uniform(2e-3, 4e-3, n), rng.uniform(2e-4, 2e-3, n)
    pressed = at(high, sliders.at_rest, rng.normal(0.0, 1e-3, (n, 2)))
    before = sliders.step(sliders.at_rest, pressed).after

    def respond(slip, *, sticks=False, rows=slice(None)):
        here = low[rows], slip, law.pressure(low[rows]), law.stiffness(low[rows])
        return sliders.respond(before, *here, sticks=sticks, rows=np.arange(n)[rows])

    slip, stress = rng.normal(0.0, 0.1, (n, 2)), rng.normal(0.0, 3.0, (n, 2))
    lines = shear_lines(respond, slip, low, stress, along)
    left = lines.stress - stress + along * (lines.slip - slip)
    assert np.abs(left).max() < 1e-3 * np.abs(lines.stress).max()
