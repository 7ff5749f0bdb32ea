"""Configurations one after another: budget, interruption, stored results, own processes."""

import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from multiscale.comparison.catalogue import configurations
from multiscale.comparison.compare import reference_within, run_all
from multiscale.comparison.configuration import RunResult, read_result, write_result
from multiscale.comparison.launch import check_launchable, launch_process
from multiscale.comparison.process import run_here

from multiscale.run import Run, run
from multiscale.scene.scene import Scene
from support.errors import InputError, NotConverged

PAPER = Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml"
TINY = ["surface.grid=[32, 32]", "load.steps=2", "patches.grid=[2, 2]"]


@pytest.fixture(scope="module")
def some():
    """Three configurations by summits."""
    found = configurations(Scene.load(PAPER, TINY))
    return [one for one in found if one.kind == "analytic"][:3]


def named(found, name):
    return next(one for one in found if one.name.startswith(name))


class Fake:
    """Stands for launching: counts, takes time on its own clock, and ends as it is told."""

    def __init__(self, seconds=1.0, ends=None):
        self.now, self.seconds, self.ends, self.run = 0.0, seconds, ends or {}, []

    def __call__(self, one, seconds):
        self.run.append(one.name)
        end = self.ends.get(one.name, "done")
        if end is KeyboardInterrupt:
            raise KeyboardInterrupt
        if seconds is not None and self.seconds > seconds:
            self.now += seconds
            return RunResult(configuration=one, status="over budget")
        self.now += self.seconds
        return RunResult(configuration=one, status=end, phases={"load steps": self.seconds})

    def clock(self):
        return self.now

    def results(self, found, folder, budget=None):
        """Return results, and whether each was stored before."""
        return list(run_all(found, folder, budget_s=budget, launch=self, clock=self.clock))

    def all(self, found, folder, budget=None):
        results = self.results(found, folder, budget)
        return [(one.configuration.name, one.status, stored) for one, stored in results]


def test_budget_ends_one_configuration_and_starts_no_more(some, tmp_path):
    fake = Fake(seconds=2.0)
    found = fake.all(some, tmp_path, budget=3.0)
    assert [status for _, status, _ in found] == ["done", "over budget", "not started"]
    assert fake.run == [one.name for one in some[:2]]
    # with another budget only what has no result is run
    again = Fake(seconds=2.0)
    assert [end[1:] for end in again.all(some, tmp_path, budget=5.0)] == [
        ("done", True), ("done", False), ("done", False),
    ]  # fmt: skip
    assert again.run == [one.name for one in some[1:]]


def test_configurations_beyond_the_budget_are_left_out_with_a_word(some, tmp_path):
    dear = replace(some[1], cost=700.0)
    fake = Fake(seconds=1.0)
    found = fake.results([some[0], dear, some[2]], tmp_path, budget=60.0)
    assert fake.run == [some[0].name, some[2].name]
    assert found[1][0].status == "not started"
    told = "it is predicted to take 11 min 40 s, and the budget leaves 59 s"
    assert found[1][0].message == told
    # nothing is kept of it: with more time it is run
    assert fake.all([dear], tmp_path) == [(dear.name, "done", False)]


def reference(one, name, meshes, cost, **changes):
    content = one.content | {"coupling": {"kind": "reference"}, "reference": {"meshes": meshes}}
    return replace(one, name=name, content=content, cost=cost, **changes)


@pytest.mark.parametrize(
    ("budget", "first"),
    [(None, None), (1000.0, "three"), (300.0, "two"), (150.0, "two"), (110.0, None), (5.0, None)],
)
def test_the_finest_reference_with_an_error_bar_that_leaves_time_is_run_first(some, budget, first):
    found = [
        *some,
        reference(some[0], "one mesh", 1, 10.0),
        reference(some[0], "low", 2, 20.0, scale=0.1),
        reference(some[0], "no memory", 3, 30.0, refusal="needs about 70 GB of memory"),
        reference(some[0], "two", 2, 100.0),
        reference(some[0], "three", 3, 400.0),
    ]
    chosen = reference_within(found, budget)
    assert (chosen and chosen.name) == first


def test_the_first_configuration_leaves_a_part_of_the_budget(some, tmp_path):
    fake = Fake(seconds=4.0)  # more than 0.8 · 4.5 s
    found = list(
        run_all(some, tmp_path, budget_s=4.5, launch=fake, clock=fake.clock, first=some[2])
    )
    assert fake.run == [some[2].name, some[0].name]
    statuses = [(result.configuration.name, result.status) for result, _ in found]
    assert statuses[0] == (some[2].name, "over budget")
    assert fake.now == pytest.approx(4.5)


def test_configurations_beyond_the_memory_are_refused_with_a_word(some, tmp_path):
    fake = Fake()
    large = replace(some[0], cost=float("inf"), refusal="needs about 70 GB of memory")
    ((result, _),) = fake.results([large], tmp_path)
    assert (result.status, result.message) == ("refused", "needs about 70 GB of memory")
    assert fake.run == []


def test_interrupted_runs_go_on_where_they_were(some, tmp_path):
    fake = Fake(ends={some[1].name: KeyboardInterrupt})
    with pytest.raises(KeyboardInterrupt):
        fake.all(some, tmp_path)
    again = Fake()
    assert [kept for *_, kept in again.all(some, tmp_path)] == [True, False, False]
    assert again.run == [one.name for one in some[1:]]


def test_what_ends_alike_is_not_repeated_and_what_may_not_is(some, tmp_path):
    statuses = ("refused", "not converged", "failed")
    ends = {one.name: status for one, status in zip(some, statuses, strict=True)}
    Fake(ends=ends).all(some, tmp_path)
    again = Fake()
    assert [end[1:] for end in again.all(some, tmp_path)] == [
        ("refused", True), ("not converged", True), ("done", False),
    ]  # fmt: skip


def test_configurations_of_a_changed_scene_are_run_again(some, tmp_path):
    Fake().all(some, tmp_path)
    other = configurations(Scene.load(PAPER, [*TINY, "load.approach=7 um"]))
    fake = Fake()
    fake.all([named(other, some[0].name), some[1]], tmp_path)
    assert fake.run == [some[0].name]


def test_torn_files_are_run_again(some, tmp_path):
    Fake().all(some, tmp_path)
    path = tmp_path / f"{some[0].key}.result"
    path.write_text(path.read_text(encoding="utf-8")[:-20], encoding="utf-8")
    fake = Fake()
    fake.all(some, tmp_path)
    assert fake.run == [some[0].name]


def test_result_survives_its_file(some, tmp_path):
    result = run_here(named(some, "analytic"))
    again = read_result(write_result(tmp_path / "result.json", result))
    plain = {"curves": None, "start_s": 0.0}
    assert replace(again, **plain) == replace(result, **plain)
    assert again.curves.patches == result.curves.patches
    for name in set(result.curves.__slots__) - {"patches"}:
        np.testing.assert_array_equal(getattr(again.curves, name), getattr(result.curves, name))


def test_result_is_that_of_the_scene(some):
    one = named(some, "analytic")
    result, history = run_here(one), run(one.scene)
    assert (result.status, result.exit_code, result.message) == ("done", 0, "")
    np.testing.assert_array_equal(result.curves.force, history.force_N)
    np.testing.assert_array_equal(result.curves.patch_pressure, history.patch_pressure_MPa)
    assert set(result.phases) == set(history.seconds)


def test_configuration_that_stops_keeps_its_steps(some, monkeypatch):
    whole = Run.load_steps

    def stopping(self):
        yield next(whole(self))
        raise NotConverged("load step 2", reason="LAW_RANGE", iterations=4, remedy="take care")

    monkeypatch.setattr(Run, "load_steps", stopping)
    result = run_here(some[0])
    assert (result.status, result.exit_code, result.steps) == ("not converged", 3, 1)
    assert result.message.startswith("load step 2 did not converge: LAW_RANGE after 4 iterations")


def test_refused_configuration_tells_why(some):
    scene = Scene.load(PAPER, ["patches.grid=[64, 64]", "block.cells=[8, 8, 4]"])
    result = run_here(replace(some[0], content=scene.model_dump(by_alias=True, exclude_none=True)))
    assert (result.status, result.exit_code, result.steps) == ("refused", 2, 0)
    assert "more patches than cells of the interface" in result.message


def test_process_of_its_own_gives_the_same_and_its_own_memory(some):
    one = named(some, "analytic")
    ballast = np.ones(40_000_000)  # 320 MB that the parent has, and the new process has not
    result = launch_process(one, 60.0)
    assert result.status == "done", result.message
    np.testing.assert_array_equal(result.curves.force, run_here(one).curves.force)
    assert 20.0 < result.peak_MB < 8e-6 * ballast.size
    assert result.start_s > 0.0


def test_process_is_ended_when_its_time_is_over(some, tmp_path):
    pid = tmp_path / "pid"
    code = f"import os, time; open({str(pid)!r}, 'w').write(str(os.getpid())); time.sleep(60)"
    result = launch_process(some[0], 1.0, [sys.executable, "-c", code])
    assert result.status == "over budget"
    assert result.message.endswith("which was what the budget left")
    assert 1.0 <= result.start_s
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text(encoding="utf-8")), 0)


def test_crash_is_recorded_with_its_last_words(some):
    code = "import sys; print('a line', file=sys.stderr); sys.exit('out of luck')"
    result = launch_process(some[0], None, [sys.executable, "-c", code])
    assert (result.status, result.exit_code, result.message) == ("failed", 1, "out of luck")


def test_processes_are_not_launched_from_an_mpi_job(monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    with pytest.raises(InputError, match="which cannot be launched in an MPI job"):
        check_launchable(1)


@pytest.mark.parametrize(("ranks", "text"), [(0, "is no number of"), (2, "there is no mpirun")])
def test_ranks_that_cannot_be_launched(ranks, text, monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(InputError, match=text):
        check_launchable(ranks)
