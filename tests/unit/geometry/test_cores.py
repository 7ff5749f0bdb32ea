"""The cores that a process may use, and work in threads."""

import os
import threading

import pytest

from geometry.cores import cores, in_threads, lent, own_cores

GRANTED = len(os.sched_getaffinity(0))


@pytest.fixture(autouse=True)
def alone(monkeypatch):
    for name in ("OMP_NUM_THREADS", "OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.delenv("SLURM_NTASKS_PER_NODE", raising=False)


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
