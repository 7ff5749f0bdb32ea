"""What one rank does for all takes the cores of its node, and gives the same numbers."""

import json
import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).with_name("allocated_cores_script.py")
CORES = len(os.sched_getaffinity(0))


@pytest.fixture(scope="module")
def found(mpirun):
    """Return what is found on a number of ranks with a number of threads each."""

    @cache
    def run(ranks, threads):
        done = mpirun(ranks, SCRIPT, threads)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout.splitlines()[-1])

    return run


@pytest.mark.long
@pytest.mark.parametrize(("ranks", "threads"), [(2, 1), (1, 2)])
def test_same_numbers_on_any_number_of_ranks_and_threads(found, ranks, threads):
    (alone,), more = found(1, 1)["found"], found(ranks, threads)
    # transforms do not depend on threads, and products of BLAS do by rounding
    np.testing.assert_allclose(more["found"], [alone] * ranks, rtol=1e-12, atol=1e-15)
    allocated = max(threads, min(ranks * threads, CORES))
    assert more["cores"] == [allocated] + [0] * (ranks - 1)
