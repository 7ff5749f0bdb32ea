"""A random scene of ``benchmarks/twin_campaign.py`` with each of its twins."""

import numpy as np
import pytest
from helpers.twin_moves import SYMMETRIES
from helpers.twin_scenes import DrawnScene, ran
from helpers.twin_tables import compared, tables


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "features"),
    [
        ("analytic", ("slopes", "leak", "heat")),
        ("isolated", ("asperities", "unload")),
        ("consistent", ("unload", "roller")),
        pytest.param("concurrent", ("hardness", "wear"), marks=pytest.mark.slow),
    ],
)
def test_twins_of_a_scene_agree_in_every_column(kind, features, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    case = DrawnScene(3, features, kind)
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
    assert {"scaled", "mirrored", "flipped", "transposed", "raised"} <= seen


def test_a_wrong_column_is_found():
    one = {"force_N": ("N", np.array([1.0, 2.0])), "tilt_x": ("mm/mm", np.zeros(2))}
    other = one | {"force_N": ("N", np.array([1.0, 2.2]))}
    assert {name: apart for name, apart, _ in compared(one, other)} == {
        "force_N": pytest.approx(0.1),
        "tilt_x": 0.0,
    }
    missing = {name: apart for name, apart, _ in compared(one, {"force_N": one["force_N"]})}
    assert missing == {"force_N": 0.0, "tilt_x": np.inf}
