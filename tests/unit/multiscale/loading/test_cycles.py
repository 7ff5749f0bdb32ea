"""Cyclic loads under every control, with every coupling: a cycle repeats the one before."""

import tomllib
from itertools import product

import numpy as np
import pytest
from helpers.small_scene import SMALL_SCENE

from patchlaw.multiscale import Scene, run

CONTROLS = {
    "approach": {"approach": ["2 um", "0.7 um"]},
    "approach, free": {"approach": ["2 um", "0.7 um"], "tilt": "free"},
    "force": {"force": ["0.31 N", "0.13 N"]},
    "force, free": {"force": ["0.31 N", "0.13 N"], "tilt": "free"},
}
COUPLINGS = {
    "analytic": {"coupling": {"kind": "analytic"}},
    "asperities": {"coupling": {"kind": "analytic"}, "micro": {"model": "elliptic"}},
    "isolated": {"coupling": {"kind": "isolated", "table_tolerance": 0.01}},
    "consistent": {"coupling": {"kind": "consistent", "table_tolerance": 0.01}},
    "concurrent": {"coupling": {"kind": "concurrent"}},
    "reference": {
        "coupling": {"kind": "reference"},
        "reference": {"fine": 0.15, "meshes": 1},
    },
    "representative": {"law": {"kind": "representative"}, "patches": {}},
}


CASES = [
    *product(("analytic", "concurrent"), CONTROLS),  # the stepper's controls are those of all
    *product(set(COUPLINGS) - {"analytic", "concurrent"}, ["force, free"]),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "load"),
    [(COUPLINGS[name], CONTROLS[control]) for name, control in sorted(CASES)],
    ids=[f"{name}-{control}" for name, control in sorted(CASES)],
)
def test_a_cycle_repeats_the_one_before(changes, load):
    data = tomllib.loads(SMALL_SCENE)
    data["block"]["cells"] = [4, 4, 3]
    data["load"] = load | {"steps": 1, "cycles": 2}
    for name, section in changes.items():
        data[name] = data.get(name, {}) | section
    if "law" in changes:
        data["block"]["lengths"] = data["surface"]["lengths"]
        for name in ("coupling", "patches"):
            data.pop(name, None)
    history = run(Scene.from_dict(data))
    assert len(history) == 4
    for name in ("force_N", "approach_mm", "contact_area_fraction"):
        values = getattr(history, name)
        # elastic: unloading follows loading; iterations end at 1e-8 of the load
        np.testing.assert_allclose(values[2:], values[:2], rtol=1e-6)
