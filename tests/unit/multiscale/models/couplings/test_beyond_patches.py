"""Points of a face that come further than the rows of its patches get longer laws."""

import numpy as np
import pytest

from patchlaw import NotConverged
from patchlaw.multiscale import FaceContact, Run, Scene
from patchlaw.multiscale.laws import of_patches
from patchlaw.multiscale.runs.output.results_folder import read_checkpoint
from patchlaw.support.files import write_record

SCENE = Scene.from_dict({
    "surface": {
        "spectrum": {"hurst": 0.8, "waves": [1, 4], "rms_slope": 0.1, "seed": 3},
        "grid": [16, 16],
        "lengths": ["1 mm", "1 mm"],
    },
    "block": {
        "young_modulus": "20 GPa", "poisson_ratio": 0.1, "height": "1 mm", "cells": [3, 3, 2]
    },
    "patches": {"grid": [2, 2]},
    "coupling": {"kind": "consistent", "interface": "pointwise", "table_tolerance": 0.02},
    "load": {"force": ["100 N", "600 N", "100 N"], "steps": 1},
    "output": {"check": "none"},  # errors are those of the patches' cells
})  # fmt: skip


@pytest.mark.long
def test_laws_that_end_too_early_are_extended(tmp_path, monkeypatch):
    """The laws that were made long enough from the start are the witness."""
    whole = Run(SCENE)
    short = whole.make_laws()
    steps = whole.load_steps()
    first = next(steps)
    assert whole.coupling.table is short
    path = write_record(tmp_path / "checkpoint.state", whole.checkpoint(whole.coupling.state()))
    largest, last = steps
    longer = whole.coupling.table
    assert longer is not short
    assert any("the laws were extended to" in note for note in whole.history().notes)

    kept = np.isin(longer.path.approach, short.path.approach)
    assert kept.sum() == len(short.path.approach)  # earlier rows stay
    np.testing.assert_allclose(longer.path.force[kept], short.path.force, rtol=1e-3)
    assert last.approach_mm == pytest.approx(first.approach_mm, rel=2e-3)

    again = Run(SCENE)
    again.resume(read_checkpoint(path))
    for found, wanted in zip(again.load_steps(), (largest, last), strict=True):
        assert found.approach_mm == pytest.approx(wanted.approach_mm, rel=1e-8)

    monkeypatch.setattr(of_patches, "_POINTWISE_RESERVE", 10.0)
    other = Run(SCENE)
    for found, wanted in zip(other.load_steps(), (first, largest, last), strict=True):
        assert found.approach_mm == pytest.approx(wanted.approach_mm, rel=1e-2)
    assert not other.coupling.extensions

    by_approach = SCENE.with_({"load.force": None, "load.approach": largest.approach_mm})
    monkeypatch.undo()
    (step,) = Run(by_approach).load_steps()
    assert step.force_N == pytest.approx(600.0, rel=1e-2)


def test_given_laws_stay_what_they_are():
    run = Run(SCENE)
    table, face = run.make_laws(), run.coupling.bodies.contact_face
    contact = FaceContact(run.coupling._problem(face, table), table, face)
    with pytest.raises(NotConverged, match="LAW_RANGE"):
        contact.press(run.coupling.parts.path.largest_controls[0])


@pytest.mark.long
def test_laws_end_where_surfaces_do_not_come_nearer():
    coupling = Run(SCENE).coupling
    table = coupling.make_laws()
    for _ in range(10):
        longer = coupling._make_table(lambda *told: None, table)
        if longer is table:
            break
        table = longer
    assert longer is table
