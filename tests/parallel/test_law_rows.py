"""The contact problems that laws are made of are shared by the ranks."""

import pytest
from helpers.on_ranks import RANKS


@pytest.mark.parametrize("ranks", RANKS)
def test_ranks_share_the_rows(on_ranks, ranks):
    ((whole, *_),), solved = on_ranks[1], [count for count, *_ in on_ranks[ranks]]
    assert whole > 33  # rows beyond the first ones: those that errors ask for are shared, too
    assert sum(solved) == whole  # nothing twice
    # rows of small loads are cheap, and on a busy machine none takes what the same one took before
    assert min(solved) >= 0.25 * whole / ranks


@pytest.mark.parametrize("ranks", RANKS)
def test_one_rank_solves_quick_rows(on_ranks, ranks):
    """Each starts from those next to it, and takes less than it takes to send them around."""
    ((_, whole, *_),), solved = on_ranks[1], [quick for _, quick, *_ in on_ranks[ranks]]
    assert whole > 33 and solved == [whole] + [0] * (ranks - 1)


@pytest.mark.parametrize("ranks", RANKS)
def test_laws_are_those_of_one_rank_to_the_last_bit(on_ranks, ranks):
    ((_, _, *laws),) = on_ranks[1]  # consistent, and representative ones up to full contact
    assert [each for _, _, *each in on_ranks[ranks]] == [laws] * ranks
