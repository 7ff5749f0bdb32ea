"""Two meshed bodies on each other give the same numbers on 1, 2 and 3 ranks."""

import numpy as np
import pytest
from helpers.on_ranks import RANKS


@pytest.mark.parametrize("ranks", RANKS)
def test_same_numbers_on_any_ranks(on_ranks, ranks):
    for name, expected in on_ranks[1].items():
        # Newton ends at 1e-9 of the load
        np.testing.assert_allclose(on_ranks[ranks][name], expected, rtol=1e-8, err_msg=name)
