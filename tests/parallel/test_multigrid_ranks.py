"""Geometric multigrid is the same method on 1 and 2 ranks."""

import json
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("multigrid_ranks_script.py")


@pytest.fixture(scope="module")
def found(mpirun, root):
    """Return what was found on every number of ranks."""
    results = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(root))
        for ranks in (1, 2):
            done = mpirun(ranks, SCRIPT)
            assert done.returncode == 0, done.stdout + done.stderr
            results[ranks] = json.loads(done.stdout.splitlines()[-1])
    return results


@pytest.mark.parametrize("case", ["graded", "margin", "quadratic", "tetrahedra", "column"])
def test_solves_do_not_depend_on_the_ranks(found, case):
    serial, parallel = (found[n][case] for n in (1, 2))
    assert serial["preconditioner"] == parallel["preconditioner"] == "mg"
    # residuals of 1e-10 on both sides, seen through the condition of a small block
    assert parallel["norm"] == pytest.approx(serial["norm"], rel=1e-8)
    # the method is the same; its eigenvalues are estimated from a random start
    assert abs(parallel["iterations"] - serial["iterations"]) <= 2
