"""The phases of a run add up to its time, whichever way it is loaded."""

import itertools
import time
from importlib.metadata import PackageNotFoundError, version
from types import ModuleType

import pytest

from benchmarks.scene_inputs import BASE
from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.runs.output.results import LIBRARIES, provenance


@pytest.mark.parametrize(
    ("kind", "load"),
    [
        ("analytic", {"approach": "5 um"}),
        pytest.param("concurrent", {"force": "2 N"}, marks=pytest.mark.long),
        pytest.param("consistent", {"approach": "5 um"}, marks=pytest.mark.long),
        ("consistent", {"force": "2 N"}),
    ],
)
def test_phases_add_up(monkeypatch, kind, load):
    """A clock that counts how often it is looked at, so that nothing depends on the machine."""
    coupling = {"kind": kind} | ({"table_tolerance": 0.05} if kind == "consistent" else {})
    scene = Scene.from_dict(BASE | {"load": load | {"steps": 1}, "coupling": coupling})
    looks = itertools.count(100.0)
    monkeypatch.setattr(time, "perf_counter", lambda: next(looks))
    run = Run(scene)
    assert len(list(run.load_steps())) == 1
    elapsed = next(looks) - 101.0  # from the first look of the run to the last
    times = run.clock.times
    assert sum(times.values()) == pytest.approx(elapsed, rel=1e-12)  # sums of whole numbers
    assert {"surface", "load estimate", "load steps", "other"} <= set(times)
    assert min(times.values()) >= 0.0
    assert run.history().seconds == times


def test_versions_of_libraries_without_an_attribute(monkeypatch):
    import sys

    bare, odd = ModuleType("numpy"), ModuleType("pint")
    odd.version = ModuleType("version")
    odd.version.version = "9.9"
    run = Run(Scene.from_dict(BASE))

    def installed(name):
        if name == "pint":
            raise PackageNotFoundError(name)
        return version(name)

    for name in LIBRARIES:
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setitem(sys.modules, "numpy", bare)
    monkeypatch.setitem(sys.modules, "pint", odd)  # of a packaging without a distribution
    monkeypatch.setattr("patchlaw.multiscale.runs.output.results.version", installed)
    versions = provenance(run, options=[])["versions"]
    assert versions["numpy"][0].isdecimal()  # of the installed distribution
    assert versions["pint"] == "9.9"
    assert "unknown" not in versions.values()
