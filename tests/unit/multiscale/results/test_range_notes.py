"""What a micro model says about its range reaches the history of a run, whatever the coupling."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.along import respond

from patchlaw import Scene, run
from patchlaw.geometry import Control, PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.micro import BodyModes, micro_model
from patchlaw.multiscale import CellContact, consistent_laws, isolated_laws
from patchlaw.multiscale.loading.load_step import CLEAR
from patchlaw.multiscale.results.history import range_notes

PAPER = Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml"
PATCHES = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
END = 40e-3
LARGEST = Control(approach=END, tilt=(0.0, 0.0))


@pytest.fixture(scope="module")
def parts():
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=3)
    surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
    model = micro_model("circular-independent", surface, contact_modulus=4000.0)
    return surface, model, patch_means(surface, PATCHES)


def noted(steps, table=None):
    return list(range_notes(steps, table))


def step(number, *pressures, warnings=()):
    state = SimpleNamespace(pressure_MPa=np.array(pressures))
    return SimpleNamespace(step=number, patches=state, warnings=warnings)


@pytest.mark.parametrize("body", [None, BodyModes((1.0, 1.0), [[1e-4]])], ids=["alone", "body"])
def test_a_model_solved_at_every_step_speaks_for_itself(parts, body):
    _, model, means = parts
    model = replace(model, body=body)
    coupling = CellContact(model, PATCHES, means)
    few, many = (coupling.press(Control(approach=approach)) for approach in (4e-3, END))
    whole = model.press(Control(approach=END), patches=PATCHES, mean_heights=means)
    assert few.warnings == () and many.warnings == (whole.warning,) != ("",)
    assert noted([few]) == []
    (note,) = noted([few, step(2, warnings=many.warnings)])
    assert note.startswith("load steps outside the micro model's range of validity: 1 of 2; first")
    assert f"step 2: {whole.warning}" in note


@pytest.mark.parametrize("coupling", ["isolated", "consistent"])
def test_laws_know_from_where_on_they_were_warned_of(parts, coupling):
    _, model, means = parts
    if coupling == "consistent":
        table = consistent_laws(model, PATCHES, mean_heights=means, largest=LARGEST, tolerance=0.1)
        models = [(model, PATCHES, means)] * PATCHES.count
    else:
        ends = np.full(PATCHES.count, END)
        table = isolated_laws(model, PATCHES, mean_heights=means, closure_ends=ends, tolerance=0.1)
        alone = (model.of_patch(PATCHES, index) for index in range(PATCHES.count))
        models = [(*one, means[[index]]) for index, one in enumerate(alone)]
    for law, (micro, patches, heights) in zip(table.laws, models, strict=True):
        row = int(np.searchsorted(law.rows.pressure, law.warning_pressure))
        assert law.rows.pressure[row] == law.warning_pressure
        told = (
            respond(micro, law.rows.approach[1:], patches=patches, mean_heights=heights).warning
            != ""
        )
        assert told[row - 1] and not told[: row - 1].any()


def test_steps_are_counted_from_the_first_patch_beyond_its_law(parts):
    _, model, means = parts
    table = consistent_laws(model, PATCHES, mean_heights=means, largest=LARGEST, tolerance=0.1)
    limit = np.array([law.warning_pressure for law in table.laws])
    below = 0.99 * limit
    beyond = np.where(np.arange(4) < 3, limit, below)
    assert noted([step(1, *below)], table) == []
    (note,) = noted([step(1, *below), step(2, *beyond), step(3, *(1.01 * limit))], table)
    assert "range of validity: 2 of 3; first step 2: 3 of 4 patches are loaded beyond" in note
    assert "the range of the model circular-independent; micro.model = 'half-space'" in note


def test_models_that_see_cells_have_no_range(parts):
    surface, _, means = parts
    model = micro_model("half-space", surface, contact_modulus=4000.0)
    table = consistent_laws(model, PATCHES, mean_heights=means, largest=LARGEST, tolerance=0.1)
    assert all(law.warning_pressure == np.inf for law in table.laws)
    assert noted([step(1, *(law.rows.pressure[-1] for law in table.laws))], table) == []


@pytest.mark.parametrize(
    "interface", ["patchwise", pytest.param("pointwise", marks=pytest.mark.long)]
)
def test_a_free_plane_that_presses_nothing_has_one_tilt_or_says_so(interface):
    """The summits of patches lie around the middle: between them a plane comes lower than one."""
    small = ["surface.grid=[32, 32]", "block.cells=[4, 4, 3]", "patches.grid=[2, 2]"]
    load = ["load.tilt=free", "load.approach=['0.5 um', '0.3 um']", "load.steps=1"]
    words = [*small, *load, f"coupling.interface={interface}", "output.check=none"]
    history = run(Scene.load(PAPER, words))
    assert not any(history.force_N)
    said = any(CLEAR in note for note in history.notes)
    assert said == (interface == "pointwise")
    (tilt, again) = (step.tilt for step in history.steps)
    assert said or (tilt == pytest.approx(again, rel=1e-12) and any(tilt))
