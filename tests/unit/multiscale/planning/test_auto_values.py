"""The choice of a micro model in a scene: what is requested, stated, refused and recorded."""

from __future__ import annotations

import pytest

from geometry.errors import InputError
from micro import choose
from multiscale.output.provenance import provenance
from multiscale.planning.plan import statements, warnings
from multiscale.planning.problem_setup import make_setup
from multiscale.run import Run
from multiscale.scene.scene import Scene


def scene(load=None, coupling="analytic", waves=(2, 6), **micro):
    spectrum = {"hurst": 0.8, "waves": list(waves), "rms_slope": 0.2, "seed": 1}
    return Scene.from_dict(
        {
            "surface": {"spectrum": spectrum, "grid": [64, 64], "lengths": [1.0, 1.0]},
            "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15},
            "micro": micro,
            "coupling": {"kind": coupling},
            "load": load or {"approach": 0.01},
        }
    )


def test_the_plan_says_what_was_chosen_and_why():
    setup = make_setup(scene(model="auto", tolerance=0.1))
    said = dict(statements(setup))["micro model"]
    assert said == f"auto: {setup.choice.sentence}"
    assert "tolerance of 10 %" in said
    assert setup.model is setup.choice.model


def test_without_a_tolerance_two_per_cent_are_asked():
    assert "tolerance of 2 %" in make_setup(scene(model="auto")).choice.sentence


def assert_chosen_for(load, approach, solutions):
    """The candidates of a load are those of an approach of the level plane."""
    setup = make_setup(scene(load, model="auto", tolerance=0.1))
    known = choose(
        setup.surface,
        contact_modulus=setup.model.contact_modulus,
        approach=approach,
        tolerance=0.1,
        solutions=solutions,
    )
    for found, expected in zip(setup.choice.candidates, known.candidates, strict=True):
        assert found.label == expected.label
        assert found.expected_error == pytest.approx(expected.expected_error, rel=1e-12)
        assert found.cost == pytest.approx(expected.cost, rel=1e-12)
    assert setup.choice.taken.checked_error == pytest.approx(known.taken.checked_error, abs=1e-5)


def test_the_model_is_chosen_for_the_largest_approach_anywhere():
    load = {"approach": [0.006, 0.001, 0.004], "tilt": [0.002, -0.004], "steps": 3}
    # a plane tilted by 2 and 4 µm/mm comes 3 µm nearer at a corner of 1 mm²
    assert_chosen_for(load, approach=0.009, solutions=9)


def test_a_chosen_asperity_model_counts_and_warns_as_a_stated_one():
    load, waves = {"approach": 0.01}, (2, 4)
    setup = make_setup(scene(load, waves=waves, model="auto", tolerance=0.45))
    assert "maxima on the surface's border" in "".join(warnings(setup))
    assert setup.uses_summits
    assert setup.ignores_border
    stated = make_setup(scene(load, waves=waves, model=setup.choice.taken.label))
    assert dict(statements(setup))["contact"] == dict(statements(stated))["contact"]
    assert list(warnings(setup)) == list(warnings(stated))
    assert setup.table_tolerance == stated.table_tolerance


def test_asperities_with_those_of_the_border_ignore_nothing():
    setup = make_setup(scene(model="elliptic", curvature="contact", border="include"))
    assert setup.uses_summits
    assert not setup.ignores_border


@pytest.mark.parametrize(
    ("micro", "problem"),
    [
        ({"model": "elliptic", "tolerance": 0.1}, "'tolerance' needs model = 'auto'"),
        ({"model": "auto", "border": "include"}, "are chosen by model = 'auto'"),
    ],
)
def test_refuses(micro, problem):
    with pytest.raises(InputError, match=problem):
        scene(**micro)


def test_results_record_the_chosen_model():
    done = Run(scene(model="auto", tolerance=0.1))
    recorded = provenance(done, options=[])
    choice = done.setup.choice
    assert recorded["micro_model"]["chosen"]["label"] == choice.taken.label
    assert recorded["micro_model"]["chosen"]["checked_error"] == choice.taken.checked_error
    assert recorded["notes"] == [f"micro model chosen: {choice.sentence}"]
