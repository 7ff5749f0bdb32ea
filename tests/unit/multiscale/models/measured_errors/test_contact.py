"""Errors of load steps as runs measure and tell them: by cause, and against finer solutions."""

from __future__ import annotations

import csv
import json
import math
import re
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from patchlaw.geometry import Control, Spectrum, mirrored, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.half_space.error_probe import ErrorProbe, read
from patchlaw.multiscale import Run, Scene, run
from patchlaw.multiscale.loading.load_step import COLUMNS
from patchlaw.multiscale.models.measured_errors.errors import MeasuredErrors, error_columns
from patchlaw.multiscale.results.files import history_files, write_files
from patchlaw.multiscale.runs.output.results import write_results
from patchlaw.support import NotConverged
from patchlaw.support.readable import quantity, with_error


def scene(kind="analytic", grid=40, *, check="last", load=None, seed=4, **micro):
    spectrum = {"hurst": 0.9, "waves": [2, 5], "rms_slope": 0.2, "seed": seed}
    laws = {"table_tolerance": 0.01} if kind in ("consistent", "isolated") else {}
    return Scene.from_dict({
        "surface": {"spectrum": spectrum, "grid": [grid, grid], "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15, "cells": [8, 8, 6]},
        "patches": {"grid": [2, 2]},
        "micro": {"model": "half-space"} | micro,
        "coupling": {"kind": kind} | laws,
        "load": load or {"approach": 0.006, "steps": 2},
        "output": {"check": check, "figures": False},
    })  # fmt: skip


def test_samples_of_mirror_images_err_alike_whichever_comes_first():
    spectrum = Spectrum(hurst=0.7, rms_slope=0.2, waves=(2, 4), seed=9)
    whole = synthesise(spectrum, grid=(30, 32), lengths=(1.7, 1.3))
    surface = mirrored(replace(whole, heights=whole.heights[:15, :14], periodic=False))
    found = []
    for one in (surface, surface.shifted(15, 14)):
        model = HalfSpaceModel(one, contact_modulus=3.3e3, periodic=True)
        at = model.press(Control(force=73.0))
        asked = read(at), at.approach, (0.0, 0.0)
        stiffnesses = model.stiffness(at, turns=False)[:2]
        probe = ErrorProbe(model=model, on_body=lambda model, _: model, order=0)
        errors = probe.measure(*asked, start=at.guess, by_force=True, stiffnesses=stiffnesses)
        found.append(errors.by_cause["grid"])
    np.testing.assert_allclose(*found, rtol=1e-3)


@pytest.mark.parametrize(("waves", "hurst", "seed", "grid", "side", "load"), [
    # spots of 13 cells, whose area tells; and against the plane, which the force tells
    ((2.0, 4.0), 0.7, 9056, (24, 24), 1.1, 0.01),
    ((1.379959221005975, 5.063934911119695), 0.4225255415065133, 1007560844, (31, 34),
     1.1190243883710782, 0.17451901996555097),
])  # fmt: skip
def test_stiffnesses_on_coarser_grids_that_agree_by_accident(waves, hurst, seed, grid, side, load):
    spectrum = Spectrum(hurst=hurst, waves=waves, rms_slope=0.1, seed=seed)
    surface = synthesise(spectrum, grid=grid, lengths=(1.0, side))
    model = HalfSpaceModel(surface, contact_modulus=1e3)
    finer = model.resampled((4 * grid[0], 4 * grid[1]))
    at, exact = (one.press(Control(force=100.0 * load)) for one in (model, finer))
    own, true = model.stiffness(at, turns=False)[:2], finer.stiffness(exact, turns=False)[:2]
    probe = ErrorProbe(model=model, on_body=lambda model, _: model, order=0)
    known = read(at), at.approach, (0.0, 0.0)
    errors = probe.measure(*known, start=at.guess, by_force=True, stiffnesses=own).by_cause["grid"]
    assert (np.abs(1.0 - np.divide(true, own)) < 1.5 * errors[[3, 5]]).all()


CAUSES = {
    "analytic": {"slopes", "zero", "grid"},
    "concurrent": {"body", "slopes", "zero", "grid"},
    "consistent": {"laws", "body", "slopes", "zero", "grid"},
    "isolated": {"laws", "body", "slopes", "zero", "grid"},
}


@pytest.mark.long
@pytest.mark.parametrize("kind", CAUSES)
def test_the_last_load_step_has_its_errors_by_cause(kind):
    history = run(scene(kind))
    first, last = history.steps
    assert first.errors == ()
    assert np.isnan(history.force_error_N[0])
    assert set(dict(last.errors)) == CAUSES[kind]
    assert last.force_error_N == pytest.approx(sum(dict(last.errors).values()), rel=1e-12)
    assert 0.0 < last.force_error_N < 0.5 * last.force_N
    assert last.approach_error_mm == 0.0  # it is prescribed
    assert "check" in history.seconds
    assert (
        f"at its approach the force is within {quantity(last.force_error_N, 'N', 2)}"
        in history.notes[-1]
    )


@pytest.mark.parametrize(("check", "measured"), [("none", 0), ("last", 1), ("all", 2)])
def test_as_many_load_steps_are_measured_as_asked_for(check, measured):
    history = run(scene(check=check))
    assert np.isfinite(history.force_error_N).sum() == measured


def test_models_without_cells_have_no_measure():
    history = run(scene(model="elliptic"))
    assert np.isnan(history.force_error_N).all()
    assert np.isnan(history.approach_error_mm).all()
    assert "check" not in history.seconds


@cache
def on_fine_cells():
    return run(scene(grid=384, check="none", finite_slopes=False)).steps[-1]


@pytest.mark.parametrize(
    "grid", [40, *(pytest.param(grid, marks=pytest.mark.long) for grid in (24, 96))]
)
def test_the_error_of_the_grid_is_that_against_a_much_finer_one(grid):
    step = run(scene(grid=grid, finite_slopes=False)).steps[-1]
    fine = on_fine_cells()
    off = abs(step.force_N - fine.force_N)
    measured = dict(step.errors)["grid"]
    assert off < 1.5 * measured  # what 98 of 100 surfaces keep
    assert measured < 0.06 * (96 / grid) ** 2 * fine.force_N  # a twentieth on 96² cells, no more


READ_OFF, STIFFNESS = (
    ("contact_area_fraction", "mean_separation_mm"),
    "interface_stiffness_N_per_mm",
)


@pytest.mark.long
@pytest.mark.parametrize("load", [{"approach": 0.006}, {"force": 3.0}], ids=str)
@pytest.mark.parametrize(
    ("kind", "grid", "seed"), [("analytic", 48, 4), ("concurrent", 40, 7), ("consistent", 48, 5)]
)
def test_what_is_read_off_has_the_errors_of_finer_cells(kind, grid, seed, load):
    """The solutions that tell the error of the force tell those of area, gap and stiffness."""

    def of(cells):
        given = load | {"steps": 1}
        return scene(kind, cells, check="none", load=given, seed=seed, finite_slopes=False)

    whole, fine = Run(of(grid)), run(of(4 * grid)).steps[-1]
    (step,) = whole.load_steps()
    probe = whole.coupling.error_probe()
    start = None if kind == "consistent" else whole.coupling.model.latest.guess
    own = np.array([step.force_N, *(getattr(step, name) for name in READ_OFF)])
    at = own, step.approach_mm, step.tilt
    found = probe.measure(*at, start=start, by_force="force" in load)
    assert found.parts == pytest.approx(probe.measure(*at, start=start).parts, rel=1e-9)
    for row, name in enumerate(READ_OFF, 1):
        errors = {cause: each[row] for cause, each in found.by_cause.items()}
        value, off = getattr(fine, name), abs(getattr(fine, name) - getattr(step, name))
        assert 1e-5 * value < off <= 1.5 * (sum(errors.values()) - errors["slopes"])
        assert errors["grid"] < 0.4 * value


def test_the_stiffness_of_cells_that_yield_has_an_error_of_few_per_cent():
    """That by single cells that come and go is stated once, and not again as one of the grid."""
    keys = {"load": {"force": 10.0, "steps": 1}, "hardness": 80.0}
    flat = {"surface.spectrum.rms_slope": 0.05}
    step, fine = (
        run(scene(grid=grid, check=check, **keys).with_(flat)).steps[-1]
        for grid, check in ((40, "last"), (120, "none"))
    )
    stated = getattr(step, STIFFNESS.replace("_N", "_error_N"))
    off = abs(getattr(step, STIFFNESS) - getattr(fine, STIFFNESS))
    assert off < 1.5 * stated < 1.5 * 0.15 * getattr(step, STIFFNESS)


@pytest.mark.long
def test_coarse_cells_that_are_soft_tell_no_absurd_error_of_the_stiffness():
    """By force over stiffness alone the error of the interface's is 2.4 times as large here."""
    load = {"force": 4.117, "steps": 1, "tilt": "free"}
    (coarse,), (fine,) = (
        run(scene("concurrent", grid, check=check, load=load, seed=14)).steps
        for grid, check in ((32, "last"), (128, "none"))
    )
    for name in ("interface_stiffness_N_per_mm", "approach_stiffness_N_per_mm"):
        stiffness, error = (getattr(coarse, one) for one in (name, name.replace("_N", "_error_N")))
        assert abs(stiffness - getattr(fine, name)) < 1.5 * error < 1.5 * 0.7 * stiffness


@pytest.mark.parametrize("seed", range(4))
def test_coarse_cells_of_tiny_samples_tell_no_absurd_error_of_the_stiffness(seed):
    """At the same approach a quarter of 8 cells a side hardly touches, or touches all over."""

    def pressed(cells):
        spectrum = Spectrum(hurst=0.9, waves=(2, 3), rms_slope=0.1, seed=seed)
        surface = synthesise(spectrum, grid=(cells, cells), lengths=(1.0, 1.0))
        made = HalfSpaceModel(surface, contact_modulus=4000.0, periodic=True)
        state = made.press(Control(force=10.0))
        return made, state, made.stiffness(state).interface

    (made, state, stiffness), (*_, true) = pressed(8), pressed(64)
    probe = ErrorProbe(model=made, on_body=lambda model, order: model, order=0)
    found = probe.measure(
        read(state), state.approach, (0.0, 0.0),
        start=state.guess, by_force=True, stiffnesses=(stiffness, math.nan),
    )  # fmt: skip
    assert abs(1.0 - true / stiffness) < 1.5 * found.by_cause["grid"][3] < 1.5 * 1.3


def test_slopes_left_out_are_what_they_would_take():
    without = run(scene(grid=96, finite_slopes=False)).steps[-1]
    with_slopes = run(scene(grid=96)).steps[-1]
    stated, left = (dict(step.errors)["slopes"] for step in (without, with_slopes))
    # measured on half of the cells; what they leave out themselves adds to it
    assert stated - left == pytest.approx(without.force_N - with_slopes.force_N, rel=0.1)
    assert 0.0 < left < 0.3 * stated


def test_a_prescribed_force_has_an_error_of_the_approach():
    load = {"force": 0.8, "steps": 2}
    step = run(scene(load=load)).steps[-1]
    assert step.force_error_N == 0.0
    assert step.approach_error_mm > 0.0
    near = [run(scene(load={"approach": step.approach_mm + d, "steps": 1}, check="none")).force_N
            for d in (-1e-4, 1e-4)]  # fmt: skip
    stiffness = float(near[1][-1] - near[0][-1]) / 2e-4
    error = sum(dict(step.errors).values())
    assert step.approach_error_mm == pytest.approx(error / stiffness, rel=0.02)  # convex


@pytest.mark.parametrize("kind", ["analytic", pytest.param("concurrent", marks=pytest.mark.long)])
def test_under_a_force_errors_of_the_contact_do_not_depend_on_the_zero(kind):
    load = {"force": 0.2, "steps": 1}
    touch, mean = (run(scene(kind, load=load | {"zero": z})) for z in ("first touch", "mean plane"))
    assert dict(touch[-1].errors)["zero"] > 3.0 * dict(mean[-1].errors)["zero"]
    for name in (
        "contact_area_fraction_error",
        "mean_separation_error_mm",
        "interface_stiffness_error_N_per_mm",
        "approach_stiffness_error_N_per_mm",
    ):
        # the body under a level plane, and its rests of 1e-8, are counted from elsewhere
        assert getattr(touch[-1], name) == pytest.approx(getattr(mean[-1], name), rel=1e-5)


def test_laws_under_a_plane_free_to_turn_are_compared_with_one_free_to_turn():
    setup = Run(scene("concurrent")).coupling
    probe = ErrorProbe(model=setup.parts.micro, on_body=setup.put_on_body, order=0, by_laws=True)
    free = Control(approach=0.006, tilt=None)
    turned = probe.on_body(setup.parts.micro, 0).press(free)
    level = probe.on_body(setup.parts.micro, 0).press(Control(approach=0.006))
    assert max(map(abs, turned.plane.tilt)) > 1e-4
    for turns, force in ((True, turned.force), (False, level.force)):
        own = np.array([force + 0.1, 0.1, 0.01])
        found = probe.measure(own, 0.006, (0.0, 0.0), turns=turns)
        assert found.parts["laws"] == pytest.approx(0.1, rel=1e-6)


def test_notes_have_one_unit_for_what_is_compared_in_them():
    """Errors by cause differ by orders of magnitude, and stand beside each other."""
    history = run(scene("concurrent", grid=48, load={"force": 0.8, "steps": 1}))
    (said,) = [note for note in history.notes if note.startswith("measured at load step")]
    forces = set(re.findall(r"[\d.]+ ([a-zµ]?N)\b", said))
    lengths = set(re.findall(r"[\d.]+ ([a-zµ]?m)\b", said))
    assert len(forces) == len(lengths) == 1
    alone = {quantity(error, "N", 2).split()[1] for _, error in history[-1].errors}
    assert len(alone) > 1  # each by itself would be in another unit


def test_a_plane_that_does_not_touch_has_no_error():
    heat, load = {"conductance": {"conductivity": "50 W/m/K"}}, {"approach": 1e-9, "steps": 1}
    for grid, touches in ((40, False), (32, True)):
        given = scene(grid=grid, load=load).written | heat
        (step,) = run(Scene.from_dict(given)).steps
        assert step.force_N == step.thermal_conductance_W_per_K == 0.0
        assert step.contact_area_fraction_error is not None
        # a plane nearer by the error of first touch may touch: what it conducts then is not known
        assert (step.force_error_N > 0.0) == touches
        assert step.thermal_conductance_error_W_per_K == (None if touches else 0.0)


def test_a_force_whose_error_is_not_known_is_no_exact_zero():
    """A cause that is not measured may let the plane touch."""
    steep = {"surface.spectrum": {"hurst": 0.8, "waves": [2, 5], "rms_slope": 0.9, "seed": 1}}
    load = {"approach": 1e-9, "steps": 1}
    (step,) = run(scene(grid=24, load=load, finite_slopes=False).with_(steep)).steps
    assert step.force_N == 0.0
    assert dict(step.errors)["slopes"] == math.inf
    assert step.force_error_N is step.contact_area_fraction_error is None


def errors(parts, **given):
    """Return measured errors of forces alone."""
    by_cause = {cause: np.array([error, 0.0, 0.0]) for cause, error in parts.items()}
    return MeasuredErrors(by_cause=by_cause, **given)


def test_errors_without_contact_leave_the_approach_alone():
    assert errors({"grid": 0.0}, stiffness=0.0).approach == 0.0
    assert errors({"grid": 0.1, "laws": 0.2}, stiffness=3.0).approach == pytest.approx(0.1)


@pytest.mark.parametrize(("touching", "most"), [(0.97, 0.97), (0.02, 0.98)])
def test_an_area_is_off_by_no_more_than_of_it_and_of_what_is_open(touching, most):
    """As of a face that has worn until nearly all touches, by the errors of what was new."""
    step = SimpleNamespace(contact_area_fraction=touching, by_force=True)
    for error in (0.3, 1.8):
        found = MeasuredErrors(by_cause={"grid": np.array([1.0, error, 1e-4])}, stiffness=1.0)
        stated = error_columns(step, found)["contact_area_fraction_error"]
        assert stated == pytest.approx(min(error, most), rel=1e-12)


def test_the_stiffness_of_a_contact_that_may_not_be_there_has_no_bound():
    """Errors relative to a force of nearly nothing, of a worn surface, say nothing of it."""
    for force, stated in ((0.1, 15.0), (1e-13, None)):
        known = {"force_N": force, "interface_stiffness_N_per_mm": 30.0}
        step = SimpleNamespace(**dict.fromkeys(one.name for one in COLUMNS) | known, by_force=False)
        step.contact_area_fraction, shares = 0.1, np.full(3, 0.05 / force)
        found = MeasuredErrors(by_cause={"grid": [0.05, 0.1, 1e-4, *shares]}, stiffness=30.0)
        assert error_columns(step, found)["interface_stiffness_error_N_per_mm"] == stated


def test_what_cannot_be_measured_is_said_and_the_run_goes_on(monkeypatch):
    def fails(*_given, **_options):
        raise NotConverged("the contact", reason="TEST", iterations=3, remedy="none")

    monkeypatch.setattr(ErrorProbe, "measure", fails)
    history = run(scene())
    assert len(history) == 2
    assert np.isnan(history.force_error_N).all()
    assert any(note.startswith("errors of load step 2 not measured") for note in history.notes)


def test_a_period_in_full_contact_runs_without_errors_that_need_a_gap():
    """Other cells touch everywhere before the approach of the run's, which does not end it."""
    rough = {"surface.periodic": True, "surface.spectrum.rms_slope": 0.02}
    history = run(scene(load={"force": [400.0, 1.5], "steps": 2}, check="all").with_(rough))
    assert (history.contact_area_fraction[:2] == 1.0).all()
    assert history.approach_mm[1] == pytest.approx(history.approach_mm[0], rel=1e-2)
    assert (
        np.isnan(history.approach_stiffness_N_per_mm[:2]).all()
        and history[-1].approach_stiffness_N_per_mm > 0.0
    )
    assert any("errors of load step 2 not measured" in note for note in history.notes)
    assert history[-1].approach_error_mm > 0.0


@pytest.mark.long
def test_the_error_holds_of_a_flat_face_in_full_contact():
    """Without Poisson's ratio a column under a plane is uniform: its approach is F H/(E A)."""
    column = {"young_modulus": 4000.0, "poisson_ratio": 0.0, "height": 1.0}
    flat = {"heights": np.zeros((48, 48)), "lengths": [1.0, 1.0]}
    pressed = scene("concurrent", load={"force": 20.0, "steps": 1}).written
    (step,) = run(Scene.from_dict(pressed | {"surface": flat, "block": column}))
    assert abs(step.approach_mm - 20.0 / 4000.0) <= step.approach_error_mm <= 5e-6


def test_notes_of_a_period_in_full_contact_say_what_is_meant():
    rough = {"surface.periodic": True, "surface.spectrum.rms_slope": 0.02}
    heat = {"conductance": {"conductivity": "50 W/m/K", "gas": "0.026 W/m/K"}}
    full = scene(load={"force": 400.0, "steps": 2}).with_(rough)
    history = run(Scene.from_dict(full.written | heat))
    notes = " ".join(note for note in history.notes if "strains the body" not in note)
    assert "conductance at 2 of 2 load steps, the last of them load step 2: without bound" in notes
    assert "errors of load step 2 not measured: in full contact of a period" in notes
    assert not any(sign in notes for sign in ("–", "%", "temperature_jump"))
    assert np.isnan(history.thermal_conductance_W_per_K).all()


def test_an_accuracy_that_is_not_kept_is_said():
    wanted = replace(scene(grid=96, finite_slopes=False), accuracy=0.005)
    history = run(wanted)
    (said,) = [note for note in history.notes if "accuracy of 0.5 % is not kept" in note]
    assert "most of it by slopes" in said


def test_a_run_that_goes_on_measures_the_same(tmp_path):
    whole = Run(scene("concurrent"))
    steps = whole.load_steps()
    next(steps)
    kept = whole.checkpoint(whole.coupling.state())
    list(steps)
    again = Run(scene("concurrent"))
    again.resume(kept)
    list(again.load_steps())
    assert again.steps[-1].errors == whole.steps[-1].errors


@pytest.mark.parametrize("grid", [64, 50])  # halves have solutions to start from, or do not
def test_a_known_solution_saves_work_and_changes_no_error(monkeypatch, grid):
    setup = Run(scene("concurrent", grid=grid)).coupling
    probe = ErrorProbe(model=setup.parts.micro, on_body=setup.put_on_body, order=2)
    known = probe.on_body(setup.parts.micro, 2).press(Control(approach=0.006))
    press, used = HalfSpaceModel.press, []

    def watched(*given, **options):
        used.append(press(*given, **options))
        return used[-1]

    monkeypatch.setattr(HalfSpaceModel, "press", watched)
    found, iterations = [], []
    for start in (None, known.guess):
        used.clear()
        found.append(probe.measure(read(known), 0.006, (0.0, 0.0), start=start).parts)
        iterations.append(sum(state.iterations for state in used))
    assert iterations[1] < iterations[0]
    # each force is right to 1e-5
    assert found[1] == pytest.approx(found[0], abs=1e-5 * known.force)


def test_fewer_modes_are_solved_on_the_body_itself():
    setup = Run(scene("concurrent")).coupling
    body = setup.put_on_body
    probe = ErrorProbe(model=setup.parts.micro, on_body=body, order=2)
    stiff = replace(probe, on_body=lambda model, order: replace(body(model, order), body=None))
    own = read(body(setup.parts.micro, 2).press(Control(approach=0.006)))
    assert probe.measure(own, 0.006, (0.0, 0.0)).parts["body"] > 0.0
    assert "body" not in stiff.measure(own, 0.006, (0.0, 0.0)).parts


def test_errors_are_columns_and_stand_beside_the_values(tmp_path):
    history = run(scene())
    write_files(tmp_path, history_files(history), ())
    rows = list(csv.DictReader((tmp_path / "history.csv").open()))
    assert rows[0]["force_error_N"] == ""
    assert float(rows[1]["force_error_N"]) == history.force_error_N[1]
    header, cells = history.table()
    at = header.index("force [N]")
    assert "±" not in cells[0][at]
    value, error = cells[1][at].split(" ± ")
    assert float(value) == pytest.approx(history.force_N[1], abs=0.5 * 10.0 ** -len(value[2:]))
    assert float(error) == pytest.approx(history.force_error_N[1], rel=0.06)  # two digits


def test_report_and_provenance_hold_the_errors(tmp_path):
    run = Run(scene())
    list(run.load_steps())
    write_results(tmp_path, run, options=[])
    kept = json.loads((tmp_path / "provenance.json").read_text())
    *before, last = kept["errors_N"]
    assert before == [{} for _ in before]
    assert set(last) == {"slopes", "zero", "grid"}
    assert sum(last.values()) == pytest.approx(run.steps[-1].force_error_N, rel=1e-12)
    assert kept["memory_bytes"] > 1e6
    assert kept["decision"] is None
    page = (tmp_path / "report.html").read_text()
    assert "<h2>Error of the force by cause" in page
    assert "<td>size of the cells</td>" in page  # what the cause grid means
    assert f"measured at load step {len(run.steps)}</h2>" in page
    assert " ± " in page


@pytest.mark.parametrize(("value", "error", "stated"), [
    (5.36912, 0.0312, "5.369 ± 0.031"), (5.36912, 1.26, "5.4 ± 1.3"), (123.4, 21.0, "123 ± 21"),
    (5.36912, 0.0, "5.36912"), (5.36912, None, "5.36912"),
])  # fmt: skip
def test_values_are_rounded_to_their_errors(value, error, stated):
    assert with_error(value, error, 6) == stated


@pytest.mark.parametrize("stiffness", [0.0, math.nan])
def test_an_approach_whose_stiffness_is_not_known_has_no_stated_error(stiffness):
    found = errors({"grid": 1.0, "zero": 0.5}, stiffness=stiffness, zero=1e-4)
    assert found.approach == math.inf


def test_the_zero_counts_in_full_in_an_approach_under_a_force():
    found = errors({"grid": 1.0, "zero": 0.5}, stiffness=2e3, zero=1e-4)
    assert found.approach == pytest.approx(1.0 / 2e3 + 1e-4, rel=1e-14)
