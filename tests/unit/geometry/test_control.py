"""What a load step may prescribe."""

import numpy as np
import pytest

from geometry import Control, InputError


def test_prescribes_approach_or_force_level_unless_told():
    assert Control(approach=1e-3).tilt == (0.0, 0.0)
    assert Control(force=2.0, tilt=None).approach is None


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "either the approach or the force"),
        ({"approach": 1e-3, "force": 1.0}, "exactly one"),
        ({"approach": np.nan}, "approach must be finite"),
        ({"force": -1.0}, "must not be negative"),
        ({"force": np.inf}, "must not be negative"),
        ({"force": 1.0, "tilt": (0.0, np.inf)}, "two finite slopes"),
    ],
)
def test_refuses_what_is_no_load_step(given, message):
    with pytest.raises(InputError, match=message):
        Control(**given)
