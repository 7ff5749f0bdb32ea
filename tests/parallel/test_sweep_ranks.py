"""A sweep gives the same numbers on any number of ranks."""

import csv

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


def test_ranks_share_the_cases(mpirun, tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    found = []
    for ranks in (1, 2, 3):
        out = tmp_path / str(ranks)
        vary = ("--vary", "surface.spectrum.seed=0..4")
        done = mpirun(ranks, "-m", "multiscale", "sweep", scene, *vary, "--out", out)
        assert done.returncode == 0, done.stderr
        with (out / "history.csv").open(newline="") as file:
            rows = [{**row, "wall_s": None} for row in csv.DictReader(file)]
        found.append(rows)
        assert len(list((out / "cases").glob("*.jsonl"))) == ranks
    assert found[0] == found[1] == found[2]  # bit by bit: cases do not know the ranks
