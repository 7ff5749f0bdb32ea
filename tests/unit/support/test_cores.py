"""The cores that a process may use, work in threads, and tasks distributed over ranks."""

import itertools
import os
import threading
from types import SimpleNamespace

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from patchlaw.support import cores, hold_blas, in_threads, node_cores, shared
from patchlaw.support import parallel as module
from patchlaw.support.parallel import allocated, distributed, own_cores

GRANTED = len(os.sched_getaffinity(0))
VARIABLES = (
    "OMP_NUM_THREADS", "OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "MV2_COMM_WORLD_LOCAL_SIZE",
    "SLURM_STEP_NUM_TASKS", "SLURM_STEP_NUM_NODES", "SLURM_CPUS_PER_TASK",
)  # fmt: skip


@pytest.fixture(autouse=True)
def alone(monkeypatch):
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)


def granted(monkeypatch, count):
    monkeypatch.setattr(module, "_granted", lambda: frozenset(range(count)))


@pytest.mark.parametrize(
    ("stated", "ranks", "expected"),
    [
        (None, None, GRANTED),
        ("3", None, 3),
        ("3,2", "8", 3),  # outer and inner level of OpenMP
        ("0", None, GRANTED),
        ("many", None, GRANTED),
        (None, "1", GRANTED),
        (None, str(GRANTED), 1),
        (None, "1000", 1),
        (None, "2(x3)", GRANTED),
    ],
)
def test_own_cores(monkeypatch, stated, ranks, expected):
    if stated:
        monkeypatch.setenv("OMP_NUM_THREADS", stated)
    if ranks:
        monkeypatch.setenv("OMPI_COMM_WORLD_LOCAL_SIZE", ranks)
    assert own_cores() == cores() == expected


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({"OMPI_COMM_WORLD_LOCAL_SIZE": "4"}, 3),  # Open MPI
        ({"MPI_LOCALNRANKS": "3"}, 4),  # Hydra: MPICH, Intel MPI
        ({"MV2_COMM_WORLD_LOCAL_SIZE": "6"}, 2),
        ({"SLURM_STEP_NUM_TASKS": "12", "SLURM_STEP_NUM_NODES": "3"}, 3),
        ({"SLURM_STEP_NUM_TASKS": "11", "SLURM_STEP_NUM_NODES": "3"}, 3),  # 4, 4 and 3
        ({"SLURM_STEP_NUM_TASKS": "11"}, 12),
        ({"SLURM_CPUS_PER_TASK": "6", "SLURM_STEP_NUM_TASKS": "2"}, 6),  # bound to them
        ({"SLURM_CPUS_PER_TASK": "6", "OMP_NUM_THREADS": "1"}, 1),  # what the user says counts
        # mpirun inside a job of Slurm: the launcher that started the ranks counts
        ({"OMPI_COMM_WORLD_LOCAL_SIZE": "2", "SLURM_STEP_NUM_TASKS": "1"}, 6),
    ],
)
def test_launchers_tell_the_ranks_beside_it(monkeypatch, variables, expected):
    granted(monkeypatch, 12)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert own_cores() == expected


class Ranks:
    """A rank of a job whose nodes, granted cores and own threads are known."""

    def __init__(self, *everywhere):
        self.everywhere = everywhere

    def allgather(self, mine):
        return list(self.everywhere)


def job(nodes, *, own=1, bound=False):
    """Return the rank of a job on node "a", of four cores, with ranks on the given nodes."""
    return Ranks(*(
        (node, frozenset([rank] if bound else range(4)), own) for rank, node in enumerate(nodes)
    ))  # fmt: skip


@pytest.mark.parametrize(
    ("ranks", "own", "nodes", "threads", "alone"),
    [
        (job("aa"), 1, 1, 2, 2),
        (job("aaa", own=2), 2, 1, 6, 4),  # no more than the node has
        (job("ab"), 1, 2, 1, 1),  # those of another node are not to be had
        (job("abab"), 1, 2, 2, 2),
        (job("a", own=6), 6, 1, 6, 6),  # what the user stated stays, cores or not
        (job("aab", bound=True), 1, 2, 2, 2),
    ],
)
def test_one_rank_alone_takes_the_cores_of_its_node(monkeypatch, ranks, own, nodes, threads, alone):
    monkeypatch.setattr(module.platform, "node", lambda: "a")
    monkeypatch.setenv("OMP_NUM_THREADS", str(own))
    here = node_cores(ranks)
    assert (here.nodes, here.threads, here.own, here.alone) == (nodes, threads, own, alone)
    assert here.granted == frozenset(range(2 if ranks.everywhere[0][1] == {0} else 4))


@pytest.mark.skipif(GRANTED < 2, reason="needs two cores")
def test_threads_leave_the_core_that_the_rank_is_bound_to():
    whole = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(whole)})
    try:
        with allocated(2, frozenset(whole)):
            assert os.sched_getaffinity(0) == whole
        assert os.sched_getaffinity(0) == {min(whole)}
    finally:
        os.sched_setaffinity(0, whole)


def blas_threads():
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def test_threads_of_blas_times_ours_are_the_cores(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    hold_blas()
    seen = []
    assert blas_threads() <= {2}  # the reference BLAS has none to tell of
    in_threads(lambda task: seen.append(blas_threads()), range(4))
    assert all(threads <= {1} for threads in seen)
    with allocated(3):
        assert blas_threads() <= {3}
    assert blas_threads() <= {2}
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    hold_blas()
    assert blas_threads() <= {1}
    assert node_cores(None).own == 1


def test_allocated_cores_go_back():
    with pytest.raises(ValueError, match="broken"), allocated(7):
        assert cores() == 7
        with allocated(2):
            assert cores() == 2
        assert cores() == 7
        raise ValueError("broken")
    assert cores() == own_cores()


@pytest.mark.parametrize("count", [1, 4])
def test_every_task_is_done_once(count):
    done, threads = [], set()
    with allocated(count):
        in_threads(lambda task: (done.append(task), threads.add(threading.get_ident())), range(50))
    assert sorted(done) == list(range(50))
    assert len(threads) <= count


@pytest.mark.parametrize("count", [1, 2])
def test_errors_come_out(count):
    with allocated(count), pytest.raises(ZeroDivisionError):
        in_threads(lambda task: 1 / task, [1, 0, 2])


def test_blocks_are_an_even_number_of_about_equal_ranges():
    for count, size, least in ((257, 256, 1), (513, 128, 1), (512, 512, 4), (7, 100, 4), (0, 5, 1)):
        found = module.blocks(count, size, least)
        assert [row for some in found for row in range(count)[some]] == list(range(count))
        assert len(found) == 1 or len(found) % 2 == 0 or count < 8 * least
        assert all(some.stop - some.start < size + 8 for some in found)
    assert module.blocks(100, 100) == [slice(0, 100)]


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
