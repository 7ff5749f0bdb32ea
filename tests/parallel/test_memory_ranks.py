"""A program that makes many runs does not grow with them."""

from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("memory_ranks_script.py")


@pytest.mark.slow
@pytest.mark.parametrize("kind, ranks", [("isolated", 1), ("reference", 2), ("concurrent", 1)])
def test_blocks_of_earlier_runs_are_freed(mpirun, kind, ranks):
    done = mpirun(ranks, SCRIPT, kind)
    assert done.returncode == 0, done.stdout + done.stderr
    # two blocks of 12 MB and more that stayed would add three times as much
    assert float(done.stdout.splitlines()[-1]) < 8.0
