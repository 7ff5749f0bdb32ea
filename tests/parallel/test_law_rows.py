"""The contact problems that consistent laws are made of are shared by the ranks."""

import json
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("law_rows_script.py")


@pytest.fixture(scope="module")
def found(mpirun, root):
    """Return what every rank solved and the laws it got, by the number of ranks."""
    results = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(root))
        for ranks in (1, 2, 3):
            done = mpirun(ranks, SCRIPT)
            assert done.returncode == 0, done.stdout + done.stderr
            results[ranks] = json.loads(done.stdout.splitlines()[-1])
    return results


@pytest.mark.parametrize("ranks", [2, 3])
def test_ranks_share_the_rows(found, ranks):
    ((whole, _),), solved = found[1], [count for count, _ in found[ranks]]
    assert whole > 33  # rows beyond the first ones: those that errors ask for are shared, too
    assert sum(solved) == whole  # nothing twice
    # one pair of rows; the first rows are odd, so that one pair lacks a row; and first touch, which
    # one rank finds for all
    assert max(solved) - min(solved) <= 4


@pytest.mark.parametrize("ranks", [2, 3])
def test_laws_are_those_of_one_rank_to_the_last_bit(found, ranks):
    ((_, laws),) = found[1]
    assert [each for _, each in found[ranks]] == [laws] * ranks
