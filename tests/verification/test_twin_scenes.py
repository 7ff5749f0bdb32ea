"""A random scene of ``benchmarks/twin_campaign.py`` with each of its twins."""

import numpy as np
import pytest

from benchmarks.own_program import differences_of_program
from benchmarks.twin_moves import SYMMETRIES
from benchmarks.twin_scenes import DrawnScene, ran
from benchmarks.twin_tables import compared, tables
from patchlaw import Spectrum, synthesise


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "seed", "features"),
    [
        ("analytic", 3, ("slopes", "leak", "heat")),
        ("isolated", 3, ("asperities", "unload")),
        ("concurrent", 15, ("unload",)),
        pytest.param("consistent", 12, ("tilt",), marks=pytest.mark.slow),
        pytest.param("concurrent", 3, ("hardness", "wear"), marks=pytest.mark.slow),
    ],
)
def test_twins_of_a_scene_agree_in_every_column(kind, seed, features, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    case = DrawnScene(seed, features, kind)
    assert set(features) <= set(case.used)
    case.data["output"]["check"] = "none"
    base = tables(ran(case.data))
    seen = set()
    for name, twin in SYMMETRIES.items():
        if (made := twin(case.data, np.random.default_rng(5))) is not None:
            data, back = made
            for column, apart, told in compared(base, back(tables(ran(data)))):
                # residuals of 1e-8, over what cancels
                assert apart <= 1e-5, (name, column, told)
            seen.add(name)
    assert {"scaled", "mirrored", "flipped", "transposed", "raised", "worded"} <= seen


@pytest.mark.long
@pytest.mark.parametrize(
    ("seed", "features"),
    [
        (108, ("leak", "tilt")),
        (126, ("unload", "tilt")),
        (107, ("samples", "friction")),
        pytest.param(103, ("wear",), marks=pytest.mark.slow),
    ],
)
def test_a_program_of_its_own_finds_what_the_scene_does(seed, features, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    case = DrawnScene(seed, ("body", *features), "representative")
    assert set(features) <= set(case.used) and "body" in case.data
    case.data["output"]["check"] = "none"
    found = list(differences_of_program(case.data))
    for name, apart, told in found:
        # residuals of 1e-8; measured 7e-9 of what friction takes, 4e-10 of all else
        assert apart <= 1e-7, (name, told)
    words = {"leak": "leak", "friction": "shear", "wear": "worn", "tilt": "tilt"}
    names = " ".join(name for name, *_ in found)
    assert all(words[one] in names for one in features if one in words)


@pytest.mark.long
def test_a_plane_that_may_turn_on_two_cells_does_not_touch_a_third_with_rounding(
    tmp_path, monkeypatch
):
    """Two cells opposite each other hold half the approach, whatever the tilt about their line."""
    monkeypatch.chdir(tmp_path)
    spectrum = Spectrum(hurst=0.6, waves=(2.0, 4.96), rms_slope=0.0734, seed=736575589)
    step, lengths, most = 8.65e-4, (1.0, 0.666667), 4.31e-3
    heights = step * np.round(synthesise(spectrum, grid=(24, 16), lengths=lengths).heights / step)
    block = {"young_modulus": 58.9, "poisson_ratio": 0.137, "height": 1.86, "sides": "roller"}
    load = {"approach": [0.5 * most, most, 0.5 * most], "steps": 1, "tilt": "free"}
    history = ran({
        "surface": {"heights": heights, "lengths": lengths},
        "block": block | {"cells": [4, 4, 4]},
        "patches": {"grid": [1, 2]},
        "coupling": {"kind": "concurrent"},
        "load": load,
        "output": {"check": "none", "figures": False, "report": False},
    })  # fmt: skip
    np.testing.assert_allclose(history.force_N[2], history.force_N[0], rtol=1e-8)  # the residual
    assert history.tilt_x[2] != history.tilt_x[0]  # which nothing determines
    assert history.contact_area_fraction[2] == history.contact_area_fraction[0]


def test_a_wrong_column_is_found():
    one = {"force_N": ("N", np.array([1.0, 2.0])), "tilt_x": ("mm/mm", np.zeros(2))}
    other = one | {"force_N": ("N", np.array([1.0, 2.2]))}
    assert {name: apart for name, apart, _ in compared(one, other)} == {
        "force_N": pytest.approx(0.1),
        "tilt_x": 0.0,
    }
    missing = {name: apart for name, apart, _ in compared(one, {"force_N": one["force_N"]})}
    assert missing == {"force_N": 0.0, "tilt_x": np.inf}
