"""A cycle repeats the one before, where no random scene of the verification has it."""

import tomllib

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale import Scene, run

COUPLINGS = {
    "reference": {"coupling": {"kind": "reference"}, "reference": {"fine": 0.15, "meshes": 1}},
    "samples": {"law": {"kind": "representative"}, "block": {"lengths": ["1 mm", "1 mm"]}},
}


@pytest.mark.slow
@pytest.mark.parametrize("changes", COUPLINGS.values(), ids=COUPLINGS)
def test_a_cycle_repeats_the_one_before(changes):
    data = tomllib.loads(SMALL_SCENE)
    data["block"]["cells"] = [4, 4, 3]
    data["load"] = {"force": ["0.31 N", "0.13 N"], "tilt": "free", "steps": 1, "cycles": 2}
    for name, section in changes.items():
        data[name] = data.get(name, {}) | section
    for name in ("coupling", "patches") if "law" in changes else ():
        del data[name]
    history = run(Scene.from_dict(data))
    assert len(history) == 4
    for name in ("force_N", "approach_mm", "contact_area_fraction"):
        values = getattr(history, name)
        # elastic: unloading follows loading; iterations end at 1e-8 of the load
        np.testing.assert_allclose(values[2:], values[:2], rtol=1e-6)
