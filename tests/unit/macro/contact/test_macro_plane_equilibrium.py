"""The settled plane against statics: supports of which the loads are known without the laws."""

import numpy as np
import pytest

from geometry.errors import NotConverged
from macro.contact.plane_equilibrium import Excess, settle, touch


class Supports:
    """Supports p = k <w>^n under a plane that moves down and turns; areas of one."""

    half = 1.0

    def __init__(self, x, y, *, force=None, height=0.0, k=1e4, power=1.5, moves=True, turns=True):
        levers = np.column_stack((np.ones(len(x)), x, y))
        self.free = np.array([moves, turns, turns])
        self.lever, self.levers = levers, levers[:, self.free]
        self.rest, self.force, self.k, self.power = -np.asarray(height), force, k, power

    def loads(self, motion):
        return self.k * np.maximum(self.rest + self.levers @ motion, 0.0) ** self.power

    def excess(self, motion):
        total = self.lever.T @ self.loads(motion)
        wanted = np.array([self.force or 0.0, 0.0, 0.0])
        return Excess((total - wanted)[self.free], total[0], self.force or total[0])

    def stiffness(self, motion):
        depth = np.maximum(self.rest + self.levers @ motion, 0.0)
        rate = self.power * self.k * depth ** (self.power - 1.0) * (depth > 0.0)
        return self.levers.T @ (rate[:, None] * self.levers)

    def reach(self, motion):
        return float(np.abs(motion).sum() + np.abs(self.rest).max())


TRIANGLE = np.array([[-0.5, 0.1], [0.6, 0.3], [0.2, -0.7]])
# a tripod's forces by Cramer's rule: no law enters
SHARES = np.linalg.solve(np.vstack([np.ones(3), TRIANGLE.T]), [1.0, 0.0, 0.0])


@pytest.mark.parametrize("power", [1.0, 1.5, 3.0])
@pytest.mark.parametrize("force", [1e-2, 1.0, 1e4])
def test_tripod_bears_what_statics_says(force, power):
    height = np.array([0.02, -0.01, 0.003])
    supports = Supports(*TRIANGLE.T, force=force, height=height, power=power)
    found = supports.loads(settle(supports, np.zeros(3)))
    # 1e-13 of the force, or the rounding of depths of 1e-6 mm below heights of 1e-2 mm
    np.testing.assert_allclose(found, force * SHARES, rtol=1e-9)


@pytest.mark.parametrize("start", [-1.0, 0.0, 1e-3, 0.5])
def test_force_is_met_from_anywhere(start):
    supports = Supports([0.3, 0.4], [0.0, 0.1], force=2.0, height=[0.1, 0.2], turns=False)
    depth = settle(supports, np.array([start]))
    # the second support is not reached: 1e4 (δ − 0.1)^1.5 = 2, to the rounding of δ
    assert depth[0] == pytest.approx(0.1 + (2e-4) ** (2 / 3), rel=1e-14)


def test_plane_goes_on_to_what_can_hold_it():
    """From one support in contact it turns about that one until a third is met."""
    height = np.array([0.0, 0.3, 0.3])
    supports = Supports(*TRIANGLE.T, force=1.0, height=height)
    found = supports.loads(settle(supports, np.array([1e-4, 0.0, 0.0])))
    np.testing.assert_allclose(found, SHARES, rtol=1e-9)  # as above


def test_a_single_support_under_the_middle_is_enough():
    supports = Supports([0.0, 0.8], [0.0, 0.8], force=1.0, height=[0.0, 0.5])
    motion = settle(supports, np.zeros(3))
    assert motion[0] == pytest.approx(1e-4 ** (2 / 3), rel=1e-12)  # 1e-13 of the force
    np.testing.assert_allclose(motion[1:], 0.0, atol=1e-15)  # nothing turns it


def test_plane_without_force_turns_clear():
    supports = Supports([0.3, 0.4], [0.1, -0.2], height=-5e-3, moves=False)
    assert supports.excess(np.zeros(2)).force > 0.0
    assert supports.excess(settle(supports, np.zeros(2))).force == 0.0


@pytest.mark.parametrize("x", [[0.1, 0.5, 0.4], [0.3, 0.3, 0.3]])
def test_supports_on_one_side_cannot_hold_a_plane(x):
    supports = Supports(x, [-0.5, 0.5, 0.0], force=1.0)
    with pytest.raises(NotConverged, match=r"NO_SUPPORT .*prescribe its tilt"):
        settle(supports, np.zeros(3))


def test_nothing_to_touch():
    supports = Supports([0.0], [0.0], force=1.0, height=np.inf)
    with pytest.raises(NotConverged, match=r"NO_CONTACT .*no patch can be touched"):
        settle(supports, np.zeros(3))
    with pytest.raises(NotConverged, match="NO_CONTACT"):
        touch(lambda _approach: False, 1.0)


def test_loads_without_value_are_a_failure():
    supports = Supports([0.0], [0.0], force=1.0, height=np.nan)
    with pytest.raises(NotConverged, match="NOT_A_NUMBER"):
        settle(supports, np.zeros(3))


@pytest.mark.parametrize("at", [-3.0, -1e-9, 0.0, 1e-12, 0.25, 40.0])
def test_touch_is_found_to_rounding(at):
    assert touch(lambda approach: approach > at, 1.0) == pytest.approx(at, rel=1e-15, abs=1e-300)
