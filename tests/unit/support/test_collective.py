"""Tasks distributed over ranks by what they cost."""

import itertools
import os
from types import SimpleNamespace

import numpy as np
import pytest

from patchlaw.support import cores, shared
from patchlaw.support.parallel import distributed


def test_equal_tasks_are_distributed_in_turn():
    assert distributed(7, 3) == [[0, 3, 6], [1, 4], [2, 5]]
    assert distributed(2, 3) == [[0], [1], []]


def test_costly_tasks_come_first():
    assert distributed(5, 2, [1.0, 9.0, 2.0, 5.0, 4.0]) == [[1, 2], [3, 4, 0]]


@pytest.mark.parametrize("ranks", [2, 3])
def test_the_last_rank_ends_at_most_a_third_later_than_it_must(ranks):
    dice = np.random.default_rng(3)
    for costs in dice.exponential(size=(20, 7)):
        parts = distributed(7, ranks, list(costs))
        assert sorted(itertools.chain(*parts)) == list(range(7))
        owners = itertools.product(range(ranks), repeat=7)
        ends = (np.bincount(owner, costs, minlength=ranks).max() for owner in owners)
        best = min(ends)
        assert max(sum(costs[k] for k in part) for part in parts) <= (4 / 3) * best * (1 + 1e-12)


def test_a_single_task_takes_the_cores_of_the_node(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    arrived = SimpleNamespace(Test=lambda: True)
    ranks = SimpleNamespace(
        rank=0, size=2, allgather=lambda mine: [mine, mine], Ibarrier=lambda: arrived,
        bcast=lambda content, root: content,
    )  # fmt: skip
    told = []
    (used,) = shared(ranks, 1, lambda index: cores(), observe=told.append)
    assert used == min(2, len(os.sched_getaffinity(0)))
    assert told == [1]


def test_results_come_in_the_order_of_the_tasks():
    told = []
    found = shared(
        None, 4, lambda index: 10 * index, costs=[1.0, 4.0, 2.0, 3.0], observe=told.append
    )
    assert found == [0, 10, 20, 30]
    assert told == [1, 2, 3, 4]
