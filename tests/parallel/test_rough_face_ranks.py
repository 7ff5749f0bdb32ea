"""A foot that is meshed with its roughness gives the same contact on 1, 2 and 3 ranks."""

import numpy as np
import pytest
from helpers.on_ranks import RANKS


@pytest.mark.long
@pytest.mark.parametrize("ranks", RANKS)
def test_contact_of_a_foot_does_not_depend_on_the_ranks(on_ranks, ranks):
    one, more = on_ranks[1], on_ranks[ranks]
    assert more["nodes"] == one["nodes"]
    assert min(one["nodes"]) > 0
    for name in ("force", "moment", "area", "largest"):
        np.testing.assert_allclose(more[name], one[name], rtol=1e-8, atol=1e-9)
    assert np.abs(more["balance"]).max() < 1e-8
