"""What an accuracy leaves open becomes the same on any number of ranks."""

import pytest
from helpers.on_ranks import RANKS


@pytest.mark.long
@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("body", ["block", "plate"])
def test_a_choice_does_not_depend_on_the_number_of_ranks(on_ranks, body, ranks):
    alone = on_ranks[1][0][body]
    more = [one[body] for one in on_ranks[ranks]]
    if body == "block":
        assert alone[0]["coupling.kind"] == "concurrent"
    else:
        assert alone[0]["body.refinements"] > 0
    assert more == [more[0]] * ranks  # all ranks say the same
    assert more[0][:2] == alone[:2]
    assert more[0][3] == pytest.approx(alone[3], rel=1e-8)
    # errors are differences of forces that agree to 1e-8
    assert more[0][2] == pytest.approx(alone[2], rel=1e-8 if body == "block" else 1e-5)
