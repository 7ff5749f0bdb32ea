"""The block gives the same numbers, and the same errors, on 1, 2 and 3 ranks."""

import json
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).with_name("block_ranks_script.py")
ENVIRONMENT = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMPI_MCA_btl": "^tcp",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMP_NUM_THREADS": "1",
}
MODES = ["patchwise", "pointwise"]


@cache
def on_ranks(ranks):
    """Run all cases under mpirun, once; a rank that hangs fails the tests after two minutes."""
    result = subprocess.run(
        ["mpirun", "-n", str(ranks), sys.executable, str(SCRIPT)],
        capture_output=True,
        text=True,
        timeout=120,
        env=os.environ | ENVIRONMENT,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    return json.loads(result.stdout.splitlines()[-1])


@pytest.mark.parametrize("ranks", [2, 3])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("case", ["whole", "tets", "one facet"])
def test_numbers_do_not_depend_on_the_ranks(case, mode, ranks):
    serial, parallel = (on_ranks(n)[f"{case}, {mode}"] for n in (1, ranks))
    for name, value in serial["numbers"].items():
        # residuals of 1e-9 of the load on both sides
        np.testing.assert_allclose(parallel["numbers"][name], value, rtol=1e-8, err_msg=name)
    assert parallel["reaction"] == pytest.approx(parallel["numbers"]["force"], rel=1e-9)


def test_the_cases_are_what_they_claim():
    assert sorted(on_ranks(3)["one facet, pointwise"]["points_of_ranks"])[:2] == [0, 0]
    shared = on_ranks(3)["whole, pointwise"]
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
        ("gmsh", "InputError: 3: gmsh gave up (allowed: better luck)"),
        ("law, patchwise", "InputError: 0.25: closure beyond the table"),
        ("law, pointwise", "InputError: 0.25: closure beyond the table"),
        (
            "newton",
            "NotConverged: the block at approach 0.008 mm did not converge: "
            "DIVERGED_MAX_IT after 1 iterations; take more load steps (load.steps)",
        ),
    ],
)
def test_an_error_reaches_every_rank(case, text):
    assert on_ranks(3)[case] == [text] * 3
