"""The contact problems that laws are made of are shared by the ranks."""

import pytest
from helpers.on_ranks import RANKS, OnRanks


@pytest.fixture(scope="module")
def found(waiting_ranks):
    """Return what every rank solved and the laws it got, by the number of ranks."""
    return OnRanks(waiting_ranks, "law_rows_script.py")


@pytest.mark.parametrize("ranks", RANKS)
def test_ranks_share_the_rows(found, ranks):
    ((whole, *_),), solved = found[1], [count for count, *_ in found[ranks]]
    assert whole > 33  # rows beyond the first ones: those that errors ask for are shared, too
    assert sum(solved) == whole  # nothing twice
    # rows of small loads are cheap, and on a busy machine none takes what the same one took before
    assert min(solved) >= 0.25 * whole / ranks


@pytest.mark.parametrize("ranks", RANKS)
def test_one_rank_solves_quick_rows(found, ranks):
    """Each starts from those next to it, and takes less than it takes to send them around."""
    ((_, whole, *_),), solved = found[1], [quick for _, quick, *_ in found[ranks]]
    assert whole > 33 and solved == [whole] + [0] * (ranks - 1)


@pytest.mark.parametrize("ranks", RANKS)
def test_laws_are_those_of_one_rank_to_the_last_bit(found, ranks):
    ((_, _, *laws),) = found[1]  # consistent, and representative ones up to full contact
    assert [each for _, _, *each in found[ranks]] == [laws] * ranks
