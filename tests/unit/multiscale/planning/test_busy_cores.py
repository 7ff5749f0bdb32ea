"""What other programs take of the cores, by clocks that tests set."""

import itertools

import pytest

from multiscale.planning.busy_cores import Clocks, Competition, time_used


def competition(*, wall=1.0, own=1.0, others=0.0, cores=2):
    return Competition.of(wall=wall, own=own, all_used=own + others, cores=cores)


def test_an_idle_machine_delays_nothing():
    found = competition()
    assert not found.busy
    assert [found.delay(threads) for threads in (1, 2)] == [1.0, 1.0]


def test_a_little_in_the_background_is_idle():
    assert not competition(others=0.1).busy
    assert competition(others=0.1).delay(2) == 1.0


@pytest.mark.parametrize("others", [1, 2, 3, 6])
@pytest.mark.parametrize("cores", [1, 2, 4])
def test_programs_share_the_cores_evenly(others, cores):
    # a thread of ours and the others, on cores that are divided among all who want them
    share = min(1.0, cores / (1 + others))
    found = competition(own=share, others=share * others, cores=cores)
    assert found.others == pytest.approx(others, rel=1e-12)
    assert found.delay(1) == pytest.approx(1.0 / share, rel=1e-12)
    for threads in range(1, cores + 1):
        whole = min(1.0, cores / (threads + others))
        assert found.delay(threads) == pytest.approx(1.0 / whole, rel=1e-12)


def test_more_threads_than_cores_delay_as_much_on_an_idle_machine():
    assert Competition(others=0.0, cores=2).delay(8) == 1.0


def test_clocks_are_read_before_and_after():
    ticks = {name: itertools.count(0.0, step) for name, step in
             (("wall", 2.0), ("own", 1.0), ("all_used", 3.0))}  # fmt: skip
    clocks = Clocks(**{name: ticks[name].__next__ for name in ticks}, cores=2)
    found = []
    with clocks.around(found):
        pass
    # half a core for us, one for others in as much time: two of them, each with half of it
    assert found == [Competition(others=2.0, cores=2)]


def test_time_without_length_tells_nothing():
    assert competition(wall=0.0) == Competition(cores=2)


def test_counts_of_the_operating_system(tmp_path):
    file = tmp_path / "stat"
    file.write_text("cpu  100 20 30 5000 700 1 2 3 0 0\ncpu0 1 1 1 1 1 1 1 1 0 0\n")
    assert time_used(file) == pytest.approx(1.56, rel=1e-12)  # without 5700 ticks of idleness


def test_without_counts_no_other_is_seen(tmp_path):
    assert time_used(tmp_path / "none") >= 0.0
    assert time_used() >= 0.0
