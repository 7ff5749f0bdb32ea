"""The scene that the tests of hard cases start from, and what they change in it."""

from copy import deepcopy

import numpy as np

from patchlaw.multiscale import PatchContact, Scene, make_setup, run

KINDS = ("isolated", "consistent", "concurrent", "analytic")
BASE = {
    "surface": {
        "spectrum": {"hurst": 0.8, "waves": [2, 6], "rms_slope": 0.2, "seed": 2},
        "grid": [32, 32],
        "lengths": ["1 mm", "1 mm"],
    },
    "block": {"young_modulus": "4 GPa", "poisson_ratio": 0.15, "cells": [6, 6, 4]},
    "patches": {"grid": [4, 4]},
    "micro": {"model": "half-space"},
    "load": {"approach": "8 um", "steps": 1},
    "output": {"check": "none"},  # measured errors are the subject of other tests
}


def scene(**changes):
    """Return the scene with other values of ``section__key``; None takes a key out."""
    data = deepcopy(BASE)
    for key, value in changes.items():
        section, name = key.split("__")
        data.setdefault(section, {})[name] = value
        if value is None:
            del data[section][name]
    return Scene.from_dict(data)


def history(**changes):
    """Run the scene with other values."""
    return run(scene(**changes))


def force_on_exact_block(**changes):
    """Return the force by isolated laws on the half-space and what the block adds to it [N]."""
    coupling = make_setup(scene(coupling__kind="isolated", **changes))
    path = coupling.parts.path
    solver = PatchContact(coupling.make_laws(), coupling.bodies.patch_compliance())
    return solver.press(path.control(path.largest())).force_N


def coarse_tables(kind):
    """Return what makes laws of few rows, where not their error is the subject."""
    return {"coupling__table_tolerance": 1e-2} if kind in ("isolated", "consistent") else {}


def from_file(folder, heights):
    """Return what to change in the scene for the surface to be these heights."""
    path = folder / "heights.npy"
    np.save(path, heights)
    return {"surface__spectrum": None, "surface__grid": None, "surface__file": str(path)}


def centred(count):
    """Return the coordinates of cell centres on the unit square, shapes (n, 1) and (n,)."""
    x = (np.arange(count) + 0.5) / count - 0.5
    return x[:, None], x
