"""The plan says what was taken by default: micro model, proportions of the block."""

import pytest

from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale import Scene, make_setup, run
from patchlaw.support.readable import Caution


def setup_of(lengths=(1.0, 1.0), kind="concurrent", **block):
    """Return the setup of a scene that states as little as it can."""
    size = min(lengths)
    return make_setup(Scene.from_dict({
        "surface": {
            "spectrum": {"hurst": 0.8, "waves": [2, 6], "rms_height": f"{size} um"},
            "grid": [48, 48], "lengths": [f"{side} mm" for side in lengths],
        },
        "block": {"young_modulus": "4 GPa", "poisson_ratio": 0.3} | block,
        "coupling": {"kind": kind}, "load": {"approach": f"{size} um"},
    }))  # fmt: skip


def test_the_micro_model_is_half_space_when_not_given():
    setup = setup_of()
    assert isinstance(setup.parts.micro, HalfSpaceModel)
    assert dict(setup.about.statements())["micro model"] == "half-space"


@pytest.mark.parametrize("size", [0.02, 0.1, 5.0, 50.0])
def test_the_block_of_a_map_of_any_size_is_a_cube_and_needs_no_note(size):
    setup = setup_of((size, size))
    side = f"{1e3 * size:g} µm" if size < 1.0 else f"{size:g} mm"
    assert f"{side} × {side} and {side} high" in dict(setup.about.statements())["block"]
    assert not list(setup.about.warnings())


@pytest.mark.parametrize(("lengths", "block", "note"), [
    ((0.02, 0.02), {"height": "1 mm"}, "1 mm high and 0.02 mm wide, a ratio of 50: most of"),
    ((4.0, 5.0), {"height": "1 mm"}, "1 mm high and 4 mm wide, a ratio of 4: the fixed bottom"),
    ((5.0, 1.0), {}, "5 × 1 mm wide, a ratio of 5: are these the lengths along x and y"),
])  # fmt: skip
def test_a_block_beyond_three_to_one_is_noted(lengths, block, note):
    (said,) = setup_of(lengths, **block).about.warnings()
    assert note in said


@pytest.mark.parametrize(
    ("load", "said"),
    [
        ({"approach": "15 um"}, None),
        ({"approach": "0.3 mm"}, "an approach of 300 µm strains the body by at least 30 %"),
        ({"force": "60 N"}, None),
        ({"force": ["60 N", "100 N"]}, "a mean pressure of 100 MPa strains the body by about"),
        ({"pressure": "1 GPa"}, "a mean pressure of 1 GPa strains the body by about 25 %"),
    ],
)
def test_loads_beyond_small_strains_are_cautioned_of(load, said):
    """On a cube of 1 mm and 4 GPa; a caution is printed with the plan, quietly, and reported."""
    about = make_setup(setup_of().parts.scene.with_({"load": load})).about
    noted = [note for note in (*about.warnings(), *about.notes([])) if isinstance(note, Caution)]
    assert len(noted) == (0 if said is None else 2) and len(set(noted)) < 2
    assert said is None or noted[0].startswith(said)


def test_the_body_that_strains_is_named():
    """The softer one, on a cube of 4 GPa opposite a softer and a stiffer half-space."""
    for young, name in (("1 GPa", "the counter-body"), ("50 GPa", "the body")):
        counter = {"young_modulus": young, "poisson_ratio": 0.4}
        scene = setup_of().parts.scene.with_({"counter_body": counter, "load": {"force": "150 N"}})
        (said,) = (one for one in make_setup(scene).about.warnings() if isinstance(one, Caution))
        assert f"of 150 MPa strains {name} by about" in said


def test_the_force_of_an_approach_tells_how_it_strains_a_half_space():
    """What an approach does to a half-space is not known before it was pressed."""
    scene = setup_of(kind="analytic").parts.scene
    for approach, count in (("3 um", 0), ("100 um", 1)):
        scene = scene.with_({"load.approach": approach})
        assert not list(make_setup(scene).about.warnings())
        history = run(scene)
        assert (history.mean_pressure_MPa.max() > 0.02 * 4000.0) == count
        said = [note for note in history.notes if isinstance(note, Caution)]
        assert len(said) == count and all("strains the body" in note for note in said)
