"""Elements of high order along a line: what their shapes span, and integrals in closed form."""

import numpy as np
import pytest

from geometry.legendre_modes import mode_values
from macro.compliance.elements import Line, mode_integrals

LINES = {
    "any": Line(ticks=(-1.0, -0.3, 0.0), degrees=(3, 5)),
    "even": Line(ticks=(0.5, 0.8, 1.0), degrees=(6, 4), parity=0),
    "odd": Line(ticks=(0.5, 1.0), degrees=(7,), parity=1),
}


@pytest.mark.parametrize("kind", LINES)
def test_slopes_are_those_of_the_values(kind):
    line = LINES[kind]
    rule = line.sampled(8)
    # by integration by parts against x and x²: ∫ N' f + ∫ N f' = [N f]
    start = {"even": None, "odd": 0.0, "any": 0.0}[kind]
    ends = np.zeros(len(rule.values))
    ends[line.end] = 1.0
    for power in (1, 2):
        x, rise = rule.points**power, power * rule.points ** (power - 1)
        found = (rule.slopes * x + rule.values * rise) @ rule.weights
        if start is not None:  # functions vanish at the start
            np.testing.assert_allclose(found, ends * line.ticks[-1] ** power, atol=1e-14)
    assert rule.weights.sum() == pytest.approx(line.ticks[-1] - line.ticks[0], rel=1e-15)


@pytest.mark.parametrize(("kind", "power"), [("even", 0), ("even", 4), ("odd", 1), ("odd", 7)])
def test_polynomials_of_the_parity_are_spanned(kind, power):
    line = LINES[kind]
    rule = line.sampled(9)
    wanted = (rule.points - line.ticks[0]) ** power
    share, *_ = np.linalg.lstsq(rule.values.T, wanted, rcond=None)
    np.testing.assert_allclose(share @ rule.values, wanted, atol=1e-14)
    risen = power * (rule.points - line.ticks[0]) ** max(power - 1, 0)
    np.testing.assert_allclose(share @ rule.slopes, risen, atol=1e-12)


@pytest.mark.parametrize("parity", [0, 1])
def test_mode_integrals_are_exact(parity):
    line = Line(ticks=(0.6, 1.2), degrees=(9,), parity=parity)
    rule = line.sampled(40)
    modes = mode_values(rule.points, 1.2, 7)[parity::2]
    np.testing.assert_allclose(
        mode_integrals(line, 1.2, 7), (modes * rule.weights) @ rule.values.T, atol=1e-14
    )
