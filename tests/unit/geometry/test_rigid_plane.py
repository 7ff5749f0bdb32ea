"""What a load step may prescribe of the rigid plane, and where the plane is then."""

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Control, PatchGrid, RigidPlane, Surface
from patchlaw.geometry.rigid_plane import PlaneLevers

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
