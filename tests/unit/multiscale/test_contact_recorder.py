"""The contact of load steps: recorded as asked, written, kept over a resume, the same in all."""

from contextlib import nullcontext
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.resumed_runs import gone_on, ran_past

from patchlaw.geometry import Control
from patchlaw.multiscale import Run, Scene, run
from patchlaw.multiscale.observers.step_observers import FieldRecorder

SPECTRUM = {"hurst": 0.95, "waves": [2, 6], "rms_slope": 0.2, "seed": 1}


def scene(kind="analytic", model="half-space", contact="auto", **sections):
    data = {
        "surface": {"spectrum": SPECTRUM, "grid": [32, 32], "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15},
        "patches": {"grid": [2, 2]},
        "micro": {"model": model},
        "coupling": {"kind": kind},
        "load": {"approach": 0.008, "steps": 2},
        "output": {"check": "none", "contact": contact, "figures": False},
    }
    return Scene.from_dict(data | sections)


@cache
def ran(*given):
    return run(scene(*given))


@pytest.mark.parametrize(("kind", "model", "fields"), [
    ("analytic", "half-space", True), ("analytic", "elliptic", False),
    ("concurrent", "half-space", True),
    pytest.param("reference", "half-space", True, marks=pytest.mark.long),
])  # fmt: skip
def test_last_contact_is_recorded(kind, model, fields):
    history = ran(kind, model)
    contact, last = history.contact, history.steps[-1]
    assert [record.step for record in history.contact_records] == [2]
    assert contact.spot_force_N.sum() == pytest.approx(last.force_N, rel=1e-10)
    assert contact.area_mm2.sum() == pytest.approx(last.contact_area_fraction, rel=1e-10)
    assert len(contact.spots) == last.contacts
    assert (np.diff(contact.spot_force_N) <= 0.0).all()
    assert contact.peak_pressure_MPa.max() == last.peak_pressure_MPa
    assert (contact.pressure_MPa is not None) == fields
    if fields and kind != "reference":  # cells are equal there
        assert contact.gap_mm.mean() == pytest.approx(last.mean_separation_mm, rel=1e-9)
        assert contact.pressure_MPa.mean() == pytest.approx(last.mean_pressure_MPa, rel=1e-9)


@pytest.mark.parametrize(("kind", "sections"), [
    ("analytic", {"conductance": {"resistivity": ["1e-7 ohm m", "1e-7 ohm m"]}}),
    pytest.param("consistent", {}, marks=pytest.mark.long),
    pytest.param("reference", {}, marks=pytest.mark.long),
])  # fmt: skip
@pytest.mark.parametrize("last", ["force", "approach"])
def test_what_vanishes_without_contact_has_no_error(kind, sections, last):
    """By one rule; the approach of a plane without a force is any, and so is the mean gap."""
    load = {last: {"force": ["4 N", "0 N"], "approach": [0.008, 0.0]}[last], "steps": 1}
    surface = {"spectrum": SPECTRUM, "grid": [24, 24], "lengths": [1.0, 1.0]}
    given = sections | {"load": load, "surface": surface, "output": {"check": "all"}}
    if kind == "reference":
        given["reference"] = {"meshes": 2, "fine": "0.12 mm"}
    step = run(scene(kind, **given))[-1]
    assert step.force_N == step.force_error_N == 0.0
    assert step.contact_area_fraction == step.contact_area_fraction_error == 0.0
    assert step.interface_stiffness_N_per_mm == step.interface_stiffness_error_N_per_mm
    assert step.electrical_conductance_S == step.electrical_conductance_error_S
    by_force = last == "force"
    assert step.approach_error_mm == (None if by_force else 0.0)
    assert not (by_force and step.mean_separation_error_mm)


def test_all_contacts_are_recorded_and_none_without_asking():
    assert [record.step for record in run(scene(contact="all")).contact_records] == [1, 2]
    bare = run(scene(contact="none"))
    assert bare.contact is None
    assert np.isnan(bare.approach_stiffness_N_per_mm).all()
    assert (bare.peak_pressure_MPa > 0.0).all()
    assert (bare.linear_iterations == 0).all()


@pytest.mark.long
def test_contact_behind_laws_is_solved_on_request_alone():
    quiet, asked = run(scene("consistent")), run(scene("consistent", contact="all"))
    assert quiet.contact is None
    assert np.isnan(quiet.peak_pressure_MPa).all()
    concurrent = run(scene("concurrent", contact="all"))
    np.testing.assert_array_equal(quiet.force_N, asked.force_N)
    for mine, its in zip(asked.contact_records, concurrent.contact_records, strict=True):
        # rows of the laws start the solutions elsewhere, to the same residual of 1e-10
        np.testing.assert_allclose(mine.spots, its.spots, rtol=1e-7)
    np.testing.assert_allclose(asked.peak_pressure_MPa, concurrent.peak_pressure_MPa, rtol=1e-7)
    assert any("contact problem behind the laws" in note for note in asked.notes)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["consistent", pytest.param("isolated", marks=pytest.mark.long)])
@pytest.mark.parametrize("tilt", [(0.001, 0.0), "free"])
def test_stiffness_of_laws_is_the_derivative_of_their_force(kind, tilt):
    load = {"approach": 0.008, "steps": 1, "tilt": tilt}
    coupling = {"kind": kind, "table_tolerance": 0.02}
    whole = Run(scene(kind, load=load, coupling=coupling))
    (step,) = whole.load_steps()
    tilt = None if tilt == "free" else tilt
    near = 1e-7
    ahead, back = (
        whole.coupling.model.press(Control(approach=0.008 + change, tilt=tilt)).force_N
        for change in (near, -near)
    )
    # forces are right to 1e-12 of 1 N and laws smooth: second differences are below 1e-6
    assert step.approach_stiffness_N_per_mm == pytest.approx(
        (ahead - back) / (2.0 * near), rel=1e-5
    )


def test_contacts_survive_a_checkpoint(tmp_path):
    path = tmp_path / "c.h5"
    whole = ran_past(scene("concurrent", contact="all"), 1, path)
    again, _ = gone_on(whole.given, path)
    for one, other in zip(again.contacts, whole.contacts, strict=True):
        assert one.step == other.step
        np.testing.assert_array_equal(one.spots, other.spots)
        np.testing.assert_array_equal(one.gap_mm, other.gap_mm)
    names = "peak_pressure_MPa", "approach_stiffness_N_per_mm"
    for name in names:
        np.testing.assert_array_equal(
            getattr(again.history(), name), getattr(whole.history(), name)
        )


def test_run_that_stops_early_shows_its_last_contact():
    whole = Run(scene())
    next(whole.load_steps())
    assert whole.contacts == ()
    whole.finish()
    whole.finish()  # once only
    assert [record.step for record in whole.contacts] == [1]


@pytest.mark.parametrize(("asked", "written"), [("last", [3]), ("all", [1, 2, 3]), ([2], [2])])
def test_a_run_gone_on_with_writes_the_fields_that_it_asks_for_now(asked, written):
    """The earlier call kept those of all load steps."""
    found = []
    model = SimpleNamespace(
        on_mesh=True,
        field_state_again=lambda record, step, parts: record,
        write_fields=lambda path, kept: found.extend(kept),
    )
    recorder = FieldRecorder(
        SimpleNamespace(
            scene=scene(output={"fields": asked}), model=model, field_parts=None,
            clock=SimpleNamespace(phase=lambda name: nullcontext()),
        )
    )  # fmt: skip
    recorder.records = dict.fromkeys([1, 2, 3], "state")
    steps = [SimpleNamespace(step=number) for number in (1, 2, 3)]
    recorder.write(None, steps, finished=True)
    assert found == written
