"""Fields of chosen load steps: which are written, and what loads the block."""

from pathlib import Path

import numpy as np
import pytest
from helpers.pressed_cells import pressed_cells
from helpers.resumed_runs import gone_on, ran_past

from patchlaw import InputError
from patchlaw.multiscale import Run, Scene, make_setup

h5py = pytest.importorskip("h5py")

PAPER = Path(__file__).parents[5] / "demos" / "scenes" / "paper.toml"
SMALL = ["surface.grid=[32, 32]", "block.cells=[8, 8, 5]", "load.steps=3", "output.check=none"]
CONTACTS = ["coupling.kind=concurrent", "micro.model=half-space"]
COUPLINGS = {
    "half-space": CONTACTS,
    "asperities": ["coupling.kind=concurrent"],
    "laws on the mesh": ["coupling.interface=pointwise"],
    "laws, condensed": [],
    "free plane": ["coupling.kind=consistent", "micro.model=half-space", "load.tilt=free"],
    "reference": ["coupling.kind=reference", "reference.fine='80 um'"],
}


def scene(*more):
    return Scene.load(PAPER, [*SMALL, *more])


def fields(path):
    """Return what a file holds, by field and load step."""
    with h5py.File(path.with_suffix(".h5")) as file:
        return {
            (name, int(step)): values[...]
            for name, group in file["Function"].items()
            for step, values in group.items()
        }


def written(tmp_path, *more):
    """Run a scene; return it and its fields."""
    run = Run(scene(*more))
    list(run.load_steps())
    return run, fields_of(run, tmp_path / "fields.xdmf")


def fields_of(run, path):
    """Write what a run has kept; return it."""
    run.observers.fields.write(path, run.steps, finished=run.finished)
    return fields(path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "coupling",
    [
        pytest.param(words, id=name, marks=[pytest.mark.long] * (name == "free plane"))
        for name, words in COUPLINGS.items()
    ],
)
def test_every_coupling_with_a_body_has_fields_of_every_step(tmp_path, coupling):
    run, found = written(tmp_path, *coupling, "output.fields=all")
    names = "displacement", "stress", "von_Mises", "pressure"
    assert set(found) == {(name, step) for name in names for step in (1, 2, 3)}
    for step in run.steps:
        lowest = found["displacement", step.step][:, 2].min()
        assert -step.approach_mm < lowest < 0.0
        pressure, stress = found["pressure", step.step], found["stress", step.step]
        if "coupling.kind=reference" in coupling:
            assert pressure.max() > 0.0
            continue
        # pressures of 8 × 8 facets on 1 mm² carry the whole force
        force = pressure.sum() / 64
        assert force == pytest.approx(step.force_N, rel=1e-6)
        # every layer carries it too; the middles of clamped cells are a few percent off
        assert -stress[:, 8].sum() / 320 == pytest.approx(step.force_N, rel=0.05)


@pytest.mark.long
@pytest.mark.parametrize(
    ("asked", "steps"), [("true", {3}), ("last", {3}), ("[1, 2]", {1, 2}), ("all", {1, 2, 3})]
)
def test_fields_are_kept_of_the_steps_that_are_named_alone(asked, steps):
    run = Run(scene(*CONTACTS, f"output.fields={asked}"))
    list(run.load_steps())
    assert set(run.observers.fields.kept) == steps


def test_nothing_is_kept_that_no_field_is_written_of():
    for more in (CONTACTS, ["coupling.kind=analytic", "output.fields=all"]):
        run = Run(scene(*more))
        list(run.load_steps())
        assert not run.observers.fields.kept


@pytest.mark.long
def test_contacts_load_the_face_where_they_are(tmp_path):
    run, found = written(tmp_path, *CONTACTS, "output.fields=last")
    (record,) = run.contacts
    blocks = record.pressure_MPa.reshape(8, 4, 8, 4).mean(axis=(1, 3))
    assert np.count_nonzero(blocks) < 20  # not the means of 4 × 4 patches
    shown = np.sort(found["pressure", 3].ravel())[-64:]
    np.testing.assert_allclose(shown, np.sort(blocks.ravel()), atol=1e-9 * blocks.max())


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "half-space",
        "laws on the mesh",
        *(pytest.param(one, marks=pytest.mark.long) for one in ("reference", "laws, condensed")),
    ],
)
def test_a_resumed_run_writes_the_fields_of_a_whole_one(tmp_path, name):
    asked, path = scene(*COUPLINGS[name], "output.fields=[1, 3]"), tmp_path / "checkpoint.state"
    whole = fields_of(ran_past(asked, 2, path), tmp_path / "whole.xdmf")
    again, _ = gone_on(asked, path)
    assert set(again.observers.fields.kept) == {3}
    found = fields_of(again, tmp_path / "again.xdmf")
    assert set(found) == set(whole)
    for key, values in whole.items():
        # equilibria are found to 1e-9 of the load
        np.testing.assert_allclose(found[key], values, atol=1e-7 * np.abs(values).max())


SHEARED = {
    "force": "0.9 N",
    "steps": 1,
    "shear": [["1.4 um", "0 um"], ["0.4 um", "1.23 um"]],
    "shear_steps": 1,
}
RUBS = {
    "concurrent": ("concurrent", {"friction": {"coefficient": 0.3, "coupled": False}}),
    "coupled": ("concurrent", {"friction": {"coefficient": 0.3, "coupled": True}}),
    "laws": ("consistent", {"friction": {"coefficient": 0.3}}),
}


def rubbing(name, **output):
    kind, sections = RUBS[name]
    block = {"young_modulus": 4000.0, "poisson_ratio": 0.15, "cells": [8, 8, 8]}
    asked = {"check": "none", "figures": False, "contact": "none", **output}
    return pressed_cells(kind, SHEARED, block=block, output=asked, **sections)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param("concurrent", marks=pytest.mark.long), "coupled", "laws"]
)
def test_fields_have_the_shear_and_are_the_same_in_a_resumed_run(tmp_path, name):
    asked, path = rubbing(name, fields="all"), tmp_path / "checkpoint.state"
    run = ran_past(asked, 2, path)
    found = fields_of(run, tmp_path / "whole.xdmf")
    for step in run.steps:
        mean = found["stress", step.step].reshape(-1, 3, 3).mean(axis=0)  # of equal cells, on 1 mm²
        force = step.shear_force_x_N, step.shear_force_y_N, -step.force_N
        # every cross section carries the forces; the middles of cells are a little off
        np.testing.assert_allclose(mean[2], force, atol=0.01 * step.force_N)
        assert np.hypot(*force[:2]) > 0.1 * step.force_N or step.step == 1
    again, after = gone_on(asked, path)
    assert [one.step for one in after] == [3]
    for key, values in fields_of(again, tmp_path / "again.xdmf").items():
        error = np.abs(values - found[key]).max() / np.abs(found[key]).max()
        # the same stresses; displacements of laws are those of their Newton's method, to 1e-9
        assert error <= (1e-7 if name == "laws" else 1e-10), key


def test_load_steps_that_will_not_be_are_refused():
    text = r"output.fields = \[1, 4\]: there are fewer load steps .allowed: numbers up to 3"
    with pytest.raises(InputError, match=text):
        make_setup(scene(*CONTACTS, "output.fields=[1, 4]"))


@pytest.mark.parametrize("asked", ["[]", "[0]", "3", "[true]", "first", "[1.5]"])
def test_what_names_no_load_steps_is_refused(asked):
    with pytest.raises(InputError, match=r"output.fields = .* does not name load steps .allowed: "):
        scene(f"output.fields={asked}")
