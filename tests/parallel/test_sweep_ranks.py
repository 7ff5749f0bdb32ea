"""A sweep gives the same numbers on any number of ranks."""

import csv

import pytest
from on_ranks import RANKS
from small_scene import SMALL_SCENE

from multiscale.cli import main


@pytest.mark.parametrize("ranks", RANKS)
def test_ranks_share_the_cases(mpirun, tmp_path, ranks):
    scene = tmp_path / "scene.toml"
    scene.write_text(SMALL_SCENE)
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
