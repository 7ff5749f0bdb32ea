from __future__ import annotations

import pytest

from geometry.errors import InputError
from multiscale.plan import statements
from multiscale.provenance import provenance
from multiscale.run import Run
from multiscale.scene import Scene
from multiscale.stage import make_stage


def scene(**micro):
    spectrum = {"hurst": 0.8, "waves": [2, 6], "rms_slope": 0.2}
    return Scene.from_dict(
        {
            "surface": {"spectrum": spectrum, "grid": [64, 64], "lengths": [1.0, 1.0]},
            "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15},
            "micro": micro,
            "coupling": {"kind": "analytic"},
            "load": {"approach": 0.01},
        }
    )


def test_the_plan_says_what_was_chosen_and_why():
    stage = make_stage(scene(model="auto", tolerance=0.1))
    said = dict(statements(stage))["micro model"]
    assert said == f"auto: {stage.choice.sentence}"
    assert "tolerance 10.0%" in said
    assert stage.model is stage.choice.model


def test_without_a_tolerance_two_per_cent_are_asked():
    assert "tolerance 2.0%" in make_stage(scene(model="auto")).choice.sentence


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
    choice = done.stage.choice
    assert recorded["micro_model"]["chosen"]["label"] == choice.taken.label
    assert recorded["micro_model"]["chosen"]["checked_error"] == choice.checked_error
    assert recorded["notes"] == [f"micro model chosen: {choice.sentence}"]
