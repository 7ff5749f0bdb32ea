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
                "accuracy": 0.05,
                "surface": {"spectrum": spectrum, "lengths": [1.0, 1.0]},
                "block": {"young_modulus": 4037.0, "poisson_ratio": 0.21},
                "load": {"force": 1.037, "steps": 2},
            }
        ),
        COMM if COMM.size > 1 else None,
    )
    list(run.load_steps())
    accuracy = run.history().accuracy
    told = (json.dumps(run.resolved, sort_keys=True), run.coupling.decision.sentence)
    everywhere = COMM.gather((*told, accuracy.error))
    if COMM.rank == 0:
        assert len(set(everywhere)) == 1
        print(*told, accuracy.error, sep="\n")
