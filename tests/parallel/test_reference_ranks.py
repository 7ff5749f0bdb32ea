"""Scenes with a meshed rough surface: same numbers on 1, 2 and 3 ranks, same refusals."""

import csv

import numpy as np
import pytest
from helpers.on_ranks import RANKS

from patchlaw.multiscale.cli import main
from patchlaw.multiscale.results.contacts import SPOT_COLUMNS

PAPER = "demos/scenes/paper.toml"
SMALL = [
    "coupling.kind=reference", "surface.spectrum.waves=[1, 3]", "surface.grid=[32, 32]",
    "block.grading=3", "patches.grid=[3, 2]", "load.steps=2",
    "output.figures=false", "output.report=false",
]  # fmt: skip
SCENES = {
    "up and down, with fields": [
        "reference.fine='80 um'", "load.approach=['8 um', '2 um']", "output.fields=true",
    ],
    "under a force, free to turn": [
        "reference.fine='60 um'", "load.tilt=free", "load.steps=1",
    ],
}  # fmt: skip
HISTORY = (
    "approach_mm", "force_N", "contact_area_fraction", "mean_separation_mm", "contacts", "tilt_x",
    "peak_pressure_MPa",
)  # fmt: skip
REFERENCE = ("approach_mm", "force_N", "contact_area_fraction", "force_N_mesh_1")
PATCHES = ("closure_mm", "pressure_MPa", "contact_area_fraction")


def table(path, names):
    with path.open(encoding="utf-8") as file:
        return np.array([[float(row[name]) for name in names] for row in csv.DictReader(file)])


@pytest.mark.long
@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(SCENES[name], id=name, marks=[pytest.mark.long] * ("force" in name))
        for name in SCENES
    ],
)
def test_same_numbers_on_any_number_of_ranks(waiting_ranks, root, tmp_path, scene, ranks):
    path, text = tmp_path / "scene.toml", (root / PAPER).read_text(encoding="utf-8")
    if "load.tilt=free" in scene:
        text = text.replace('approach = "8 um"', 'force = "3 N"')
    path.write_text(text, encoding="utf-8")
    results = []
    for count in (1, ranks):
        out = tmp_path / str(count)
        words = ["run", str(path), "--out", str(out), "--set", *SMALL, *scene]
        if count == 1:
            assert main(words) == 0
        else:
            done = waiting_ranks(count, "-m", "patchlaw", *words)
            assert done.returncode == 0, done.stderr
        results.append([
            table(out / f"{name}.csv", columns)
            for name, columns in (
                ("history", HISTORY), ("reference", REFERENCE), ("patches", PATCHES),
                ("contacts", SPOT_COLUMNS),
            )
        ])  # fmt: skip
        assert (out / "fields.xdmf").exists() == ("output.fields=true" in scene)
    for one, more in zip(*results, strict=True):
        # residuals of 1e-10 of the contact forces; the area's border follows them
        assert np.all(np.abs(more - one) <= 1e-8 * np.abs(one).max(axis=0))
