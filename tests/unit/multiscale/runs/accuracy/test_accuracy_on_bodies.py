"""What an accuracy chooses on bodies from meshes and under laws of samples; whether it holds."""

from __future__ import annotations

import json

import numpy as np
import pytest
from helpers.box_msh import write_box

from patchlaw.multiscale import Run, Scene, make_setup, resolve, run
from patchlaw.multiscale.runs import refining
from patchlaw.support.readable import Caution

CONSTANTS = {"young_modulus": 4037.0, "poisson_ratio": 0.21}
SPECTRUM = {"hurst": 0.87, "waves": [2, 5], "rms_slope": 0.12, "seed": 3}
HELD = [{"surface": "bottom"}]
QUIET = {"figures": False, "report": False, "contact": "none"}
SAMPLE = {"spectrum": {**SPECTRUM, "rms_slope": 0.05}, "lengths": [0.023, 0.023]}


def made(scene):
    return make_setup(resolve(scene))


def box(folder, sides, cells, **options):
    """Write a box whose top is the plane z = 0."""
    ticks = [np.linspace(0.0, side, count + 1) for side, count in zip(sides, cells, strict=True)]
    return write_box(folder / f"{cells}.msh", (*ticks[:2], ticks[2] - sides[2]), **options)


def on_mesh(mesh, **keys):
    return {"mesh": str(mesh), "contact": "top", "supports": HELD, **CONSTANTS, **keys}


def whole_surface(**sections):
    """A scene whose surface covers the face, with all open that can be."""
    given = {
        "accuracy": 0.05,
        "surface": {"spectrum": SPECTRUM, "lengths": [1.0, 1.0]},
        "load": {"approach": 0.0061, "steps": 1},
        "output": QUIET,
    }
    return Scene.from_dict(given | sections)


def of_sample(**sections):
    """The same with laws of samples."""
    given = {"surface": SAMPLE, "law": {"kind": "representative"}}
    load = {"pressure": 3.7, "steps": 2, "zero": "mean plane"}
    return whole_surface(**{**given, "load": load, **sections})


@pytest.fixture(scope="module")
def cube(tmp_path_factory):
    return box(tmp_path_factory.mktemp("cube"), (1.0, 1.0, 1.0), (5, 5, 5))


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """A plate on a part of its rear, on a coarse mesh."""
    folder = tmp_path_factory.mktemp("plate")
    return box(folder, (3.0, 1.0, 0.5), (6, 2, 1))


@pytest.mark.slow
def test_a_cube_from_a_file_is_chosen_for_as_the_block_is(cube):
    found = []
    for body in ({"block": CONSTANTS}, {"body": on_mesh(cube)}):
        whole = Run(whole_surface(**body))
        (step,) = whole.load_steps()
        decision = whole.scene.decision
        found.append((whole.coupling, decision, step))
        verdict = whole.history().accuracy
        assert verdict.kept and decision.kept
        assert verdict.error == pytest.approx(decision.error, rel=0.1)
        whole.close()
    (block, by_block, step), (body, by_body, other) = found
    assert body.scene.coupling.kind == block.scene.coupling.kind == "concurrent"
    assert body.parts.surface.grid == block.parts.surface.grid
    assert body.scene.patches.grid == block.scene.patches.grid == (8, 8)
    assert body.scene.body.refinements == 0
    assert by_body.errors.keys() == by_block.errors.keys()
    assert by_body.errors["grid"] == pytest.approx(by_block.errors["grid"], rel=0.05)
    # a mesh of 5³ quadratic hexahedra against spectral elements
    off = abs(other.force_N / step.force_N - 1.0)
    assert 1e-6 < off < 1.5 * by_body.errors["body"]


@pytest.mark.slow
def test_a_mesh_is_refined_until_what_the_body_adds_is_known(plate):
    ends = [{"surface": "left"}, {"surface": "right"}]
    keys = {"micro": {"model": "half-space"}, "surface": {**SURFACE, "grid": [40, 40]}}
    given = whole_surface(accuracy=0.02, body=on_mesh(plate, supports=ends), **keys)
    assert given.open_keys >= {"body.refinements", "coupling.kind"}
    chosen = made(given)
    times = chosen.scene.body.refinements
    stated = made(given.with_({"body.refinements": times - 1}))
    assert times > 0 and chosen.parts.body.unknowns > stated.parts.body.unknowns
    assert chosen.scene.decision.errors["body"] < stated.scene.decision.errors["body"]
    assert chosen.scene.decision.trials == times + 1


SURFACE = {"spectrum": SPECTRUM, "lengths": [1.0, 1.0]}


@pytest.mark.slow
def test_elements_heights_and_rows_are_chosen_by_the_errors_of_load_steps(plate):
    given = of_sample(accuracy=0.02, body=on_mesh(plate))
    assert given.open_keys == {
        "surface.grid", "micro.finite_slopes", "body.element", "body.refinements"
    }  # fmt: skip
    whole = Run(given)
    steps = list(whole.load_steps())
    verdict, decision = whole.history().accuracy, whole.scene.decision
    assert verdict.kept and decision.kept
    assert verdict.error == pytest.approx(decision.error, rel=0.02)
    assert whole.coupling.table_tolerance == pytest.approx(0.002, rel=1e-12)
    chosen = whole.scene
    finer = {
        "accuracy": None,
        "surface.grid": [3 * n for n in chosen.surface.grid],
        "body.refinements": chosen.body.refinements + 1,
        "body.element": "quadratic",
        "coupling.table_tolerance": 2e-4,
        "load.approach": whole.history().approach_mm[-1],
        "output.check": "none",
    }
    true = run(given.with_(finer)).steps[-1].force_N
    off = abs(steps[-1].force_N / true - 1.0)
    assert 1e-6 < off < 1.5 * verdict.error
    again = given.with_(json.loads(json.dumps(whole.resolved)))
    assert resolve(again) is again and again == whole.scene and again.decision is None
    whole.close()


@pytest.mark.long
def test_tighter_accuracies_take_finer_meshes_and_say_what_they_took(plate):
    found = [made(of_sample(accuracy=a, body=on_mesh(plate))) for a in (0.3, 0.004)]
    coarse, fine = found
    assert coarse.parts.body.unknowns < fine.parts.body.unknowns
    assert coarse.scene.body.element == "linear" and fine.scene.body.element == "quadratic"
    assert fine.scene.body.refinements > coarse.scene.body.refinements == 0
    assert coarse.parts.surface.grid <= fine.parts.surface.grid
    said = dict(fine.about.statements())["choice"]
    assert "quadratic elements on" in said


@pytest.mark.slow
def test_what_the_unknowns_do_not_reach_is_said_not_to_be_kept(plate, monkeypatch):
    monkeypatch.setattr(refining, "MOST_UNKNOWNS", 500)
    history = run(of_sample(accuracy=0.001, body=on_mesh(plate)))
    assert history.accuracy.kept is False
    (said,) = [note for note in history.notes if "accuracy" in note]
    assert isinstance(said, Caution) and "most of it by mesh" in said


@pytest.mark.slow
def test_finite_slopes_are_taken_into_account_where_they_matter(plate):
    steep = {**SAMPLE, "spectrum": {**SPECTRUM, "rms_slope": 0.2}}
    load = {"pressure": 3.7, "steps": 1}
    found = [
        made(of_sample(accuracy=accuracy, body=on_mesh(plate), surface=steep, load=load))
        for accuracy in (0.2, 0.003)
    ]
    assert [bool(setup.scene.micro.finite_slopes) for setup in found] == [False, True]
    stated = {"model": "half-space", "finite_slopes": False}
    given = of_sample(body=on_mesh(plate), surface=steep, load=load, micro=stated)
    assert made(given).scene.micro.finite_slopes is False


@pytest.mark.slow
def test_a_block_under_laws_of_samples_gets_cells_and_elements():
    block = {**CONSTANTS, "lengths": [3.0, 1.0], "height": 0.5}
    given = of_sample(accuracy=0.03, block=block)
    assert given.open_keys >= {"block.cells", "block.element"}
    setup = made(given)
    assert setup.scene.decision.kept and setup.scene.block.element in ("Q1", "Q2")
    stated = made(given.with_({"block.cells": [6, 3, 2], "block.element": "Q1"}))
    assert stated.scene.block.cells == (6, 3, 2) and stated.scene.block.element == "Q1"


@pytest.mark.slow
def test_every_stage_is_looked_at(plate):
    """Bolts bend the plate most in the first stage, under which the plane presses least."""
    pull = [{"surface": "left", "pull": "5 N"}]
    stages = [{"force": 0.4, "body": {"pretension": pull}}, {"force": 10.0}]
    load = {"stage": stages, "steps": 3}
    setup = made(of_sample(accuracy=0.05, body=on_mesh(plate), load=load))
    alone = made(of_sample(accuracy=0.05, body=on_mesh(plate), load={"force": 10.0}))
    assert setup.scene.decision.errors != alone.scene.decision.errors
    assert [step.stage for step in setup.parts.path.turning_points] == [1, 2]


@pytest.mark.slow
def test_bodies_on_both_sides_are_refined_where_that_is_open(plate, tmp_path):
    other = box(
        tmp_path, (3.0, 1.0, 0.5), (4, 2, 1), turn=np.diag([1.0, -1.0, -1.0]), shift=(0, 1, 0)
    )
    counter = {**on_mesh(other), "refinements": 0}
    given = of_sample(accuracy=0.004, body=on_mesh(plate), counter_body=counter)
    setup = made(given)
    assert setup.scene.body.refinements > 0 == setup.scene.counter_body.refinements
    assert setup.scene.body.element == setup.scene.counter_body.element == "quadratic"
