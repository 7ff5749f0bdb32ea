"""What an accuracy leaves open becomes the same on any number of ranks."""

import pytest
from helpers.on_ranks import RANKS, OnRanks


@pytest.fixture(scope="module")
def found(waiting_ranks):
    """Return the resolved keys, the sentence about them and the error, by the number of ranks."""
    return OnRanks(waiting_ranks, "choice_ranks_script.py")


@pytest.mark.parametrize("ranks", RANKS)
def test_a_choice_does_not_depend_on_the_number_of_ranks(found, ranks):
    (alone,), more = found[1], found[ranks]
    assert alone[0]["coupling"]["kind"] == "concurrent"
    assert more == [more[0]] * ranks  # all ranks say the same
    assert more[0][:2] == alone[:2]
    assert more[0][2] == pytest.approx(alone[2], rel=1e-8)
