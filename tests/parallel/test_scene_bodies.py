"""Scenes on bodies from meshes give the same on one rank and on two or three."""

import json

import numpy as np
import pytest
from helpers.box_msh import write_box

from patchlaw.geometry import BlockShape


@pytest.mark.slow
def test_bodies_of_scenes_on_any_number_of_ranks(waiting_ranks, root, tmp_path):
    x, y, z = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(4, 3, 2)).ticks
    write_box(tmp_path / "cube.msh", (x, y, z))
    write_box(tmp_path / "above.msh", (x[::2], y, -z[::-1]))
    write_box(tmp_path / "curved.msh", (x, y, z), crown=1e-2, order=2)
    half = np.linspace(0.0, 1.0, 3)
    write_box(tmp_path / "small 0.msh", (half, half, half - 1.0))
    write_box(tmp_path / "small 1.msh", (half, half, half))
    found = {}
    for ranks in (1, 2, 3):
        words = (root / "tests/parallel/scene_body_script.py", tmp_path)
        ended = waiting_ranks(ranks, *words, timeout=900)
        assert ended.returncode == 0, ended.stderr
        found[ranks] = json.loads(ended.stdout.splitlines()[-1])
    assert found[1].keys() == found[2].keys() | found[3].keys()
    for ranks in (2, 3):
        for name, numbers in found[ranks].items():
            assert numbers == pytest.approx(found[1][name], rel=1e-8), (name, ranks)
