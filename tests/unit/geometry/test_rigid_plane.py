"""The rigid plane: what a load step prescribes of it, and its equilibrium against statics."""

import numpy as np
import pytest

from patchlaw import InputError, NotConverged
from patchlaw.geometry import Control, PatchGrid, RigidPlane, Surface
from patchlaw.geometry.rigid_plane import PlaneLevers, PlaneResponse, find_equilibrium

SQUARE = Surface(heights=np.zeros((4, 4)), lengths=(1.0, 1.0))


def test_prescribes_approach_or_force_level_unless_told():
    assert Control(approach=1e-3).tilt == (0.0, 0.0)
    assert Control(force=2.0, tilt=None).approach is None


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "either the approach or the force"),
        ({"approach": 1e-3, "force": 1.0}, "exactly one"),
        ({"approach": np.nan}, "approach = nan: must be a finite number"),
        ({"force": -1.0}, "force = -1.0: must be greater than or equal to 0"),
        ({"force": np.inf}, "force = inf: must be a finite number"),
        ({"force": 1.0, "tilt": (0.0, np.inf)}, "tilt .* must be 2 numbers"),
        ({"force": 1.0, "tilt": (9.9e242, 0.0)}, "must be less than or equal to 1"),
    ],
)
def test_refuses_what_is_no_load_step(given, message):
    with pytest.raises(InputError, match=message):
        Control(**given)


def test_free_motions_follow_from_what_is_prescribed():
    assert Control(approach=1.0).free.tolist() == [False, False, False]
    assert Control(approach=1.0, tilt=None).free.tolist() == [False, True, True]
    assert Control(force=1.0, tilt=None).free.tolist() == [True, True, True]
    assert Control(force=0.0, tilt=None).free.tolist() == [False, False, False]
    given = Control(force=1.0, tilt=(0.1, 0.2)).prescribed(np.full(3, 7.0))
    assert given.tolist() == [7.0, 0.1, 0.2]


def test_tilt_turns_about_the_centre():
    x, y = np.array([0.5, 0.9, 0.1]), np.array([0.5, 0.5, 1.0])
    plane = RigidPlane.above(SQUARE, 1e-3, (1e-2, -2e-2))
    assert plane.at(x, y) == pytest.approx([1e-3, 5e-3, -1.3e-2])
    assert PlaneLevers.at(x, y, SQUARE.lengths).matrix @ plane.motion == pytest.approx(
        plane.at(x, y)
    )
    patches = PatchGrid(grid=(2, 1), lengths=SQUARE.lengths)
    assert plane.means(patches) == pytest.approx([1e-3 - 2.5e-3, 1e-3 + 2.5e-3])
    assert RigidPlane.moved(SQUARE, plane.motion) == plane


def test_a_plane_without_a_centre_waits_for_its_face():
    """It turns about the middle of a face that it does not know; level, that does not matter."""
    x, y, force = np.array([0.1, 0.7]), np.array([0.3, 0.2]), np.ones(2)
    level, tilted = (RigidPlane(approach=2e-3, tilt=tilt) for tilt in ((0.0, 0.0), (0.0, 1e-3)))
    assert level.at(x, y) == pytest.approx([2e-3, 2e-3], rel=1e-15)
    for placed in (lambda: tilted.at(x, y), lambda: level.moment(x, y, force)):
        with pytest.raises(InputError, match=r"the middle of its face.*centre = \(xc, yc\)"):
            placed()


class Supports:
    """Supports p = k <w>^n under a plane that moves down and turns; areas of one."""

    def __init__(self, x, y, *, height=0.0, k=1e4, power=1.5):
        self.levers = PlaneLevers.at(x, y, (1.2, 1.6), centre=(0.0, 0.0))  # half a diagonal of 1
        self.height, self.k, self.power = np.asarray(height), k, power

    def forces(self, plane):
        return self.k * np.maximum(self.levers.matrix @ plane - self.height, 0.0) ** self.power

    def __call__(self, plane):
        depth = np.maximum(self.levers.matrix @ plane - self.height, 0.0)
        rate = self.power * self.k * depth ** (self.power - 1.0) * (depth > 0.0)
        forces = self.forces(plane)
        return PlaneResponse(
            loads=self.levers.loads(forces),
            stiffness=lambda: self.levers.stiffness(rate),
            state=forces,
        )

    def equilibrium(self, start=(0.0, 0.0, 0.0), **prescribed):
        control = Control(**({"tilt": None} | prescribed))
        return find_equilibrium(self, control, np.asarray(start), self.levers.half)


TRIANGLE = np.array([[-0.5, 0.1], [0.6, 0.3], [0.2, -0.7]])
# a tripod's forces by Cramer's rule: no law enters
SHARES = np.linalg.solve(np.vstack([np.ones(3), TRIANGLE.T]), [1.0, 0.0, 0.0])


@pytest.mark.parametrize("power", [1.0, 1.5, 3.0])
@pytest.mark.parametrize("force", [1e-2, 1.0, 1e4])
def test_tripod_bears_what_statics_says(force, power):
    height = np.array([0.02, -0.01, 0.003])
    _, found = Supports(*TRIANGLE.T, height=height, power=power).equilibrium(force=force)
    # 1e-13 of the force, or the rounding of depths of 1e-6 mm below heights of 1e-2 mm
    np.testing.assert_allclose(found, force * SHARES, rtol=1e-9)


@pytest.mark.parametrize("start", [-1.0, 0.0, 1e-3, 0.5])
def test_force_is_met_from_anywhere(start):
    supports = Supports([0.3, 0.4], [0.0, 0.1], height=[0.1, 0.2])
    depth, _ = supports.equilibrium((start, 0.0, 0.0), force=2.0, tilt=(0.0, 0.0))
    # the second support is not reached: 1e4 (δ − 0.1)^1.5 = 2, to the rounding of δ
    assert depth[0] == pytest.approx(0.1 + (2e-4) ** (2 / 3), rel=1e-14)


def test_plane_goes_on_to_what_can_hold_it():
    """From one support in contact it turns about that one until a third is met."""
    height = np.array([0.0, 0.3, 0.3])
    _, found = Supports(*TRIANGLE.T, height=height).equilibrium((1e-4, 0.0, 0.0), force=1.0)
    np.testing.assert_allclose(found, SHARES, rtol=1e-9)  # as above


def test_a_single_support_under_the_middle_is_enough():
    motion, _ = Supports([0.0, 0.8], [0.0, 0.8], height=[0.0, 0.5]).equilibrium(force=1.0)
    assert motion[0] == pytest.approx(1e-4 ** (2 / 3), rel=1e-12)  # 1e-13 of the force
    np.testing.assert_allclose(motion[1:], 0.0, atol=1e-15)  # nothing turns it


def test_plane_without_force_turns_clear():
    supports = Supports([0.3, 0.4], [0.1, -0.2])
    start = np.array([5e-3, 0.0, 0.0])
    assert supports.forces(start).sum() > 0.0
    plane, forces = supports.equilibrium(start, approach=5e-3)
    assert plane[0] == 5e-3 and forces.sum() == 0.0


@pytest.mark.parametrize("x", [[0.1, 0.5, 0.4], [0.3, 0.3, 0.3]])
def test_supports_on_one_side_cannot_hold_a_plane(x):
    supports = Supports(x, [-0.5, 0.5, 0.0])
    with pytest.raises(NotConverged, match=r"NO_SUPPORT .*prescribe its tilt"):
        supports.equilibrium(force=1.0)


def test_nothing_to_touch():
    with pytest.raises(NotConverged, match=r"at force 1 N .* NO_CONTACT .*no patch can be touched"):
        Supports([0.0], [0.0], height=np.inf).equilibrium(force=1.0)


def test_loads_without_value_are_a_failure():
    with pytest.raises(NotConverged, match="NOT_A_NUMBER"):
        Supports([0.0], [0.0], height=np.nan).equilibrium(force=1.0)


def refusing(supports, deepest):
    """Return supports that cannot be pressed farther than some depth."""

    def respond(plane):
        if plane[0] > deepest:
            raise NotConverged("a support", reason="TOO_DEEP", iterations=0, remedy="none")
        return supports(plane)

    return respond


def test_refused_depths_shorten_steps_and_starts():
    supports, control = Supports([0.0], [0.0]), Control(force=1.0)
    exact, respond = 1e-4 ** (2 / 3), refusing(supports, 1.01e-4 ** (2 / 3))
    for start in (1e-2 * exact, 10.0 * exact):
        plane, _ = find_equilibrium(
            respond, control, np.array([start, 0.0, 0.0]), 1.0, first_touch=0.0
        )
        assert plane[0] == pytest.approx(exact, rel=1e-12)  # 1e-13 of the force
    with pytest.raises(NotConverged, match="TOO_DEEP"):  # where a refusal is final
        find_equilibrium(respond, control, np.array([10.0 * exact, 0.0, 0.0]), 1.0)
