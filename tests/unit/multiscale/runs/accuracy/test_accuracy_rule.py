"""What an accuracy chooses, beside every stated key of every coupling, and what is said of it."""

from __future__ import annotations

import json
import time
from dataclasses import replace

import pytest

from patchlaw.multiscale import Run, Scene, console, make_setup, resolve
from patchlaw.multiscale.machine import ClusterNodes
from patchlaw.multiscale.runs import refining
from patchlaw.multiscale.runs.output.report import report_html
from patchlaw.multiscale.runs.output.results import provenance
from patchlaw.multiscale.runs.resolving import SOLUTIONS_OF_LAWS, chosen_coupling
from patchlaw.support import InputError
from patchlaw.support.readable import Caution

SPECTRUM = {"hurst": 0.87, "waves": [2, 5], "rms_slope": 0.1883, "seed": 3}
STATED = {
    "cells": {"surface": {"grid": [40, 40]}, "micro": {"model": "half-space"}},
    "all": {"surface": {"grid": [40, 40]}, "micro": {"model": "half-space"},
            "patches": {"grid": [3, 2]}, "reference": {"fine": 0.05}},
}  # fmt: skip


def scene(kind="open", error=0.03, **sections):
    given = {
        "accuracy": error,
        "surface": {"spectrum": SPECTRUM, "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4037.0, "poisson_ratio": 0.21},
        "load": {"approach": 0.0061, "steps": 2},
        "output": {"figures": False},
    }
    if kind != "open":
        given["coupling"] = {"kind": kind}
    for name, section in sections.items():
        given[name] = given.get(name, {}) | section
    return Scene.from_dict({key: value for key, value in given.items() if value is not None})


def made(given, nodes=None, **options):
    return make_setup(resolve(given, nodes=nodes, **options), nodes=nodes)


def mesh_error(setup):
    """An error of third order in the edges, 1 % at 25 µm."""
    return 0.01 * (float(setup.rough_meshes.sizes[-1]) / 0.025) ** 3


RUNS = {
    "analytic": {}, "concurrent": {}, "consistent": {"coupling": {"table_tolerance": 0.01}},
    "isolated": {"block": {"cells": [6, 6, 4]}}, "reference": {},
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "force"),
    # under a force the measure of a reference is another one
    [*((kind, False) for kind in RUNS), ("analytic", True), ("reference", True)],
)
def test_an_accuracy_that_stated_keys_do_not_keep_is_said_everywhere(kind, force, capsys):
    """With everything stated nothing is refined; every coupling's own measure decides."""
    load = {"approach": None, "force": 1.037} if force else {}
    run = Run(scene(kind, 1e-5, **STATED["all"], **RUNS[kind], load=load))
    assert run.given.open_keys == frozenset()
    list(run.load_steps())
    history = run.history()
    verdict, last = history.accuracy, history.steps[-1]
    assert verdict.kept is False
    if kind == "reference" and not force:
        expected = last.force_error_N / last.force_N
    elif kind == "reference":
        expected = 1.5 * last.approach_error_mm / last.approach_mm
    else:
        expected = sum(error for _, error in last.errors) / last.force_N
    assert verdict.error == pytest.approx(expected, rel=1e-12) and verdict.error > 1e-5
    (said,) = [note for note in history.notes if "accuracy" in note]
    assert isinstance(said, Caution) and "accuracy of 0.001 % is not kept" in said
    if kind == "isolated":  # cut contacts outweigh all else
        assert "most of it by laws" in said
    recorded = provenance(run, options=[])["accuracy"]
    assert recorded["kept"] is False and recorded["error"] == verdict.error
    assert f'<p class="warning">{said}</p>' in report_html(run, {}, provenance(run, options=[]))
    console.show_history(None, history)
    assert "caution: the accuracy of 0.001 % is not kept" in " ".join(
        capsys.readouterr().out.split()
    )
    run.close()


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "sections", "why"),
    [
        ("analytic", {"output": {"check": "none"}}, "output.check = 'none'"),
        ("consistent", {"error": 0.3, "output": {"check": "none"}}, "output.check = 'none'"),
        ("analytic", {"micro": {"model": "circular"}}, "circular contacts have no measure of it"),
        ("isolated", {"micro": {"model": "elliptic-independent"}}, "contacts have no measure"),
        ("reference", {"reference": {"meshes": 1, "fine": 0.08}}, "one mesh has no error bar"),
        ("concurrent", {"load": {"approach": 1e-7}}, "no load step has a force"),
    ],
)
def test_an_error_that_is_not_measured_is_said(kind, sections, why):
    stated = {"surface": {"grid": [40, 40]}, "block": {"cells": [4, 4, 3]}}
    run = Run(scene(kind, **stated | sections))
    list(run.load_steps())
    history = run.history()
    assert history.accuracy.kept is None and history.accuracy.error is None
    (said,) = [note for note in history.notes if "accuracy" in note]
    assert isinstance(said, Caution) and "is not known" in said and why in said
    assert provenance(run, options=[])["accuracy"]["kept"] is None
    run.close()


def test_an_accuracy_that_is_kept_is_said_without_a_caution():
    run = Run(scene("analytic", 0.2, **STATED["cells"]))
    assert run.history().accuracy.kept is None  # before the first load step
    list(run.load_steps())
    history = run.history()
    assert history.accuracy.kept and 0.0 < history.accuracy.error < 0.2
    (said,) = [note for note in history.notes if "accuracy" in note]
    assert said.startswith("accuracy of 20 % kept") and not isinstance(said, Caution)
    assert Run(scene("analytic", None, **STATED["cells"])).history().accuracy is None


def test_laws_are_chosen_where_they_take_fewer_solutions():
    for steps, kind in ((SOLUTIONS_OF_LAWS, "concurrent"), (SOLUTIONS_OF_LAWS + 1, "consistent")):
        chosen, why = chosen_coupling(scene(load={"steps": steps}))
        assert chosen == kind
        assert f"about {SOLUTIONS_OF_LAWS} contact problems" in why and f"{steps} load" in why


@pytest.mark.parametrize(("coupling", "kind"), [
    pytest.param({"interface": "pointwise"}, "consistent", marks=pytest.mark.long),
    ({"table_tolerance": 0.01}, "consistent"), ({}, "concurrent"),
])  # fmt: skip
def test_keys_of_laws_choose_laws(coupling, kind):
    given = scene(error=0.4, surface={"grid": [48, 48]}, coupling=coupling)
    assert chosen_coupling(given)[0] == kind
    assert made(given).scene.coupling.kind == kind


def test_a_coupling_that_other_sections_refuse_is_not_chosen():
    """Laws of a hardness know rising loads alone, however many load steps there are."""
    load = {"approach": [0.006, 0.001], "steps": 2 * SOLUTIONS_OF_LAWS}
    free = scene(load=load, surface={"grid": [48, 48]}, coupling={"kind": "concurrent"})
    hard = free.with_({"micro.hardness": 400.0})
    opened = replace(hard, coupling=replace(hard.coupling, kind="consistent"))
    assert chosen_coupling(free)[0] == "consistent"
    assert chosen_coupling(opened)[0] == "concurrent"


def chosen(steps):
    given = scene(load={"steps": steps})
    return json.dumps(resolve(given).written, sort_keys=True)


@pytest.mark.long
@pytest.mark.parametrize(("steps", "kind"), [(2, "concurrent"), (200, "consistent")])
def test_a_choice_does_not_know_how_fast_the_machine_is(monkeypatch, steps, kind):
    """Clocks that run slow or fast, threads: the resolved sections are the same text."""
    known = chosen(steps)
    assert json.loads(known)["coupling"]["kind"] == kind
    for name in ("perf_counter", "monotonic", "process_time", "time"):
        clock = getattr(time, name)
        monkeypatch.setattr(time, name, lambda clock=clock: 1e3 * clock())
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    assert chosen(steps) == known


HARD = 2e-4
"""An accuracy that finite slopes alone exceed, on any cells."""


def test_a_choice_does_not_know_how_much_memory_there_is(monkeypatch):
    """The rule's meshes are taken, or refused with what they need; no other way is taken."""
    monkeypatch.setattr(refining, "TRIALS", 1)  # of cells
    given = scene(error=HARD)
    chosen = made(given, mesh_error=lambda setup: 1e-4)
    assert chosen.scene.kind == "reference"
    with pytest.raises(InputError, match=r"reference needs about .* GB of memory"):
        made(given, nodes=ClusterNodes(memory=3e7), mesh_error=lambda setup: 1e-4)


def test_meshes_of_more_unknowns_than_are_chosen_are_not(monkeypatch):
    monkeypatch.setattr(refining, "MOST_UNKNOWNS", 1000)
    monkeypatch.setattr(refining, "TRIALS", 1)
    setup = made(scene(error=HARD), mesh_error=lambda setup: 1e-4)
    assert setup.scene.kind == "concurrent"
    assert not setup.parts.decision.kept and "is not kept" in setup.parts.decision.warning


def test_a_spectrum_needs_no_grid_beside_an_accuracy():
    assert "surface.grid" in scene("analytic").open_keys
    assert made(scene("analytic")).parts.surface.grid
    with pytest.raises(InputError, match="a 'spectrum' needs 'grid' and 'lengths' beside it"):
        scene("analytic", None)
