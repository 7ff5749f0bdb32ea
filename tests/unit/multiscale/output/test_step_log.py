"""The log of load steps: what is kept of it, and what an interrupted write leaves."""

from dataclasses import fields, replace

import numpy as np
import pytest

from patchlaw.multiscale.loading.load_step import LoadStep, PatchState
from patchlaw.multiscale.output.checkpoint import read_steps, write_steps
from patchlaw.support.checked_store import START, Mark
from patchlaw.support.errors import InputError, NotWritten


def step(number):
    """Return a load step with numbers of all kinds."""
    dice = np.random.default_rng(number)
    arrays = {name: dice.normal(size=3) for name in ("closure_mm", "pressure_MPa")}
    return LoadStep(
        step=number, approach_mm=1e-3 * number / 3.0, force_N=float("nan"),
        mean_pressure_MPa=np.float64(1 / 3), contact_area_fraction=0.1, mean_separation_mm=1e-300,
        contacts=np.int64(7), newton_iterations=2, tilt=(1e-3, -2e-3), warnings=("a µ", "b"),
        errors=(("grid", 0.1),), meshes=((1.0, 2.0, 3.0),),
        patches=PatchState(**arrays, contact_area_fraction=np.arange(3)),
    )  # fmt: skip


STEPS = [step(number) for number in range(1, 8)]


def same(found, steps):
    """Compare load steps, bit by bit."""
    for one, other in zip(found, steps, strict=True):
        for each in fields(one):
            mine, its = getattr(one, each.name), getattr(other, each.name)
            if each.name == "patches":
                for name in PatchState.__slots__:
                    np.testing.assert_array_equal(getattr(mine, name), getattr(its, name))
            else:
                assert mine == its or (mine != mine and its != its)


@pytest.fixture
def log(tmp_path):
    return tmp_path / "log"


def test_load_steps_come_back_to_the_last_bit(log):
    marks, mark = [], START
    for count in (0, 1, 1, 4, 7):
        mark = write_steps(log, STEPS[:count], mark)
        marks.append(mark)
    assert [mark.records for mark in marks] == [0, 1, 1, 4, 7]
    for mark in marks:  # an earlier checkpoint stays good when a later one was not written
        same(read_steps(log, mark), STEPS[: mark.records])
    assert log.stat().st_size == mark.size


def test_each_load_step_is_written_once(log):
    mark, sizes, written = START, [0], []
    for count in range(1, 8):
        mark = write_steps(log, STEPS[:count], mark)
        sizes.append(log.stat().st_size)
        written.append(mark.size)
    assert sizes[1:] == written
    assert max(np.diff(sizes)) <= 1.5 * min(np.diff(sizes))


def test_what_a_killed_run_wrote_behind_its_checkpoint_goes(log):
    mark = write_steps(log, STEPS[:3])
    with log.open("ab") as file:
        file.write(b'{"step": 4, "appr')
    same(read_steps(log, mark), STEPS[:3])
    same(read_steps(log, write_steps(log, STEPS[:5], mark)), STEPS[:5])
    anew = write_steps(log, [*STEPS[:3], replace(STEPS[3], contacts=9)])  # of another process
    assert read_steps(log, anew)[3].contacts == 9
    same(read_steps(log, mark), STEPS[:3])


def test_log_that_vanished_is_written_whole(log):
    mark = write_steps(log, STEPS[:3])
    log.unlink()
    same(read_steps(log, write_steps(log, STEPS[:4], mark)), STEPS[:4])


def test_failed_write_leaves_what_was_written(log, monkeypatch):
    mark = write_steps(log, STEPS[:3])

    def full(number):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as broken:
        broken.setattr("patchlaw.support.checked_store.os.fsync", full)
        with pytest.raises(NotWritten, match="log: cannot be written: No space left on device"):
            write_steps(log, STEPS, mark)
    same(read_steps(log, mark), STEPS[:3])
    same(read_steps(log, write_steps(log, STEPS, mark)), STEPS)


def test_promise_of_more_bytes_than_there_are_is_refused(log):
    mark = write_steps(log, STEPS[:2])
    with pytest.raises(InputError, match="is damaged: log beside it"):
        read_steps(log, Mark(records=2, size=10**18, checksum=mark.checksum))
