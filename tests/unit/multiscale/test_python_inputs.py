"""What a notebook gives by mistake: numbers of numpy, arrays that change, things of other types."""

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.multiscale import Scene, difference, run

HEIGHTS = 5e-3 * np.random.default_rng(4).random((8, 8))


def sections(**load):
    return {
        "surface": {"heights": HEIGHTS.copy(), "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.2},
        "micro": {"finite_slopes": False},
        "coupling": {"kind": "analytic"},
        "load": {"force": 1.0, "steps": 1} | load,
        "output": {"check": "none", "figures": False, "report": False},
    }


@pytest.mark.parametrize(
    "force", [np.float32(2.0), np.array(2.0), np.int64(2), np.array([1.0, 2.0])]
)
def test_numbers_and_arrays_of_numpy_are_those_of_python(force):
    scene = Scene.from_dict(sections(force=force, steps=np.int64(1)))
    assert scene.loading.steps == 1
    assert scene == Scene.from_dict(sections(force=np.asarray(force, float).tolist()))
    assert scene.with_({"load.force": force}) == scene


def test_a_scene_does_not_change_with_what_it_was_made_of():
    data = sections(force=[1.0, 2.0])
    scene, same = Scene.from_dict(data), Scene.from_dict(sections(force=[1.0, 2.0]))
    data["surface"]["heights"] *= 2.0
    data["load"]["force"].append(3.0)
    assert scene == same
    assert scene.with_({"load.steps": 2}) == same.with_({"load.steps": 2})
    assert run(scene).approach_mm == pytest.approx(run(same).approach_mm, rel=1e-12)


def test_names_of_a_difference_are_two():
    history = run(Scene.from_dict(sections()))
    with pytest.raises(InputError, match="are not the names of two runs"):
        difference(history, history, names=["one"])
