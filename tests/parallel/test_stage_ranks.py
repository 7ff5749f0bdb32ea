"""The ingredients of a scene reach every rank as they are, large arrays beside the pickle."""

import json
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("stage_ranks_script.py")


@pytest.mark.long
def test_every_rank_gets_the_stage_of_one(waiting_ranks):
    shown = [waiting_ranks(ranks, SCRIPT) for ranks in (1, 2)]
    assert all(done.returncode == 0 for done in shown), shown[-1].stderr
    alone, many = (done.stdout.splitlines() for done in shown)
    assert len(alone) == len(many) == 3  # all ranks say the same
    assert alone[0] == many[0]
    assert (alone[2], many[2]) == ("(1,)", "(2,)")  # ranks on one node
    words, *arrays = json.loads(many[1])
    # heights, and their spline with 28 wrapped cells on either side, without its derivatives
    assert arrays == [8 * 200 * 256, 8 * 256 * 312]
    assert words < 20_000
