"""The rigid plane: approach, tilt, required displacements."""

import numpy as np
import pytest

from geometry import InputError
from micro.plane import RigidPlane


def test_level_plane(summits):
    three = summits([0.2, 0.4, 0.9], 0.5, z=[0.0, -1e-3, -5e-3], highest=1e-3)
    plane = RigidPlane.above(three, 3e-3, (0.0, 0.0))
    assert plane.required(three) == pytest.approx([2e-3, 1e-3, 0.0])


def test_tilt_turns_about_the_centre(summits):
    three = summits([0.5, 0.9, 0.1], [0.5, 0.5, 1.0], z=0.0)
    plane = RigidPlane.above(three, 1e-3, (1e-2, -2e-2))
    assert plane.required(three) == pytest.approx([1e-3, 5e-3, 0.0])  # 1 − 4 − 10 µm is open
    assert plane.at(three.x, three.y)[2] == pytest.approx(-1.3e-2)


@pytest.mark.parametrize(
    ("approach", "tilt", "problem"),
    [
        (np.nan, (0.0, 0.0), "nan: the approach must be finite"),
        (1.0, (0.0, np.inf), "the tilt must be two finite slopes"),
        (1.0, (0.0,), "the tilt must be two finite slopes"),
    ],
)
def test_refuses(summits, approach, tilt, problem):
    with pytest.raises(InputError, match=problem):
        RigidPlane.above(summits(0.5, 0.5), approach, tilt)
