"""Scripts that print one line of JSON, run on any number of ranks when a test first asks for it."""

import json
from pathlib import Path

import pytest
from mpi4py import MPI

RANKS = [2, pytest.param(3, marks=pytest.mark.slow)]
"""Numbers of ranks that are compared with one; three only among the slow tests."""


def tell(found):
    """Print what was found, of the first rank, as one line of JSON."""
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(found, sort_keys=True))


class OnRanks(dict):
    """What a script found, by the number of ranks.

    Args:
        run: Runs words on a number of ranks.
        script: Name of a script in `tests/parallel`.
    """

    def __init__(self, run, script):
        super().__init__()
        self._run, self._script = run, Path(__file__).parents[1] / "parallel" / script

    def __missing__(self, ranks):
        # a minute where nothing else runs, six times as long beside other tests
        done = self._run(ranks, self._script, timeout=900)
        assert done.returncode == 0, done.stdout + done.stderr
        self[ranks] = json.loads(done.stdout.splitlines()[-1])
        return self[ranks]
