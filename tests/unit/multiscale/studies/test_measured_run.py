"""Configurations one after another: budget, interruption, stored results, what a run takes."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from patchlaw.macro.compliance.cache import cache_directory
from patchlaw.micro.boundary_elements.grid_compliance import _half_space
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene_run import Run, run
from patchlaw.multiscale.studies import comparison
from patchlaw.multiscale.studies.comparison import compare, reference_within
from patchlaw.multiscale.studies.configurations import Configuration, configurations
from patchlaw.multiscale.studies.measured_run import measured_run
from patchlaw.multiscale.studies.running import CaseResult
from patchlaw.support.errors import InputError, NotConverged

PAPER = Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml"
TINY = ["surface.grid=[32, 32]", "load.steps=2", "patches.grid=[2, 2]"]
SCENE = Scene.load(PAPER, TINY)


@pytest.fixture
def only(monkeypatch):
    """Return the function that sets the configurations which a comparison has."""
    return lambda *ones: monkeypatch.setattr(comparison, "configurations", lambda *_: list(ones))


@pytest.fixture(scope="module")
def every():
    """All configurations of the scene."""
    return configurations(SCENE)


@pytest.fixture
def some(only, every):
    """Three configurations by summits, which are all that comparisons have here."""
    found = [one for one in every if one.kind == "analytic"][:3]
    only(*found)
    return found


class Fake:
    """Stands for runs: counts them, takes time on its own clock, and ends as it is told."""

    def __init__(self, monkeypatch, seconds=1.0, ends=None):
        self.now, self.seconds, self.ends, self.run = 0.0, seconds, ends or {}, []
        monkeypatch.setattr(comparison.time, "monotonic", lambda: self.now)

    def __call__(self, one, comm, seconds):
        self.run.append(one.name)
        end = self.ends.get(one.name, "done")
        if end is KeyboardInterrupt:
            raise KeyboardInterrupt
        if self.seconds > seconds:
            self.now += seconds
            return CaseResult(status="over budget")
        self.now += self.seconds
        return CaseResult(status=end, measured={"phases": {"laws": self.seconds}, "cpu_s": 1.0})

    def all(self, folder=None, budget=None):
        """Return how all configurations ended, the cheapest first."""
        found = compare(SCENE, solve=self, folder=folder, budget_s=budget)
        return [row.status for row in found.rows]


def test_budget_ends_one_configuration_and_starts_no_more(some, tmp_path, monkeypatch):
    fake = Fake(monkeypatch, seconds=2.0)
    assert fake.all(tmp_path, budget=3.0) == ["done", "over budget", "not started"]
    assert fake.run == [one.name for one in some[:2]]
    # with another budget only what has no result is run
    again = Fake(monkeypatch, seconds=2.0)
    assert again.all(tmp_path, budget=5.0) == ["done", "done", "done"]
    assert again.run == [one.name for one in some[1:]]


def test_configurations_beyond_the_budget_are_left_out_with_a_word(
    some, only, tmp_path, monkeypatch
):
    only(some[0], some[2], replace(some[1], cost=700.0))
    fake = Fake(monkeypatch)
    *_, last = compare(SCENE, solve=fake, folder=tmp_path, budget_s=60.0).rows
    assert fake.run == [some[0].name, some[2].name]
    told = "it is predicted to take 11 min 40 s, and the budget leaves 58 s"
    assert (last.status, last.result.failure) == ("not started", told)
    # nothing is kept of it: with more time it is run
    assert Fake(monkeypatch).all(tmp_path) == ["done", "done", "done"]


def reference(name, meshes, cost):
    scene = SCENE.with_({"coupling": {"kind": "reference"}, "reference.meshes": meshes})
    return Configuration(name=name, scene=scene, cost=cost)


@pytest.mark.parametrize(
    ("budget", "first"), [(None, None), (1000.0, "three"), (300.0, "two"), (150.0, None)]
)
def test_the_finest_reference_with_an_error_bar_that_leaves_time_is_run_first(
    some, only, monkeypatch, budget, first
):
    found = [
        *some,
        reference("one mesh", 1, 10.0),
        reference("two", 2, 100.0),
        reference("three", 3, 400.0),
        reference("no memory", 3, float("inf")),
    ]
    chosen = reference_within(found, budget)
    assert (chosen and chosen.name) == first
    only(*found)
    fake = Fake(monkeypatch)
    compare(SCENE, solve=fake, budget_s=budget)
    assert fake.run[0] == (first or some[0].name)


def test_the_first_configuration_leaves_a_part_of_the_budget(some, only, monkeypatch):
    only(*some, reference("two", 2, 2.0))
    fake = Fake(monkeypatch, seconds=4.0)  # more than 0.8 · 4.5 s
    assert fake.all(budget=4.5) == ["over budget", "not started", "not started", "over budget"]
    assert fake.run == ["two", some[0].name]
    assert fake.now == pytest.approx(4.5)


def test_interrupted_comparisons_go_on_where_they_were(some, tmp_path, monkeypatch):
    fake = Fake(monkeypatch, ends={some[1].name: KeyboardInterrupt})
    with pytest.raises(KeyboardInterrupt):
        fake.all(tmp_path)
    again = Fake(monkeypatch)
    again.all(tmp_path)
    assert again.run == [one.name for one in some[1:]]


def test_what_ends_alike_is_not_repeated_and_what_may_not_is(some, tmp_path, monkeypatch):
    statuses = ("refused", "not converged", "failed")
    ends = {one.name: status for one, status in zip(some, statuses, strict=True)}
    Fake(monkeypatch, ends=ends).all(tmp_path)
    again = Fake(monkeypatch)
    assert again.all(tmp_path) == ["refused", "not converged", "done"]
    assert again.run == [some[2].name]


def test_configurations_of_a_changed_scene_are_run_again(some, only, tmp_path, monkeypatch):
    Fake(monkeypatch).all(tmp_path)
    other = some[0].scene.with_({"load.approach": "7 um"})
    only(Configuration(name=some[0].name, scene=other, cost=some[0].cost), *some[1:])
    fake = Fake(monkeypatch)
    fake.all(tmp_path)
    assert fake.run == [some[0].name]


def test_torn_files_are_run_again_and_damaged_ones_refused(some, tmp_path, monkeypatch):
    Fake(monkeypatch).all(tmp_path)
    path = tmp_path / "cases" / "1-of-1" / "rank-0.cases"
    whole = path.read_bytes()
    path.write_bytes(whole[:-20])
    fake = Fake(monkeypatch)
    fake.all(tmp_path)
    assert fake.run == [some[2].name]
    path.write_bytes(whole.replace(b"laws", b"lows"))
    with pytest.raises(InputError, match=r"is damaged.*its cases are computed again"):
        fake.all(tmp_path)


def test_result_is_that_of_the_scene_and_survives_its_file(some, tmp_path):
    one = some[0]
    result, history = measured_run(one), run(one.scene)
    assert (result.status, result.failure, result.measured["exit_code"]) == ("done", "", 0)
    np.testing.assert_array_equal(result.arrays["force"], history.force_N)
    np.testing.assert_array_equal(result.arrays["patch_pressure"], history.patch_pressure_MPa)
    assert set(result.measured["phases"]) == set(history.seconds)
    first, again = (compare(SCENE, folder=tmp_path).rows[0] for _ in range(2))
    assert first.record() == again.record()  # times too: it was not run again
    for name, values in first.curves.items():
        np.testing.assert_array_equal(again.curves[name], values)


def test_no_earlier_run_has_made_what_a_run_takes(monkeypatch):
    monkeypatch.setenv("PATCHLAW_CACHE", "/somewhere")
    folders, made, whole = [], [], Run.load_steps

    def watched(run):
        folders.append(cache_directory())
        return whole(run)

    monkeypatch.setattr(Run, "load_steps", watched)
    scene = SCENE.with_({"coupling.kind": "analytic", "micro.model": "half-space"})
    for _ in range(2):
        measured_run(Configuration(name="", scene=scene))
        made.append(_half_space.cache_info().misses)  # of this run alone
    assert made[0] == made[1] > 0
    assert set(folders) == {None}
    assert os.environ["PATCHLAW_CACHE"] == "/somewhere"


def test_configuration_that_stops_keeps_its_steps(some, monkeypatch):
    whole = Run.load_steps

    def stopping(self):
        yield next(whole(self))
        raise NotConverged("load step 2", reason="LAW_RANGE", iterations=4, remedy="take care")

    monkeypatch.setattr(Run, "load_steps", stopping)
    result = measured_run(some[0])
    assert (result.status, result.measured["exit_code"]) == ("not converged", 3)
    assert len(result.arrays["force"]) == 1
    assert result.failure.startswith("load step 2 did not converge: LAW_RANGE after 4 iterations")


def test_configuration_ends_with_the_load_step_in_which_its_time_is_over(some):
    result = measured_run(some[0], seconds=1e-9)
    assert result.status == "over budget"
    assert result.failure.endswith("which was what the budget left")


def test_a_crash_is_recorded_with_its_last_words(some, monkeypatch):
    whole = Run.load_steps

    def crashing(self):
        if self.scene.surface.grid == (32, 32):  # after the small one
            raise RuntimeError("out of luck")
        return whole(self)

    monkeypatch.setattr(Run, "load_steps", crashing)
    result = measured_run(some[0])
    assert (result.status, result.measured["exit_code"]) == ("failed", 1)
    assert result.failure == "out of luck"


def test_refused_configuration_tells_why():
    scene = Scene.load(PAPER, ["patches.grid=[64, 64]", "block.cells=[8, 8, 4]"])
    result = measured_run(Configuration(name="", scene=scene))
    assert (result.status, result.measured["exit_code"]) == ("refused", 2)
    assert "more patches than cells of the interface" in result.failure
    assert result.arrays == {}
