"""The block gives the same numbers, and the same errors, on 1, 2 and 3 ranks."""

import numpy as np
import pytest
from helpers.on_ranks import RANKS

MODES = ["patchwise", "pointwise"]


@pytest.mark.parametrize("ranks", RANKS)
def test_tractions_displace_a_mesh_alike_on_any_ranks(on_ranks, ranks):
    np.testing.assert_allclose(on_ranks[ranks]["tractions"], on_ranks[1]["tractions"], rtol=1e-10)


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("case", ["whole", "tets", "one facet"])
def test_numbers_do_not_depend_on_the_ranks(on_ranks, case, mode, ranks):
    serial, parallel = (on_ranks[n][f"{case}, {mode}"] for n in (1, ranks))
    for name, value in serial["numbers"].items():
        # residuals of 1e-9 of the load on both sides
        np.testing.assert_allclose(parallel["numbers"][name], value, rtol=1e-8, err_msg=name)
    assert parallel["reaction"] == pytest.approx(parallel["numbers"]["force"], rel=1e-9)


@pytest.mark.slow
def test_the_cases_are_what_they_claim(on_ranks):
    assert sorted(on_ranks[3]["one facet, pointwise"]["points_of_ranks"])[:2] == [0, 0]
    shared = on_ranks[3]["whole, pointwise"]
    assert any(0 < missing < 16 for missing in shared["patches_missing_on_ranks"])


HELD_BY_NOTHING = (
    "NotConverged: the equilibrium of the plane at force 1 N did not converge: NO_SUPPORT after 0 "
    "iterations; no further patch can be touched that would hold the plane: prescribe its tilt "
    "(load.tilt) or take more patches (patches.grid)"
)


@pytest.mark.parametrize(
    ("case", "text"),
    [
        ("plane, patchwise", HELD_BY_NOTHING),
        ("plane, pointwise", HELD_BY_NOTHING),
        ("meshing", "InputError: 3: meshing gave up (allowed: better luck)"),
        ("law, patchwise", "InputError: 0.25: closure beyond the table"),
        ("law, pointwise", "InputError: 0.25: closure beyond the table"),
        (
            "newton",
            "NotConverged: the block at approach 0.008 mm did not converge: "
            "DIVERGED_MAX_IT after 0 iterations; take more load steps (load.steps)",
        ),
    ],
)
@pytest.mark.parametrize("ranks", RANKS)
def test_an_error_reaches_every_rank(on_ranks, case, text, ranks):
    assert on_ranks[ranks][case] == [text] * ranks
