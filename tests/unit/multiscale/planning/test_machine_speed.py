"""How fast a machine is, by clocks that tests set."""

import pytest

from multiscale.planning.busy_cores import Clocks
from multiscale.planning.machine_speed import Machine


class Shared:
    """Two cores; this process has a share of a core, and the rest of both belongs to others."""

    def __init__(self, share, each=1e-2):
        self.share, self.each, self.own = share, each, 0.0

    @property
    def clocks(self):
        return Clocks(wall=self.wall, own=self._own, all_used=lambda: 2.0 * self.wall(), cores=2)

    def wall(self):
        return self.own / self.share

    def _own(self):
        self.own += 0.5 * self.each  # read before and after work
        return self.own


def idle():
    shared = Shared(share=1.0)
    clocks = shared.clocks
    return Machine(Clocks(wall=clocks.wall, own=clocks.own, all_used=lambda: shared.own, cores=2))


def test_speed_is_that_of_idle_cores_whatever_others_use():
    speeds = [Machine(Shared(share).clocks) for share in (1.0, 0.5, 0.1)]
    assert [one.arrays for one in speeds] == pytest.approx([idle().arrays] * 3, rel=0.11)


def test_others_are_told_from_their_use_of_the_cores():
    assert not idle().competition.busy
    # half a core for us and 3/2 for others: three of them with as much each
    found = Machine(Shared(0.5).clocks).competition
    assert found.others == pytest.approx(3.0, rel=0.02)
    assert found.delay(1) == pytest.approx(2.0, rel=0.02)


def test_products_are_measured_again_on_other_threads(monkeypatch):
    machine = Machine()
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    machine.product(32**2)
    before = dict(machine._products)
    machine.product(32**2)
    assert machine._products == before  # once
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    machine.product(32**2)
    assert {threads for _, threads in machine._products} == {1, 2}
    assert machine.measured == {"products"}


def test_products_beyond_the_measured_grids_grow_as_transforms():
    machine = Machine()
    machine._products = {
        (side, cores): 1e-9 for side in (32, 128, 512, 1024) for cores in range(1, 65)
    }
    ratio = machine.product(4096**2) / machine.product(1024**2)
    assert ratio == pytest.approx(16.0 * 26.0 / 22.0, rel=1e-12)  # n log2(4 n)
    between = machine.product(200**2)
    assert machine.product(128**2) < between < machine.product(512**2)
