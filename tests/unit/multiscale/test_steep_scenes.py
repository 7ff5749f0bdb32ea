"""Scenes on steep surfaces: refused, or with an error that says so."""

import json
import math

import numpy as np
import pytest

from patchlaw.geometry import Control
from patchlaw.micro import FiniteSlopes, HalfSpaceModel
from patchlaw.multiscale import Run, Scene, run
from patchlaw.multiscale.runs.output.results import write_results
from patchlaw.support import NotConverged

BLOCK = {"young_modulus": 4000.0, "poisson_ratio": 0.27}


def spectrum(rms_slope, seed=9):
    return {"hurst": 0.83, "waves": [2, 5], "rms_slope": rms_slope, "seed": seed}


def scene(rms_slope, load=None, **sections):
    surface = {"spectrum": spectrum(rms_slope), "grid": [48, 48], "lengths": [1.0, 1.0]}
    return Scene.from_dict({
        "surface": surface, "block": BLOCK, "coupling": {"kind": "analytic"},
        "load": {"steps": 1} | (load or {"force": 1.7}), "output": {"figures": False},
    } | sections)  # fmt: skip


@pytest.mark.parametrize("load", [{"force": 1.7}, {"approach": 9e-3}])
def test_an_error_that_is_not_measured_is_said_and_no_number(load, tmp_path):
    given = scene(0.93, load, micro={"finite_slopes": False}, accuracy=0.49)
    ended = Run(given)
    (step,) = list(ended.load_steps())
    assert dict(step.errors)["slopes"] == math.inf
    assert None in (step.force_error_N, step.approach_error_mm)
    notes = ended.history().notes
    assert any("slopes not measured" in note and "no stated error" in note for note in notes)
    assert any("accuracy of 49 %" in note and "is not known" in note for note in notes)
    write_results(tmp_path, ended, options=[])
    kept = json.loads((tmp_path / "provenance.json").read_text())
    assert kept["errors_N"][0]["slopes"] is None
    assert "not measured" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("rms_slope", [0.05, 0.79])
def test_where_slopes_count_their_error_is_not_zero(rms_slope):
    (step,) = run(scene(rms_slope)).steps
    assert step.elastic_energy_mJ > 0.0
    assert step.approach_mm > 0.0
    assert dict(step.errors)["slopes"] > 1e-3 * rms_slope**2 * step.force_N


def test_loads_that_coarse_cells_do_not_feel_have_errors():
    """The highest of half as many cells a side lies lower, and is not touched."""
    touch = HalfSpaceModel(Run(scene(0.2)).coupling.parts.surface, contact_modulus=1.0).first_touch
    (step,) = run(scene(0.2, {"approach": 1.02 * touch})).steps
    assert step.force_N > 0.0
    assert dict(step.errors)["slopes"] > 0.0
    (step,) = run(scene(0.2, {"force": step.force_N})).steps
    assert step.approach_error_mm is None or step.approach_error_mm > 0.0


class Repelling(FiniteSlopes):
    """A term that takes back more than the half-space gives: pressures gain energy."""

    def __init__(self):
        pass

    def displacement(self, pressure):
        return -3.0 * pressure / np.sqrt(np.mean(pressure**2) + 1e-300) * 1e-2

    def on_half_space(self):
        return self

    def error(self, pressure):
        return 0.0


def test_pressures_without_an_energy_are_no_solution():
    surface = Run(scene(0.2)).coupling.parts.surface
    model = HalfSpaceModel(surface, contact_modulus=4000.0, slopes=(Repelling(),))
    with pytest.raises(NotConverged, match=r"finite slopes.*micro\.finite_slopes = false"):
        model.press(Control(force=1.3))
