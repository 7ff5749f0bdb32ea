"""Natural modes in scenes: what the run adds, writes and reads back."""

import csv

import numpy as np
import pytest
from helpers.resumed_runs import gone_on, ran_past
from scipy.optimize import brentq

from patchlaw.macro.contact.face_vibration import FaceVibration
from patchlaw.multiscale import Run, Scene, make_setup, read_history, run
from patchlaw.multiscale.runs.output.results import write_fields, write_results
from patchlaw.support import InputError, NotConverged

E, NU, DENSITY, SIDE, HEIGHT = 4000.0, 0.3, 2e-9, 6.0, 4.0


def scene(**changes):
    """A block on rollers under laws of a sample: between them it is a bar."""
    spectrum = {"hurst": 0.8, "waves": [2, 4], "rms_height": "1 um", "seed": 2}
    block = {"young_modulus": E, "poisson_ratio": NU, "density": "2000 kg/m^3", "sides": "roller"}
    data = {
        "surface": {"spectrum": spectrum, "grid": [16, 16], "lengths": ["0.5 mm", "0.5 mm"]},
        "block": block
        | {"lengths": [SIDE, SIDE], "height": HEIGHT, "cells": [1, 1, 4], "element": "Q2"},
        "law": {"kind": "representative"},
        "coupling": {"table_tolerance": 0.05},
        "load": {"pressure": "5 MPa", "steps": 1},
        "vibration": {"modes": 7},
        "output": {"figures": False, "report": False, "check": "none", "fields": "last"},
    }
    return Scene.from_dict({**data, **changes})


def test_the_plan_counts_the_memory_of_modes():
    about, plain = (make_setup(scene(**one)).about for one in ({}, {"vibration": None}))
    (modes,) = (one for one in about.memory_requests() if one.key == "vibration.modes")
    assert modes.value == 7
    # Q2 has 3 × 3 × 9 nodes; vectors of 8 B for each of 15 modes at a time, 3 × 6 of them
    assert modes.shared > 3 * 81 * 8 * 15 * 18
    assert all(one.key != "vibration.modes" for one in plain.memory_requests())


@pytest.mark.long
def test_more_modes_than_unknowns_are_refused_by_their_key():
    run = Run(scene(vibration={"modes": 500}))
    with pytest.raises(InputError, match=r"vibration\.modes = 500: there are not as many modes"):
        list(run.load_steps())
    run.close()


@pytest.mark.long
def test_more_modes_than_linear_elements_have_come_without_the_elements_error():
    output = {"check": "last", "figures": False, "report": False, "fields": False}
    run = Run(scene(vibration={"modes": 20}, output=output))
    (step,) = run.load_steps()
    assert len(step.modes) == 20  # and 16 of linear elements
    assert step.modes[0].element_error_Hz is None and step.first_frequency_error_Hz > 0.0
    run.close()


@pytest.mark.long
def test_under_a_force_frequencies_do_not_err_by_what_approaches_count_from():
    output = {"check": "last", "figures": False, "report": False, "fields": False}
    load = {"pressure": "5 MPa", "steps": 1}
    found = [
        run(scene(vibration={"modes": 2}, output=output, load=load | zero))[-1]
        for zero in ({}, {"zero": "mean plane"})
    ]
    assert dict(found[0].errors)["zero"] > 1e-3 * found[0].force_N
    one, other = (
        [mode.frequency_error_Hz - mode.element_error_Hz for mode in step.modes] for step in found
    )
    assert max(one) > 0.1
    assert one == pytest.approx(other, rel=1e-6, abs=1e-5)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A run to its end, and the folder of its results."""
    folder, run = tmp_path_factory.mktemp("results"), Run(scene())
    list(run.load_steps())
    write_results(folder, run, options=[])
    written = write_fields(folder, run)
    history, laws = run.history(), run.laws
    run.close()
    return history, laws, folder, {path.name for path in written}


@pytest.mark.long
def test_the_mode_along_z_is_that_of_a_bar_on_the_law(results):
    history, laws, *_ = results
    step = history.steps[-1]
    law = float(laws[0].stiffness(step.patches.closure_mm)[0])
    modulus = E * (1.0 - NU) / ((1.0 + NU) * (1.0 - 2.0 * NU))  # without strain across
    beta = brentq(
        lambda one: modulus * one * np.cos(one * HEIGHT) + law * np.sin(one * HEIGHT),
        0.5 * np.pi / HEIGHT,
        np.pi / HEIGHT,
    )
    expected = beta * np.sqrt(modulus / DENSITY) / (2.0 * np.pi)
    mode = max(step.modes, key=lambda one: one.participation_z)
    # quadratic elements err by (β h)⁴/720 of the frequency
    assert mode.frequency_Hz == pytest.approx(expected, rel=(beta * HEIGHT / 4.0) ** 4 / 720.0)
    assert mode.participation_z > 0.5
    share = (
        law
        * np.sin(beta * HEIGHT) ** 2
        / (DENSITY * (0.5 * HEIGHT - 0.25 * np.sin(2.0 * beta * HEIGHT) / beta))
    )
    assert mode.contact_share == pytest.approx(share / (2.0 * np.pi * expected) ** 2, rel=1e-2)
    assert mode.frequency_error_Hz is None and mode.residual < 1e-9
    assert step.first_frequency_Hz == step.modes[0].frequency_Hz
    assert step.least_damping_per_s == 0.0


def test_modes_are_written_and_read_back(results):
    history, _, folder, written = results
    rows = list(csv.DictReader((folder / "modes.csv").open()))
    assert [row["mode"] for row in rows] == list("1234567")
    assert {"modes.xdmf", "modes.h5", "contact_stiffness.inp", "contact_stiffness.mtx"} <= written
    again = read_history(folder)
    assert again.steps[-1].modes == history.steps[-1].modes


@pytest.mark.long
def test_sliding_with_a_heavy_plane_is_reported(tmp_path):
    given = scene(
        vibration={"modes": 2, "plane": "50 g", "sliding": [0.0, 2.0]},
        friction={"coefficient": 0.4},
        output={"figures": True, "report": True, "check": "none", "fields": False},
    )
    run = Run(given)
    (step,) = run.load_steps()
    write_results(tmp_path, run, options=[])
    run.close()
    # the plane on springs in series, far below all other modes, which its mass hardly knows
    slow = step.modes[0].frequency_Hz
    stiffness = (2.0 * np.pi * slow) ** 2 * 5e-5
    modulus = E * (1.0 - NU) / ((1.0 + NU) * (1.0 - 2.0 * NU))
    law = float(run.laws[0].stiffness(step.patches.closure_mm)[0])
    series = SIDE**2 / (HEIGHT / modulus + 1.0 / law)
    # the block's own mass of 2.9e-7 t moves with it, by a third at most
    assert stiffness == pytest.approx(series, rel=2.9e-7 / 5e-5 / 3.0)
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "The first natural modes" in report and "mode 1" in report
    assert (tmp_path / "vibration.png").stat().st_size > 5_000


@pytest.mark.long
def test_a_face_that_slides_as_a_whole_rubs_as_one_that_only_vibrates():
    """It has no springs along the face; its wear is too little to matter."""
    output = {"figures": False, "report": False, "check": "none", "fields": False}
    both = {"friction": {"coefficient": 0.43}, "output": output}
    both |= {"vibration": {"modes": 5, "sliding": [0.3, 0.4], "plane": "3 g"}}
    load, found = {"pressure": "5 MPa", "steps": 1}, []
    for wears in (
        {"load": load},
        {"load": load | {"sliding": "1 mm"}, "wear": {"coefficient": "1e-15 mm^2/N"}},
    ):
        run = Run(scene(**both, **wears))
        found.append([one.frequency_Hz for one in list(run.load_steps())[-1].modes])
        run.close()
    # laws that run in have rows of their own, within 5 % of pressures far below these
    assert found[1] == pytest.approx(found[0], rel=2e-4)


@pytest.mark.long
def test_modes_that_are_not_found_leave_none_of_an_earlier_step(tmp_path, monkeypatch):
    load = {"pressure": "5 MPa", "steps": 2}
    run = Run(scene(load=load, vibration={"modes": 1}))
    steps, original = run.load_steps(), FaceVibration.modes
    assert next(steps).modes

    def fails(*_):
        raise NotConverged("no modes", reason="none", iterations=1, remedy="none")

    monkeypatch.setattr(FaceVibration, "modes", fails)
    assert not next(steps).modes
    monkeypatch.setattr(FaceVibration, "modes", original)
    written = {path.name for path in write_fields(tmp_path, run)}
    assert written and not {one for one in written if one.startswith(("modes", "contact_st"))}
    assert any("modes of load step 2 not found: no modes" in one for one in run.history().notes)
    run.close()


@pytest.mark.slow
def test_a_run_resumed_behind_its_last_step_says_that_it_has_no_shapes(tmp_path):
    given = scene(vibration={"modes": 1})
    path = tmp_path / "run.state"
    ran_past(given, 1, path).close()
    run, own = gone_on(given, path)
    assert not own
    assert run.steps[-1].modes
    assert any("modes about load step 1 were found before" in note for note in run.history().notes)
    assert "modes.xdmf" not in {one.name for one in write_fields(tmp_path / "out", run)}
    run.close()


@pytest.mark.long
def test_a_last_step_out_of_contact_writes_no_springs(tmp_path):
    load = {"force": ["180 N", "0 N"], "steps": 1}
    run = Run(scene(load=load, vibration={"modes": 1}))
    *_, last = run.load_steps()
    assert last.force_N == 0.0 and last.modes
    written = {one.name for one in write_fields(tmp_path, run)}
    assert "contact_stiffness.inp" in written
    assert "SPRING" not in (tmp_path / "contact_stiffness.inp").read_text()
    run.close()


@pytest.mark.slow
@pytest.mark.parametrize("sliding", [None, [1.0, 0.0]])
def test_errors_of_a_plane_that_slides_are_said_to_grow_near_merging(sliding):
    output = {"check": "last", "figures": False, "report": False, "fields": False}
    vibration = {"modes": 1} | ({} if sliding is None else {"sliding": sliding})
    run = Run(scene(vibration=vibration, friction={"coefficient": 0.3}, output=output))
    (step,) = run.load_steps()
    assert step.first_frequency_error_Hz > 0.0
    notes = run.history().notes
    assert any("near merging" in one for one in notes) == (sliding is not None)
    run.close()


@pytest.mark.long
def test_patches_that_have_worn_vibrate_as_those_of_the_worn_surface(tmp_path):
    """The slopes of their laws are those of laws that are made of the heights that are left."""
    block = {"young_modulus": E, "poisson_ratio": NU, "height": 1.0, "cells": [2, 2, 2]}
    spectrum = {"hurst": 0.8, "waves": [2, 5], "rms_slope": 0.08, "seed": 5}
    rest = {
        "block": block | {"density": "2000 kg/m^3"},
        "law": {},
        "coupling": {"kind": "consistent"},
        "patches": {"grid": [2, 1]},
        "micro": {"finite_slopes": False},
        "vibration": {"modes": 3, "plane": "1 g"},
        "output": {"figures": False, "report": False, "check": "none", "fields": False},
    }
    drawn = {"spectrum": spectrum, "grid": [16, 14], "lengths": [1.0, 0.9]}
    loaded = {"force": 12.0, "steps": 1}
    slid = {"load": loaded | {"sliding": [7e3]}, "wear": {"coefficient": "1e-8 mm^2/N"}}
    slid |= {"friction": {"coefficient": 0.3}}  # which a face that slides as a whole does not see
    run = Run(scene(**rest, **slid, surface=drawn))
    steps, (lowered,) = list(run.load_steps()), [one[1] for one in run.coupling.worn_depths]
    heights = np.array(run.coupling.parts.surface.heights)
    _, rubs = run.coupling.model.vibration_tangents(np.array([0.6, 0.8]))
    assert rubs[:, 1:, 0] == pytest.approx(np.outer(rubs[:, 0, 0], [0.18, 0.24]), rel=1e-14)
    run.close()
    for step, left in zip(steps, (heights, heights - lowered), strict=True):
        np.save(tmp_path / "left.npy", left)
        given = {"file": str(tmp_path / "left.npy"), "lengths": [1.0, 0.9]}
        alone = Run(scene(**rest, load=loaded, surface=given))
        (own,) = list(alone.load_steps())
        alone.close()
        # by rows of their own; measured: 1e-7 new, 1.2e-6 worn
        expected = [one.frequency_Hz for one in own.modes]
        assert [one.frequency_Hz for one in step.modes] == pytest.approx(expected, rel=1e-5)
    first, last = (step.modes[0].frequency_Hz for step in steps)
    assert last > 1.1 * first  # the contact has grown
