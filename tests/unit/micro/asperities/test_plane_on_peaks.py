"""A plane in equilibrium on springs whose loads are known in closed form."""

import numpy as np
import pytest
from scipy.optimize import brentq

from patchlaw.geometry import Control, RigidPlane
from patchlaw.geometry.rigid_plane import PlaneLevers, PlaneResponse
from patchlaw.micro.asperities.model import Peaks

X = np.array([-0.4, 0.3, 0.1, -0.2, 0.45])
Y = np.array([-0.3, -0.4, 0.35, 0.4, 0.05])
TOUCH = np.array([0.0, 2e-3, 1e-3, 4e-3, 3e-3])
HALF = 0.5 * 2**0.5
LAW = 5e3


class Springs:
    """Hertz contacts at points: P = k w^(3/2)."""

    def __init__(self, x=X, y=Y, touch=TOUCH):
        self.lever = np.column_stack((np.ones(len(x)), x, y))
        self.touch, self.evaluations = np.asarray(touch), 0

    def forces(self, plane):
        return LAW * np.maximum(self.lever @ plane - self.touch, 0.0) ** 1.5

    def __call__(self, plane):
        self.evaluations += 1
        forces, w = self.forces(plane), np.maximum(self.lever @ plane - self.touch, 0.0)
        rates = 1.5 * LAW * np.sqrt(w)
        return PlaneResponse(
            loads=self.lever.T @ forces,
            stiffness=lambda: self.lever.T @ (rates[:, None] * self.lever),
            state=forces,
        )

    def balance(self, control, near=None):
        modes = PlaneLevers(matrix=self.lever, half=HALF)
        peaks = Peaks(modes=modes, depth=self.touch, force=np.full(len(self.touch), LAW))
        return peaks.equilibrium(self, control, near)


def rigid(plane):
    return RigidPlane(approach=plane[0], tilt=(plane[1], plane[2]), centre=(0.0, 0.0))


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (3e-3, -4e-3)])
@pytest.mark.parametrize("force", [1e-6, 0.5, 30.0])
def test_force_is_met(force, tilt):
    plane, forces = Springs().balance(Control(force=force, tilt=tilt))
    assert forces.sum() == pytest.approx(force, rel=1e-8)
    exact = brentq(
        lambda d: Springs().forces(np.array([d, *tilt])).sum() - force, -1.0, 1.0, xtol=1e-18
    )
    # the force's tolerance, as the force grows with the approach at least as fast as it
    assert plane[0] == pytest.approx(exact, rel=1e-8, abs=1e-10)


@pytest.mark.parametrize("near", [None, (-0.02, 1e-3, 0.0), (0.02, 1e-3, 0.0)])
def test_no_force_is_first_touch_from_any_plane(near):
    """A plane before that stood far above all contacts is no measure of depth either."""
    near = near and rigid(near)
    plane, forces = Springs().balance(Control(force=0.0, tilt=(1e-3, 0.0)), near)
    # the highest spring's touch less what the plane leans there
    assert plane[0] == pytest.approx(0.4e-3, rel=1e-12)
    assert forces.sum() < 1e-20  # 5e3 of the rounding 1e-18 mm to the power 3/2


def test_hardly_loaded_plane_rests_on_three_points():
    """The least force leaves the plane where it has come nearest without penetrating anything."""
    plane, forces = Springs().balance(Control(force=1e-9, tilt=None))
    on = np.flatnonzero(forces)
    assert len(on) == 3
    resting = np.linalg.solve(Springs().lever[on], TOUCH[on])
    assert np.all(Springs().lever @ resting <= TOUCH + 1e-15)
    # a depth of (1e-9/5e3)^(2/3) mm, 3e-9 mm at each
    assert plane == pytest.approx(resting, abs=1e-7)


def test_following_a_load_is_cheap():
    springs, near = Springs(), None
    for force in np.linspace(0.2, 4.0, 20):
        near = rigid(springs.balance(Control(force=force), near)[0])
    assert springs.evaluations <= 20 * 6
    springs.evaluations = 0
    for force in np.linspace(4.0, 0.2, 20):
        near = rigid(springs.balance(Control(force=force, tilt=None), near)[0])
    assert springs.evaluations <= 20 * 8
