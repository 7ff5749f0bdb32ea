"""Every coupling gives the same on one rank and on four, some of which own nothing."""

import numpy as np
import pytest

SCRIPT = "tests/parallel/four_ranks_script.py"


@pytest.mark.slow
def test_four_ranks_give_what_one_gives(waiting_ranks, tmp_path):
    found = {}
    for ranks in (1, 4):
        path = tmp_path / f"{ranks}.npz"
        done = waiting_ranks(ranks, SCRIPT, path)
        assert done.returncode == 0, done.stderr
        found[ranks] = dict(np.load(path))
    points = {ranks: numbers.pop("facet points") for ranks, numbers in found.items()}
    assert points[4].sum() == points[1].sum() > 0
    assert (points[4] == 0).any()  # the premise: a rank owns nothing of the interface
    for name, one in found[1].items():
        assert one[-1, 0] > 0.0, name  # the force
        # residuals are driven to 1e-9 of the load; closures and pressures follow linearly
        assert np.all(np.abs(found[4][name] - one) <= 1e-8 * np.abs(one).max(axis=0)), name
