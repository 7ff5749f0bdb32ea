"""What an accuracy leaves open becomes the same on any number of ranks."""

from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("choice_ranks_script.py")


def test_a_choice_does_not_depend_on_the_number_of_ranks(mpirun):
    shown = [mpirun(ranks, SCRIPT) for ranks in (1, 2, 3)]
    assert all(done.returncode == 0 for done in shown), shown[-1].stderr
    alone, *many = (done.stdout.splitlines() for done in shown)
    assert '"kind": "concurrent"' in alone[0]
    for found in many:
        assert found[:2] == alone[:2]
        assert float(found[2]) == pytest.approx(float(alone[2]), rel=1e-8)
