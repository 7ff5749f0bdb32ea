"""Run scenes with an accuracy; print what their open keys became, and what runs say they kept.

A block, and a plate from a file under laws of samples, which is refined.
"""

import json
import tempfile
from pathlib import Path

import numpy as np
from helpers.box_msh import write_box
from helpers.on_ranks import tell
from mpi4py import MPI

from patchlaw.multiscale import Run, Scene

COMM = MPI.COMM_WORLD
CONSTANTS = {"young_modulus": 4037.0, "poisson_ratio": 0.21}
SPECTRUM = {"hurst": 0.87, "waves": [2, 5], "rms_slope": 0.1883, "seed": 3}


def found(scene):
    run = Run(Scene.from_dict(scene), COMM if COMM.size > 1 else None)
    steps = list(run.load_steps())
    sentence, error = run.coupling.parts.decision.sentence, run.history().accuracy.error
    resolved = json.loads(json.dumps(run.resolved))
    run.close()
    return resolved, sentence, error, steps[-1].force_N


def on_block():
    surface = {"spectrum": SPECTRUM, "lengths": [1.0, 1.0]}
    load = {"force": 1.037, "steps": 2}
    return found({"accuracy": 0.1, "surface": surface, "block": CONSTANTS, "load": load})


def on_plate(mesh):
    ticks = [np.linspace(0.0, side, n + 1) for side, n in ((3.0, 5), (1.0, 2), (0.5, 1))]
    if COMM.rank == 0:
        write_box(mesh, ticks)
    COMM.Barrier()
    body = {"mesh": str(mesh), "contact": "top", "supports": [{"surface": "bottom"}], **CONSTANTS}
    scene = {
        "accuracy": 0.004,
        "surface": {"spectrum": {**SPECTRUM, "rms_slope": 0.05}, "lengths": [0.023, 0.023]},
        "law": {"kind": "representative"},
        "body": body,
        "load": {"pressure": 3.7, "steps": 1, "zero": "mean plane"},
    }
    return found(scene)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        mesh = Path(COMM.bcast(folder)) / "plate.msh"
        everywhere = COMM.gather({"block": on_block(), "plate": on_plate(mesh)})
    tell(everywhere)
