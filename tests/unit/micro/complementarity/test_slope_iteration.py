"""Anderson's mixing on contractions."""

import numpy as np
import pytest

from patchlaw.micro.complementarity.slope_iteration import AndersonMixing


def errors(contraction, target, steps):
    """Return the distances from the fixed point of x → A (x − x*) + x*."""
    known, point, found = AndersonMixing(), np.zeros_like(target), []
    for _ in range(steps):
        residual = (contraction @ (point - target).ravel()).reshape(target.shape) + target - point
        point = known.next(point, -point, point + residual, np.ones(point.shape, bool))
        found.append(np.linalg.norm(point - target) / np.linalg.norm(target))
    return found


@pytest.mark.parametrize("rate", [0.9, -0.9, 0.01, 3.0])
def test_a_line_takes_a_step_and_a_secant(rate):
    first, second = errors(np.array([[rate]]), np.array([4.0]), 2)
    assert first == pytest.approx(abs(rate))
    assert second < 1e-12


@pytest.mark.parametrize("rates", [(0.9, -0.3), (0.5, -0.4), (0.7, 0.1)])
def test_a_plane_takes_four_steps(rates):
    """As many as GMRES, which the mixing is equal to, and one to begin with."""
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((2, 2)))[0]
    found = errors(turn @ np.diag(rates) @ turn.T, np.array([1.0, -2.0]), 4)
    assert found[-1] < 1e-12
    assert found[0] > 0.05


def test_many_unknowns_converge_faster_than_plain_steps():
    dice = np.random.default_rng(3)
    turn = np.linalg.qr(dice.standard_normal((30, 30)))[0]
    rates = 0.1 * dice.uniform(-1.0, 1.0, 30)
    contraction, target = turn @ np.diag(rates) @ turn.T, dice.standard_normal((5, 6))
    plain = np.linalg.matrix_power(contraction, 8) @ target.ravel()
    assert errors(contraction, target, 8)[-1] < 0.1 * np.linalg.norm(plain) / np.linalg.norm(target)


def test_stays_at_the_fixed_point():
    known, point = AndersonMixing(), np.ones(3)
    for _ in range(3):
        point = known.next(point, -point, point, np.ones(3, bool))
    assert point.tolist() == [1.0, 1.0, 1.0]
