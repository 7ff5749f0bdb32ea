"""A sweep gives the same numbers on any number of ranks."""

import csv

import pytest
from on_ranks import RANKS

from multiscale.cli import main

SCENE = """
[surface]
spectrum = { hurst = 0.95, waves = [2, 5], rms_slope = 0.215 }
grid = [16, 16]
lengths = ["1 mm", "1 mm"]
[block]
young_modulus = "4 GPa"
poisson_ratio = 0.15
[micro]
model = "half-space"
[coupling]
kind = "analytic"
[load]
approach = "8 um"
steps = 2
[output]
figures = false
"""


@pytest.mark.parametrize("ranks", RANKS)
def test_ranks_share_the_cases(mpirun, tmp_path, ranks):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    found, vary = [], ("--vary", "surface.spectrum.seed=0..4")
    for count in (1, ranks):
        out = tmp_path / str(count)
        words = list(map(str, ("sweep", scene, *vary, "--out", out)))
        if count == 1:
            assert main(words) == 0
        else:
            done = mpirun(count, "-m", "multiscale", *words)
            assert done.returncode == 0, done.stderr
        with (out / "history.csv").open(newline="") as file:
            rows = [{**row, "wall_s": None} for row in csv.DictReader(file)]
        found.append(rows)
        assert len(list((out / "cases").glob("*.jsonl"))) == count
    assert found[0] == found[1]  # bit by bit: cases do not know the ranks
