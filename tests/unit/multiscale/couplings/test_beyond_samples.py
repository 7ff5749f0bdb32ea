"""A face that is pressed beyond the rows of its law says so, and which key helps."""

import pytest

from geometry import NotConverged
from multiscale import Scene, run

SCENE = {
    "surface": {
        "spectrum": {"hurst": 0.8, "waves": [2, 5], "rms_slope": 0.1, "seed": 1},
        "grid": [16, 16],
        "lengths": ["1 mm", "1 mm"],
    },
    "block": {
        "young_modulus": "4 GPa",
        "poisson_ratio": 0.3,
        "height": "10 mm",
        "lengths": ["10 mm", "10 mm"],
        "cells": [4, 4, 3],
    },
    "law": {"kind": "representative", "seeds": [1, 2]},
    "load": {"force": "2 kN", "steps": 1},
}


def test_a_larger_pressure_is_asked_for():
    scene = Scene.from_dict(SCENE)
    with pytest.raises(NotConverged, match="closure beyond the end of the patch law") as caught:
        run(scene.with_({"law.largest_pressure": "5 MPa"}))
    assert "law.largest_pressure" in str(caught.value)
    (step,) = run(scene)
    assert step.force_N == pytest.approx(2000.0, rel=1e-9)
    assert step.newton_iterations <= 4  # from a uniform pressure; from zero it would be ten
