"""A face that is pressed beyond the rows of its laws gets longer ones, as far as there are any."""

import numpy as np
import pytest

from patchlaw import NotConverged
from patchlaw.multiscale import Run, Scene, run
from patchlaw.multiscale.runs.output.results_folder import read_checkpoint
from patchlaw.support.files import write_record

SCENE = {
    "surface": {
        "spectrum": {"hurst": 0.8, "waves": [2, 5], "rms_slope": 0.1, "seed": 1},
        "grid": [16, 16],
        "lengths": ["1 mm", "1 mm"],
    },
    "block": {
        "young_modulus": "4 GPa",
        "poisson_ratio": 0.3,
        "height": "10 mm",
        "lengths": ["10 mm", "10 mm"],
        "cells": [3, 3, 2],
    },
    "law": {"kind": "representative", "seeds": [1, 2]},
    "load": {"force": "2 kN", "steps": 1},
    "output": {"check": "none"},  # errors are measured elsewhere
}


@pytest.mark.long
def test_laws_that_end_too_early_are_extended():
    """The laws that were made long enough from the start are the witness."""
    scene = Scene.from_dict(SCENE)
    whole = Run(scene)
    (wanted,) = whole.load_steps()
    assert wanted.newton_iterations <= 4  # from a uniform pressure; from zero it would be ten
    short = Run(scene.with_({"law.largest_pressure": "5 MPa", "load.steps": 4}))
    early = short.make_laws()
    *_, step = short.load_steps()
    assert early.largest_pressure < 7.0 and short.coupling.table.largest_pressure > 20.0
    # both laws are right to the tolerance of their rows, 1e-3 of the pressure
    assert step.approach_mm == pytest.approx(wanted.approach_mm, rel=2e-3)
    assert step.force_N == pytest.approx(2000.0, rel=1e-9)
    (kept,), (longer,) = early.laws, short.coupling.table.laws
    for name, column in kept.rows.columns():  # earlier load steps stay what they were
        np.testing.assert_array_equal(getattr(longer.rows, name)[: len(kept.rows)], column)
    (other,) = whole.coupling.table.laws
    closures = np.linspace(0.1, 0.95, 50) * min(longer.range[1], other.range[1])
    off = longer.pressure(closures) - other.pressure(closures)
    least = 0.03 * other.rows.pressure[-1]  # smaller loads count as this much, see `refinement`
    assert np.all(np.abs(off) <= 5e-3 * np.maximum(other.pressure(closures), least))
    assert any("the laws were extended to" in note for note in short.history().notes)


@pytest.mark.long
def test_a_run_goes_on_with_the_extended_laws(tmp_path):
    scene = Scene.from_dict(SCENE).with_(
        {"law.seeds": [1], "law.largest_pressure": "5 MPa", "load.steps": 4}
    )
    first = Run(scene)
    steps = first.load_steps()
    for _ in range(3):
        next(steps)
    path = write_record(tmp_path / "checkpoint.state", first.checkpoint(first.coupling.state()))
    last = next(steps)
    kept, again = read_checkpoint(path), Run(scene)
    again.resume(kept)
    (resumed,) = again.load_steps()
    # Newton's iteration ends at 1e-9 of the load
    assert resumed.approach_mm == pytest.approx(last.approach_mm, rel=1e-8)
    np.testing.assert_allclose(
        again.laws.laws[0].rows.pressure, first.laws.laws[0].rows.pressure, rtol=1e-12
    )


@pytest.mark.long
def test_what_no_law_bears_is_refused_with_a_remedy_that_helps():
    soft = Scene.from_dict(SCENE).with_(
        {"law.seeds": [1], "micro.hardness": "25 MPa", "law.largest_pressure": "5 MPa"}
    )
    with pytest.raises(NotConverged, match=r"LAW_RANGE.*95 % of the hardness.*take a smaller load"):
        run(soft)


def test_laws_in_full_contact_go_on():
    """Their rows stay as many: beyond full contact one straight line goes on."""
    scene = Scene.from_dict(SCENE).with_({"law.largest_pressure": "1 GPa", "law.seeds": [1]})
    coupling = Run(scene).coupling
    table = coupling.make_laws()
    (law,) = table.laws
    assert law.rows.closure[-1] > law.initial_separation  # full contact is behind it
    (longer,) = coupling._make_table(before=table).laws
    assert longer.rows.pressure[-1] == pytest.approx(2.0 * law.rows.pressure[-1], rel=1e-3)
