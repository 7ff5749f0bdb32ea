"""Two meshed bodies on each other give the same numbers on 1, 2 and 3 ranks."""

import numpy as np
import pytest
from helpers.on_ranks import RANKS, OnRanks


@pytest.fixture(scope="module")
def found(waiting_ranks):
    return OnRanks(waiting_ranks, "pair_ranks_script.py")


@pytest.mark.parametrize("ranks", RANKS)
def test_same_numbers_on_any_ranks(found, ranks):
    for name, expected in found[1].items():
        # Newton ends at 1e-9 of the load
        np.testing.assert_allclose(found[ranks][name], expected, rtol=1e-8, err_msg=name)
