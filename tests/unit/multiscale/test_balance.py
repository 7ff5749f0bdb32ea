"""Balancing a plane on springs whose loads are known in closed form."""

import numpy as np
import pytest
from scipy.optimize import brentq

from geometry.control import Control
from geometry.errors import NotConverged
from multiscale.couplings.balance import Balance

X = np.array([-0.4, 0.3, 0.1, -0.2, 0.45])
Y = np.array([-0.3, -0.4, 0.35, 0.4, 0.05])
TOUCH = np.array([0.0, 2e-3, 1e-3, 4e-3, 3e-3])
HALF = 0.5 * 2**0.5


class Springs:
    """Hertz contacts at points: P = k w^(3/2)."""

    def __init__(self, x=X, y=Y, touch=TOUCH):
        self.lever = np.column_stack((np.ones(len(x)), x, y))
        self.touch, self.evaluations = np.asarray(touch), 0

    def __call__(self, plane):
        self.evaluations += 1
        forces = 5e3 * np.maximum(self.lever @ plane - self.touch, 0.0) ** 1.5
        return self.lever.T @ forces, forces


def balance():
    return Balance(half=HALF, first_touch=0.0)


def test_prescribed_plane_is_solved_once():
    springs = Springs()
    plane, forces = balance().solve(springs, Control(approach=5e-3, tilt=(1e-3, 2e-3)))
    np.testing.assert_array_equal(plane, [5e-3, 1e-3, 2e-3])
    np.testing.assert_array_equal(forces, Springs()(plane)[1])
    assert springs.evaluations == 1


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (3e-3, -4e-3)])
@pytest.mark.parametrize("force", [1e-6, 0.5, 30.0])
def test_force_is_met(force, tilt):
    springs = Springs()
    plane, forces = balance().solve(springs, Control(force=force, tilt=tilt))
    assert forces.sum() == pytest.approx(force, rel=1.1e-8)  # the balance's tolerance
    exact = brentq(lambda d: Springs()(np.array([d, *tilt]))[0][0] - force, -1.0, 1.0, xtol=1e-18)
    # the force's tolerance, as the force grows with the approach at least as fast as it
    assert plane[0] == pytest.approx(exact, rel=1e-7, abs=1e-9)


def test_no_force_is_first_touch():
    plane, forces = balance().solve(Springs(), Control(force=0.0, tilt=(1e-3, 0.0)))
    # the highest spring's touch less what the plane leans there
    assert plane[0] == pytest.approx(0.4e-3, rel=1e-9)
    assert forces.sum() < 1e-12  # 5e3 of the rounding 1e-12 mm to the power 3/2


@pytest.mark.parametrize("given", [{"approach": 4e-3}, {"force": 2.0}, {"force": 1e-5}])
def test_free_plane_has_no_moment(given):
    springs = Springs()
    plane, forces = balance().solve(springs, Control(**given, tilt=None))
    load = springs.lever.T @ forces
    assert np.abs(load[1:]).max() <= 1e-8 * load[0]  # the balance's tolerance
    if "force" in given:
        assert load[0] == pytest.approx(given["force"], rel=1.1e-8)
    else:
        assert plane[0] == given["approach"]


def test_following_a_load_is_cheap():
    springs, balanced = Springs(), balance()
    for force in np.linspace(0.2, 4.0, 20):
        balanced.solve(springs, Control(force=force))
    assert springs.evaluations < 20 * 8
    springs.evaluations = 0
    for force in np.linspace(4.0, 0.2, 20):
        balanced.solve(springs, Control(force=force, tilt=None))
    assert springs.evaluations < 20 * 15


@pytest.mark.parametrize("tilt", [(1e-2, 0.0), (2e-2, -1e-2)])
def test_the_way_does_not_depend_on_where_the_approach_counts_from(tilt):
    """The plane touches beside the middle, above which it has not come to first touch."""
    found = []
    for origin in (0.0, 3e-3, -3e-3):
        springs = Springs(touch=TOUCH + origin)
        balanced = Balance(half=HALF, first_touch=origin)
        plane, _ = balanced.solve(springs, Control(force=1e-2, tilt=tilt))
        assert plane[0] < origin
        springs.evaluations = 0
        plane, _ = balanced.solve(springs, Control(force=1.1e-2, tilt=None))
        found.append((springs.evaluations, plane[0] - origin))
    for count, approach in found:
        assert count <= 60 and abs(count - found[0][0]) <= 3  # rounding may cost a step
        assert approach == pytest.approx(found[0][1], rel=1e-6)  # force and moments to 1e-8


@pytest.mark.parametrize("seed", [5, 120, 133])
def test_springs_all_on_one_side_are_refused(seed):
    """Nothing holds the plane, which turns until its stiffness is singular."""
    random = np.random.default_rng(seed)
    x, y = random.uniform(0.05, 0.5, 5), random.uniform(-0.5, 0.5, 5)
    springs, balanced = Springs(x, y, random.uniform(0.0, 5e-3, 5)), balance()
    balanced.solve(springs, Control(force=1e-2, tilt=(-1e-2, 0.0)))
    with pytest.raises(NotConverged, match="NO_BALANCE"):
        balanced.solve(springs, Control(force=1e-2, tilt=None))


def test_symmetric_springs_stay_level():
    springs = Springs([-0.3, 0.3, -0.3, 0.3], [-0.2, -0.2, 0.2, 0.2], np.zeros(4))
    plane, _ = balance().solve(springs, Control(force=1.0, tilt=None))
    np.testing.assert_allclose(plane[1:], 0.0, atol=1e-12)  # rounding of moments


def test_force_that_nothing_bears_is_refused():
    with pytest.raises(NotConverged, match=r"balance of the plane at force .* NO_CONTACT"):
        balance().solve(Springs(touch=np.full(5, np.inf)), Control(force=1.0))


def test_plane_on_one_spring_beside_the_middle_is_refused():
    springs = Springs(X[:1], Y[:1], TOUCH[:1])
    with pytest.raises(NotConverged, match="NO_BALANCE"):
        balance().solve(springs, Control(force=1.0, tilt=None))
