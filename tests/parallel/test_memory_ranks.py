"""A program that makes many runs does not grow with them."""

from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("memory_ranks_script.py")


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("kind", ["isolated", "reference", "concurrent"])
def test_blocks_of_earlier_runs_are_freed(mpirun, monkeypatch, root, kind, ranks):
    monkeypatch.setenv("PYTHONPATH", str(root))
    done = mpirun(ranks, SCRIPT, kind)
    assert done.returncode == 0, done.stdout + done.stderr
    # three blocks of 12 MB and more that stayed would add three times as much
    assert float(done.stdout.splitlines()[-1]) < 12.0 / ranks
