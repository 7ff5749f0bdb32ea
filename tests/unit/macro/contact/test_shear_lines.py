"""Sliders as lines: where a sample reaches its curve along the stiffness of the body."""

import numpy as np
import pytest
from helpers.contact_laws import RangedLaw
from scipy.optimize import root

from patchlaw.geometry.sliders import Sliders
from patchlaw.geometry.spring_bed import springs_of_law
from patchlaw.macro.contact.face_sliders import shear_lines


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
