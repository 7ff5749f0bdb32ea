"""Accuracies on bodies drawn at random: what is chosen for them, and whether it is kept.

Run by hand: `.venv/bin/python benchmarks/body_accuracy.py [--bodies 10] [--first 0]`, also
under mpirun. Every body has rough samples of its own, and runs with `accuracy` and all else open.
The force at the same approach with cells cut into eight twice more, four times as many heights
along a side of the samples, laws to a tenth of the tolerance and finite slopes is taken for the
true one.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import sys
import tempfile
import time
from pathlib import Path

from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from random_bodies import drawn, mesh_of, rough_scene

from patchlaw.macro import write_mesh
from patchlaw.multiscale import Run, Scene

COMM = MPI.COMM_WORLD
MOST_UNKNOWNS = 500_000  # of the finest mesh; beyond, one refinement less


def finer(scene, coupling, approach):
    """Return the resolved scene with all refined, at an approach, and the refinements."""
    unknowns = coupling.parts.body.unknowns * (8 if coupling.parts.body.degree == 1 else 1)
    times = 2 if 64 * unknowns <= MOST_UNKNOWNS else 1
    resolved = coupling.scene
    data = dict(scene.written)
    data.pop("accuracy")
    data["body"] = {**data["body"], "element": "quadratic",
                    "refinements": resolved.body.refinements + times}  # fmt: skip
    data["surface"] = {**data["surface"], "grid": [4 * n for n in coupling.parts.surface.grid]}
    data["coupling"] = {"table_tolerance": 0.1 * coupling.table_tolerance}
    data["load"] = {**data["load"], "approach": approach}
    del data["load"]["pressure"]
    data["micro"] = {"finite_slopes": True}
    data["output"] = {**data["output"], "check": "none"}
    return Scene.from_dict(data), times


def solved(scene):
    """Return the run of a scene, its last load step and the CPU time of all ranks [s]."""
    began = time.process_time()
    run = Run(scene, COMM if COMM.size > 1 else None)
    list(run.load_steps())
    return run, run.history(), COMM.allreduce(time.process_time() - began)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bodies", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--accuracy", type=float, nargs="+", default=[0.05, 0.02])
    choice = parser.parse_args()
    kept, said = dict.fromkeys(choice.accuracy, 0), dict.fromkeys(choice.accuracy, 0)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(COMM.bcast(folder))
        for seed in range(choice.first, choice.first + choice.bodies):
            body = drawn(seed, coarser=1.5)
            mesh = folder / f"{seed}.xdmf"
            write_mesh(mesh_of(body, COMM), mesh)
            for accuracy in choice.accuracy:
                scene = rough_scene(body, mesh, seed, accuracy=accuracy)
                run, history, seconds = solved(scene)
                force, verdict = float(history.force_N[-1]), history.accuracy
                true_scene, times = finer(scene, run.coupling, float(history.approach_mm[-1]))
                chosen, element = run.coupling, run.scene.body.element
                true_run, true_history, _ = solved(true_scene)
                true = force / float(true_history.force_N[-1]) - 1.0
                is_kept = abs(true) <= accuracy
                kept[accuracy] += is_kept
                said[accuracy] += bool(verdict.kept)
                if COMM.rank == 0:
                    error = "unknown" if verdict.error is None else f"{100 * verdict.error:.2f}"
                    print(
                        f"| {seed} {body.shape} | {100 * accuracy:g} % | {element}, "
                        f"{run.scene.body.refinements} | {chosen.parts.body.unknowns} | "
                        f"{chosen.parts.surface.grid[0]} | "
                        f"{'yes' if chosen.scene.micro.finite_slopes else 'no'} | {error} | "
                        f"{100 * true:+.2f} (× {times}) | {verdict.kept} | {seconds:.0f} s |",
                        flush=True,
                    )
                run.close()
                true_run.close()
    if COMM.rank == 0:
        for accuracy in choice.accuracy:
            print(f"{100 * accuracy:g} %: kept for {kept[accuracy]} of {choice.bodies}, "
                  f"said to be kept for {said[accuracy]}")  # fmt: skip


if __name__ == "__main__":
    main()
