"""What a notebook gives by mistake: numbers of numpy, arrays that change, things of other types."""

import numpy as np
import pytest

from geometry import Friction, InputError, ShearControl, Spectrum, Surface, read_surface, synthesise
from micro import HalfSpaceModel
from multiscale import (
    Scene,
    compare,
    difference,
    make_setup,
    read_contact,
    read_fields,
    read_history,
    representative_law,
    run,
    sweep,
)

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


@pytest.mark.parametrize("other", [None, "scene.toml", {"load": {}}, 3])
@pytest.mark.parametrize("use", [run, compare, make_setup, lambda scene: sweep(scene, {})])
def test_what_is_no_scene_is_refused(use, other):
    with pytest.raises(InputError, match=r"is no scene \(allowed: Scene.load\(path\) or Scene"):
        use(other)


@pytest.mark.parametrize("comm", [4, "world"])
@pytest.mark.parametrize(
    "use", [run, compare, make_setup, lambda scene, comm: sweep(scene, {}, comm)]
)
def test_what_is_no_communicator_is_refused(use, comm):
    with pytest.raises(InputError, match=r"comm = .*: is no communicator"):
        use(Scene.from_dict(sections()), comm)


@pytest.mark.parametrize("path", [None, 3, b"bytes", ["list"]])
@pytest.mark.parametrize(
    "use",
    [Scene.load, read_surface, read_history, read_contact, read_fields,
     lambda path: difference(path, path)],
)  # fmt: skip
def test_what_is_no_path_is_refused(use, path):
    with pytest.raises(InputError, match=r"is no path \(allowed: a text, or a pathlib.Path\)"):
        use(path)


SURFACE = Surface(heights=HEIGHTS, lengths=(1.0, 1.0))
SPECTRUM = {"hurst": 0.8, "waves": (2, 3), "rms_slope": 0.1}
OTHERS = {
    "changes": (lambda: Scene.from_dict(sections()).with_(None), "are no changes"),
    "key": (lambda: Scene.from_dict(sections()).with_({3: 1}), "3: is no key"),
    "vary": (lambda: sweep(Scene.from_dict(sections()), None), "are no values to vary"),
    "one value": (
        lambda: sweep(Scene.from_dict(sections()), {"load.force": 1.0}), "1.0: is no list of values"
    ),
    "text": (
        lambda: sweep(Scene.from_dict(sections()), {"load.force": "1 N"}), "is no list of values"
    ),
    "seed": (lambda: synthesise(Spectrum(**SPECTRUM, seed="a"), grid=(8, 8), lengths=(1, 1)),
             "seed = 'a': must be a number"),
    "friction": (lambda: Friction(coefficient="0.3"), "coefficient = '0.3': must be a number"),
    "shift": (lambda: ShearControl(shift=("a", "b")), "needs two finite numbers"),
    "surface": (lambda: HalfSpaceModel(HEIGHTS, contact_modulus=4e3), "is no surface"),
    "modulus": (lambda: HalfSpaceModel(SURFACE, contact_modulus="4 GPa"), "must be positive"),
    "sample": (lambda: representative_law([HEIGHTS], 4e3, largest_pressure=1.0), "is no surface"),
    "samples": (lambda: representative_law(SURFACE, 4e3, largest_pressure=1.0),
                "is no list of surfaces"),
}  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_other_things_of_a_wrong_type_are_refused_in_words(name):
    use, words = OTHERS[name]
    with pytest.raises(InputError, match=words):
        use()


def test_names_of_a_difference_are_two():
    history = run(Scene.from_dict(sections()))
    with pytest.raises(InputError, match="are not the names of two runs"):
        difference(history, history, names=["one"])
