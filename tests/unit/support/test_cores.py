"""The cores that a process may use, and work in threads."""

import os
import threading

import pytest
from threadpoolctl import threadpool_info

from support import cores as module
from support.cores import Place, cores, hold_blas, in_threads, lendable, lent, own_cores, place

GRANTED = len(os.sched_getaffinity(0))
VARIABLES = (
    "OMP_NUM_THREADS", "OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "MV2_COMM_WORLD_LOCAL_SIZE",
    "SLURM_STEP_TASKS_PER_NODE", "SLURM_NODEID", "SLURM_CPUS_PER_TASK",
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
        ({"SLURM_STEP_TASKS_PER_NODE": "4(x2),3", "SLURM_NODEID": "0"}, 3),
        ({"SLURM_STEP_TASKS_PER_NODE": "4(x2),3", "SLURM_NODEID": "1"}, 3),
        ({"SLURM_STEP_TASKS_PER_NODE": "4(x2),3", "SLURM_NODEID": "2"}, 4),
        ({"SLURM_STEP_TASKS_PER_NODE": "4(x2),3", "SLURM_NODEID": "9"}, 12),
        ({"SLURM_CPUS_PER_TASK": "6", "SLURM_STEP_TASKS_PER_NODE": "2"}, 6),  # bound to them
        ({"SLURM_CPUS_PER_TASK": "6", "OMP_NUM_THREADS": "1"}, 1),  # what the user says counts
        # mpirun inside a job of Slurm: the launcher that started the ranks counts
        ({"OMPI_COMM_WORLD_LOCAL_SIZE": "2", "SLURM_STEP_TASKS_PER_NODE": "1"}, 6),
    ],
)
def test_launchers_tell_the_ranks_beside_it(monkeypatch, variables, expected):
    granted(monkeypatch, 12)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert own_cores() == expected


def ranks(*nodes, own=1, each=4):
    """Return the places of ranks that share the cores of their nodes."""
    return [Place(node, frozenset(range(each)), own) for node in nodes]


@pytest.mark.parametrize(
    ("places", "working", "expected"),
    [
        (ranks("a", "a"), [0], 2),
        (ranks("a", "a", "a", own=2), [0], 4),  # no more than the node has
        (ranks("a", "b"), [0], 1),  # a waiting rank on another node lends nothing
        (ranks("a", "b", "a", "b"), [0], 2),
        (ranks("a", "a", "a", "a"), [0, 1], 2),
        (ranks("a", "a", "a", "a"), [0, 1, 2], 1),
        (ranks("a", "a", own=3), [0, 1], 3),  # what the user stated stays, cores or not
    ],
)
def test_waiting_ranks_lend_their_cores(places, working, expected):
    for rank in working:
        assert lendable(places, working, rank).own == expected


def test_a_rank_that_is_bound_to_its_core_may_use_those_of_others():
    bound = [Place("a", frozenset([k]), 1) for k in range(3)]
    assert lendable(bound, [0], 0) == Place("a", frozenset(range(3)), 3)
    assert lendable(bound, [0, 1, 2], 1) == bound[1]


@pytest.mark.skipif(GRANTED < 2, reason="needs two cores")
def test_threads_leave_the_core_that_the_rank_is_bound_to():
    whole = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(whole)})
    try:
        with lent(2, frozenset(whole)):
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
    with lent(3):
        assert blas_threads() <= {3}
    assert blas_threads() <= {2}
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    hold_blas()
    assert blas_threads() <= {1}
    assert place().own == 1


def test_lent_cores_go_back():
    with pytest.raises(ValueError, match="broken"), lent(7):
        assert cores() == 7
        with lent(2):
            assert cores() == 2
        assert cores() == 7
        raise ValueError("broken")
    assert cores() == own_cores()


@pytest.mark.parametrize("count", [1, 4])
def test_every_task_is_done_once(count):
    done, threads = [], set()
    with lent(count):
        in_threads(lambda task: (done.append(task), threads.add(threading.get_ident())), range(50))
    assert sorted(done) == list(range(50))
    assert len(threads) <= count


@pytest.mark.parametrize("count", [1, 2])
def test_errors_come_out(count):
    with lent(count), pytest.raises(ZeroDivisionError):
        in_threads(lambda task: 1 / task, [1, 0, 2])
