"""Run a scene with an accuracy; print what its open keys became, and what the run says it kept."""

import json

from mpi4py import MPI

from multiscale import Run, Scene

COMM = MPI.COMM_WORLD

if __name__ == "__main__":
    spectrum = {"hurst": 0.87, "waves": [2, 5], "rms_slope": 0.1883, "seed": 3}
    run = Run(
        Scene.from_dict(
            {
                "accuracy": 0.1,
                "surface": {"spectrum": spectrum, "lengths": [1.0, 1.0]},
                "block": {"young_modulus": 4037.0, "poisson_ratio": 0.21},
                "load": {"force": 1.037, "steps": 2},
            }
        ),
        COMM if COMM.size > 1 else None,
    )
    list(run.load_steps())
    accuracy = run.history().accuracy
    everywhere = COMM.gather((run.resolved, run.coupling.decision.sentence, accuracy.error))
    if COMM.rank == 0:
        print(json.dumps(everywhere, sort_keys=True))
