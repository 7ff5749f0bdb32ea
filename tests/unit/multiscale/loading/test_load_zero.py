"""What approaches count from changes how load steps and laws are named, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from patchlaw.geometry import Control
from patchlaw.multiscale import Run, Scene, read_laws, run
from patchlaw.multiscale.laws.export import export_texts
from patchlaw.multiscale.runs.output.results import write_results

UP = 8e-3 / np.sqrt(2.0)
"""A deepest approach from first touch that is no rounded number [mm]."""
ZEROS = ("mean plane", "quantile 0.02")


def scene(zero, kind="analytic", depth=0.0, **sections):
    """Return a scene whose plane comes to the same places whatever its approaches count from."""
    data = {
        "surface": {
            "spectrum": {"hurst": 0.9, "waves": [2, 5], "rms_slope": 0.2, "seed": 28},
            "grid": [24, 24],
            "lengths": ["1 mm", "1 mm"],
        },
        "block": {"young_modulus": "4 GPa", "poisson_ratio": 0.15, "cells": [8, 8, 6]},
        "patches": {"grid": [2, 2]},
        "coupling": {"kind": kind} if kind else {},
        "load": {"zero": zero, "approach": [UP - depth, 0.5 * UP - depth], "steps": 2},
        "output": {"figures": False, "report": False},
    }
    if "law" in sections:  # which has no patches
        del data["patches"]
    return Scene.from_dict({name: data.get(name, {}) | sections.get(name, {}) for name in
                            {*data, *sections}})  # fmt: skip


def depth_of(given):
    return Run(given).coupling.parts.zero


CASES = {
    "analytic": {},
    "concurrent": {},
    "isolated": {"coupling": {"table_tolerance": 0.01}},
    "consistent": {"coupling": {"table_tolerance": 0.01}},
    "reference": {"reference": {"meshes": 1, "fine": 0.1}},
    "hardness": {"micro": {"hardness": "1 GPa"}},
    "tilted": {"load": {"tilt": ["3 um/mm", "-2 um/mm"]}},
    "counter": {"counter_surface": {
        "spectrum": {"hurst": 0.8, "waves": [2, 4], "rms_slope": 0.1, "seed": 3},
        "grid": [24, 24], "lengths": ["1 mm", "1 mm"],
    }},
    "summits": {"micro": {"model": "elliptic"}},
}  # fmt: skip


def pressed(zero, case, depth=0.0):
    sections = {name: dict(keys) for name, keys in CASES[case].items()}
    kind = case if case in ("analytic", "concurrent", "isolated", "consistent", "reference") else ""
    return scene(zero, kind or "analytic", depth, **sections)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "zeros"),
    [(case, ZEROS if case == "analytic" else ZEROS[:1]) for case in CASES],
    ids=CASES,
)
def test_forces_are_those_of_the_same_places(case, zeros):
    """One zero is one number, whose effect every coupling shows: the other one is for one alone."""
    known = run(pressed("first touch", case))
    assert np.isnan(known.first_touch_approach_mm.astype(float)).all()
    for zero in zeros:
        depth = depth_of(pressed(zero, case))
        assert depth > 1e-4
        found = run(pressed(zero, case, depth))
        # the load steps are the same solutions; approaches of 10 µm lose 1e-17 mm in the shift
        for name in ("force_N", "contact_area_fraction", "mean_separation_mm", "contacts"):
            np.testing.assert_allclose(getattr(found, name), getattr(known, name), rtol=1e-12)
        np.testing.assert_allclose(found.approach_mm + depth, known.approach_mm, atol=1e-15)
        np.testing.assert_allclose(found.first_touch_approach_mm, known.approach_mm, atol=1e-15)
        np.testing.assert_allclose(found.closure_mm + depth, known.closure_mm, atol=1e-12)
        np.testing.assert_allclose(found.patch_pressure_MPa, known.patch_pressure_MPa, rtol=1e-9)


def test_a_force_leads_to_the_same_place():
    load = {"approach": None, "force": "2 N"}
    known = run(scene("first touch", load=load))
    for zero in ZEROS:
        found = run(scene(zero, load=load))
        depth = found.steps[0].zero_mm
        np.testing.assert_allclose(found.approach_mm + depth, known.approach_mm, atol=1e-15)


@pytest.mark.long
def test_laws_of_samples_count_from_the_zero():
    def of(zero, depth=0.0):
        sections = {
            "law": {"kind": "representative"},
            "surface": {"periodic": True},
            "block": {"lengths": ["5 mm", "5 mm"]},
        }
        return Run(scene(zero, "", depth, **sections))

    known = of("first touch").make_laws()
    for zero in ZEROS:
        run_ = of(zero, of(zero).coupling.parts.zero)
        run_.make_laws()
        law = run_.laws.laws[0]
        assert law.first_touch == pytest.approx(
            known.laws[0].first_touch - run_.coupling.parts.zero
        )
        closure = np.linspace(*known.laws[0].range, 7)
        np.testing.assert_allclose(
            law.pressure(closure - run_.coupling.parts.zero),
            known.laws[0].pressure(closure),
            rtol=1e-9,
        )
        if zero == "mean plane":
            assert law.initial_separation == pytest.approx(0.0, abs=1e-15)


def test_files_count_from_the_zero(tmp_path):
    depth, tables = depth_of(pressed("mean plane", "consistent")), {}
    for zero, below in (("first touch", 0.0), ("mean plane", depth)):
        whole = Run(pressed(zero, "consistent", below))
        list(whole.load_steps())
        write_results(tmp_path / zero, whole, options=[])
        tables[zero] = read_laws(tmp_path / zero / "laws.h5")
        columns = np.genfromtxt(tmp_path / zero / "history.csv", delimiter=",", names=True)
        np.testing.assert_allclose(columns["approach_mm"], whole.history().approach_mm)
        text = next(iter(export_texts(tables[zero], "abaqus").values()))
        assert ("the mean of the heights" in text) == (zero == "mean plane")
    first, mean = tables["first touch"], tables["mean plane"]
    assert (first.zero, mean.zero) == ("first touch", "mean plane")
    for law, other in zip(first.laws, mean.laws, strict=True):
        closure = np.linspace(*law.range, 9)
        np.testing.assert_allclose(
            other.pressure(closure - depth), law.pressure(closure), rtol=1e-9
        )


def test_a_run_goes_on_from_a_checkpoint():
    given = scene("mean plane", depth=depth_of(scene("mean plane")))
    whole, half = Run(given), Run(given)
    known = [step.force_N for step in whole.load_steps()]
    steps = half.load_steps()
    next(steps), next(steps)
    again = Run(given)
    again.resume(half.checkpoint(half.coupling.state()))
    assert [step.force_N for step in again.load_steps()] == pytest.approx(known[2:], rel=1e-12)
    np.testing.assert_allclose(again.history().approach_mm, whole.history().approach_mm, atol=0.0)


def test_the_error_of_the_zero_is_a_cause():
    """It is what the plane's force changes by, and counts in full in the approach under a force."""
    given = scene("first touch")
    last = run(given).steps[-1]
    setup = Run(given).coupling
    error = setup.parts.zero_error
    assert error > 0.0
    model = setup.parts.micro  # half as many cells a side do not touch
    nearer = [model.press(Control(approach=0.5 * UP + more)).force for more in (0.0, error)]
    assert dict(last.errors)["zero"] == pytest.approx(np.diff(nearer)[0], rel=1e-4)  # residuals
    forced = run(scene("first touch", load={"approach": None, "force": "2 N"})).steps[-1]
    assert forced.approach_error_mm > error
    # the plane below a mean plane does not depend on the highest point
    depth = depth_of(scene("mean plane"))
    assert (
        dict(run(scene("mean plane", depth=depth)).steps[-1].errors)["zero"] < 1e-3 * last.force_N
    )


@pytest.mark.long
@pytest.mark.parametrize("sections", [{}, {"friction": {"coefficient": 0.37}}])
def test_the_zero_of_laws_of_samples_is_a_cause(sections):
    """A plane nearer by its error bears as much more; where it rubs, it shears as much more."""

    def last(approach):
        load = {"approach": f"{approach!r} mm"}
        if sections:
            load |= {"shear": [[3e-4, 0.0]], "shear_steps": 1}
        law = {"kind": "representative", "seeds": [2, 5]}
        block = {"lengths": ["5 mm", "5 mm"]}
        of_few = {"grid": [14, 14]}  # cells, whose top is hardly known
        given = scene(
            "first touch", "", law=law, block=block, load=load, surface=of_few, **sections
        )
        run_ = Run(given)
        *_, step = run_.load_steps()
        return step, run_.coupling.parts.zero_error

    step, error = last(0.5 * UP)
    nearer, _ = last(0.5 * UP + error)
    assert error > 1e-2 * step.approach_mm
    # laws are tabulated as far as each needs
    assert dict(step.errors)["zero"] == pytest.approx(nearer.force_N - step.force_N, rel=2e-2)
    if sections:
        more = nearer.shear_force_x_N - step.shear_force_x_N
        assert 0.9 * more < dict(step.shear_errors)["zero"] < 2.0 * more


def test_a_step_counted_from_a_height_and_back_is_the_step():
    step = run(scene("first touch")).steps[0]
    again = step.counted_from(0.125).counted_from(-0.125)
    assert again.zero_mm == 0.0 and again.approach_mm == pytest.approx(step.approach_mm, abs=1e-16)
    assert replace(again, patches=step.patches, approach_mm=step.approach_mm) == step
