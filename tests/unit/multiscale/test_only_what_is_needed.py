"""What a scene does not ask for is not done: counted calls and modules, not only outputs."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from helpers.along import respond
from helpers.small_scene import SMALL_SCENE

from patchlaw.geometry import Asperities, PatchGrid
from patchlaw.micro import AsperityModel, HalfSpaceModel
from patchlaw.micro.asperities import hertz_pairs
from patchlaw.multiscale import Run, Scene, make_setup
from patchlaw.multiscale.cli.command_line import main
from patchlaw.multiscale.observers.step_observers import FieldRecorder
from patchlaw.multiscale.results.contacts import ContactRecord
from patchlaw.multiscale.runs.output.results import write_results

FINITE_ELEMENTS = ("dolfinx", "petsc4py", "patchlaw.macro")
PICTURES = ("matplotlib",)


def data(kind="analytic", model="half-space", grid=16, **sections):
    spectrum = {"hurst": 0.95, "waves": [2, 6], "rms_slope": 0.2, "seed": 1}
    return {
        "surface": {"spectrum": spectrum, "grid": [grid, grid], "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15},
        "micro": {"model": model},
        "coupling": {"kind": kind},
        "load": {"approach": 0.008, "steps": 2},
        "output": {"figures": False, "report": False},
    } | sections


CELLS = {"block": {"young_modulus": 4000.0, "poisson_ratio": 0.15, "cells": [4, 4, 3]}}
TETRAHEDRA, HEXAHEDRA = ({"block": CELLS["block"] | {"element": name}} for name in ("P1", "Q1"))
COMMANDS = {
    "run": ("run", data()),
    "plan": ("plan", data()),
    "accuracy": ("run", data() | {"accuracy": 0.1}),
    "conductance": ("run", data(conductance={"conductivity": ["50 W/m/K"]})),
    "concurrent": ("run", data("concurrent", **TETRAHEDRA)),
    "hexahedra": ("run", data("isolated", patches={"grid": [2, 1]}, **HEXAHEDRA)),
    "tetrahedra": ("run", data("isolated", patches={"grid": [2, 1]}, **TETRAHEDRA)),
    "surface": ("surface", data()),
}
"""What one process is asked for in turn. Modules stay: what comes later may load more, not less."""


@pytest.fixture(scope="module")
def loaded(tmp_path_factory) -> dict[str, set[str]]:
    """Return the modules that a process has loaded after each of its commands."""
    folder, words = tmp_path_factory.mktemp("commands"), []
    for name, (command, given) in COMMANDS.items():
        scene = folder / f"{name}.toml"
        lines = [f"{key} = {_toml(section)}" for key, section in given.items()]
        scene.write_text("\n".join(lines))
        out = ["--out", str(folder / name)] if command != "plan" else []
        words.append([command, str(scene), *out])
    code = (
        "import json, sys\nfrom patchlaw.multiscale.cli.command_line import main\n"
        f"for words in {words!r}:\n"
        "    code = main(words)\n"
        "    print(json.dumps([code, sorted(sys.modules)]))"
    )
    # without what MPI has put into this process behind Python's back
    environment = os.environ | {"PATCHLAW_CACHE": "off"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment, capture_output=True, text=True, check=True, timeout=240,
    )  # fmt: skip
    told = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[0, [")]
    return dict(zip(COMMANDS, (set(names) for _, names in told), strict=True))


def _toml(value) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(part)}" for key, part in value.items()) + " }"
    return json.dumps(value)


def test_modules_are_loaded_by_what_takes_them_alone(loaded):
    """No finite elements but for tetrahedra and natural modes; laws and pictures where asked."""
    for name in ("plan", "run", "accuracy"):
        assert not loaded[name].intersection(FINITE_ELEMENTS + PICTURES), name
    rest = "models.measured_errors.samples", "models.loaded_patches", "runs.output.view"
    unused = {f"patchlaw.multiscale.{name}" for name in rest}
    names = {name for name in loaded["run"] if name.startswith("patchlaw.multiscale.laws.")}
    assert not names | (loaded["run"] & unused)
    for name in ("concurrent", "hexahedra"):
        assert not loaded[name].intersection(("dolfinx", "petsc4py")), name
    assert {"dolfinx", "petsc4py"} <= loaded["tetrahedra"]
    vibration = {"patchlaw.multiscale.observers.vibration", "patchlaw.macro.eigenmodes"}
    assert not loaded["tetrahedra"] & (vibration | set(PICTURES))
    assert loaded["surface"].issuperset(PICTURES)


def never(*given, **options):
    raise AssertionError("this was not asked for")


def test_only_the_force_curve(monkeypatch, tmp_path):
    monkeypatch.setattr(FieldRecorder, "write", never)
    monkeypatch.setattr(HalfSpaceModel, "stiffness", never)
    block, output = data()["block"] | {"cells": [4, 4, 4]}, data()["output"] | {"contact": "none"}
    run = Run(Scene.from_dict(data("concurrent", block=block, output=output)))
    assert len(list(run.load_steps())) == 2
    names = {path.name for path in write_results(tmp_path, run, options=[])}
    assert names == {"history.csv", "patches.csv", "provenance.json"}
    assert "output" not in run.clock.seconds  # no figure was drawn


def test_a_contact_is_worked_out_for_the_last_load_step_alone(monkeypatch):
    made, steps = [], []
    of = ContactRecord.of
    monkeypatch.setattr(
        ContactRecord, "of", lambda *given, **other: made.append(given) or of(*given, **other)
    )
    stiffness = HalfSpaceModel.stiffness
    monkeypatch.setattr(
        HalfSpaceModel, "stiffness",
        lambda *given, **other: steps.append(given) or stiffness(*given, **other),
    )  # fmt: skip
    run = Run(Scene.from_dict(data()))
    list(run.load_steps())
    assert len(made) == 1
    assert len(steps) == 2


LOADS = {
    "approach": {"approach": 0.008, "steps": 2},
    "force": {"force": [1.0, 2.0], "steps": 2},
    "free tilt": {"approach": 0.008, "tilt": "free"},
}


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("kind", ["analytic", "isolated", "consistent", "concurrent"])
def test_a_plan_solves_nothing_of_the_scene(monkeypatch, kind, load):
    """No contact problem, under a force neither. Isolated laws end where a force presses them."""
    if kind != "isolated" or load == "approach":
        monkeypatch.setattr(HalfSpaceModel, "press", never)
    monkeypatch.setattr("patchlaw.multiscale.bodies.bodies.Bodies.contact_face", never)
    monkeypatch.setattr("patchlaw.multiscale.bodies.face_terms.FaceTerms.face", never)
    monkeypatch.setattr("patchlaw.multiscale.models.cell_coupling.on_body", never)
    monkeypatch.setattr("patchlaw.multiscale.models.coupling.Coupling.make_laws", never)
    setup = make_setup(Scene.from_dict(data(kind, grid=128, load=LOADS[load])))
    said = dict(setup.about.statements(setup.about.memory_statement(1e8, 1)))
    assert {"memory", "load", "coupling", "contact"} <= set(said)
    assert all(isinstance(text, str) for text in setup.about.warnings())


def test_patches_out_of_reach_build_no_law():
    given = data("isolated", patches={"grid": [4, 4]}, load={"approach": 0.003, "steps": 1})
    run = Run(Scene.from_dict(given))
    reached = run.coupling.parts.interfering_patches
    assert 0 < reached < 16
    assert sum(not law.is_open for law in run.make_laws().laws) == reached


def summits(below: int) -> Asperities:
    """Return three summits within reach, and others far below."""
    random = np.random.default_rng(3)
    x, y = random.uniform(0.1, 0.9, (2, 3 + below))
    z = np.concatenate(([0.0, -0.001, -0.002], np.full(below, -0.5)))
    radius = np.full(3 + below, 0.2)
    return Asperities(
        x=x, y=y, z=z, radius_major=radius, radius_minor=radius, angle=0.0 * radius,
        lengths=(1.0, 1.0), highest=0.0, mean_height=-0.1,
    )  # fmt: skip


def evaluations(monkeypatch, below: int) -> int:
    """Return how many pairs of summits a load takes."""
    counted = [0]
    field = hertz_pairs.circular_field

    def watched(*given, **options):
        counted[0] += int(np.prod(np.broadcast_shapes(*(np.shape(part) for part in given))))
        return field(*given, **options)

    with monkeypatch.context() as patch:
        patch.setattr(hertz_pairs, "circular_field", watched)
        model = AsperityModel("circular", summits(below), contact_modulus=1.0)
        whole = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
        respond(model, [0.002, 0.004], patches=whole, mean_heights=[-0.1])
    return counted[0]


def test_summits_out_of_reach_cost_nothing(monkeypatch):
    alone = evaluations(monkeypatch, 0)
    assert alone > 0
    assert evaluations(monkeypatch, 40) == alone


def test_a_run_writes_what_it_took(tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(SMALL_SCENE)
    assert main(["run", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "results")]) == 0
    printed = capsys.readouterr().out
    assert ": surface" in printed.partition("took ")[2]
    assert "memory" in printed


def test_hardness_and_conductance_cost_nothing_where_nobody_asks(loaded, monkeypatch):
    """No plastic depth, no second stiffness, and none of the modules that make them."""
    modules = {"patchlaw.multiscale.observers.interface", "patchlaw.micro.transport"}
    leak = {
        "patchlaw.multiscale.observers.leak",
        "patchlaw.micro.transport",
        "patchlaw.multiscale.results.figures.observed",
    }
    assert not (modules | leak) & loaded["run"]
    assert modules <= loaded["conductance"]
    monkeypatch.setattr(HalfSpaceModel, "unloading_stiffness", None)
    unchecked = {"output": {"check": "none"}}
    scenes = data(**unchecked), data(micro={"hardness": 1e9}, **unchecked)
    products = [
        sum(step.newton_iterations for step in Run(Scene.from_dict(one)).load_steps())
        for one in scenes
    ]
    assert products[0] == products[1]  # which a hardness that nothing bears does not change
