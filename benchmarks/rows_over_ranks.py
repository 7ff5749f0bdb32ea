"""Laws and load steps on 1 and 2 ranks: seconds of their parts, and what of two ranks is gained.

Run by hand on an idle machine: ``.venv/bin/python benchmarks/rows_over_ranks.py [--cells N]
[--pairs N] [--kind consistent|isolated|concurrent] [--approach µm]``. 33 rows of consistent laws on
the paper's cube, isolated laws of 16 patches, or 4 load steps that rank 0 solves with the cores of
both; one thread a rank. Runs on 1 and on 2 ranks take turns; medians. Two processes that do the
same at once, each for itself, tell what the memory allows: no sharing of rows can exceed that.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from helpers.mpi_environment import MPI_ENVIRONMENT

ROOT = Path(__file__).parents[1]
ENVIRONMENT = os.environ | MPI_ENVIRONMENT | {"PATCHLAW_CACHE": "off", "PYTHONPATH": str(ROOT)}
ROWS = 33
MPIRUN = ("mpirun", "-n")


def scene(choice: argparse.Namespace) -> dict:
    """Return the paper's cube with half-space contacts."""
    return {
        "surface": {
            "spectrum": {"hurst": 0.95, "waves": [2, 10], "rms_slope": 0.215, "seed": 1},
            "grid": [choice.cells, choice.cells],
            "lengths": [1.0, 1.0],
        },
        "block": {"height": 1.0, "young_modulus": 4000.0, "poisson_ratio": 0.15},
        "coupling": {"kind": choice.kind},
        "load": {"approach": 1e-3 * choice.approach, "steps": 4},
        "output": {"check": "none"},
    }


def measure(choice: argparse.Namespace) -> None:
    """Make the laws on this rank and the others; rank 0 prints the facts as JSON."""
    from mpi4py import MPI

    import patchlaw.macro.bodies  # noqa: F401 imports are no part of the times
    from patchlaw.multiscale import Run, Scene, consistent_laws

    comm = MPI.COMM_WORLD if MPI.COMM_WORLD.size > 1 else None
    times = {}

    def timed(name, work):
        MPI.COMM_WORLD.Barrier()
        began = time.perf_counter()
        found = work()
        MPI.COMM_WORLD.Barrier()
        times[name] = time.perf_counter() - began
        return found

    run = timed("set-up", lambda: Run(Scene.from_dict(scene(choice)), comm))
    setup = run.coupling
    if choice.kind == "concurrent":
        timed("coupling", lambda: setup.model)
        steps = timed("load steps", lambda: list(run.load_steps()))
        if MPI.COMM_WORLD.rank == 0:
            forces = sum(step.force_N for step in steps)
            print(json.dumps({"seconds": times, "rows": len(steps), "pressure": forces}))
        return
    if choice.kind == "isolated":
        table = timed("laws", setup.make_laws)
    else:
        model = timed("body", setup.model_on_body)
        compliance = timed("displacements", setup.bodies.patch_compliance)
        history = setup.scene.loading
        table = timed(
            "laws",
            lambda: consistent_laws(
                model, setup.parts.patches, mean_heights=setup.parts.mean_heights,
                largest=history.control(history.largest), 
                displacements=lambda pressures: pressures @ compliance.T,
                tolerance=1e-9, most_rows=ROWS, comm=comm,
            ),
        )  # fmt: skip
    if MPI.COMM_WORLD.rank == 0:
        pressures = [float(law.rows.pressure[-1]) for law in table.laws if not law.is_open]
        rows = max(len(law.rows) for law in table.laws)
        print(json.dumps({"seconds": times, "rows": rows, "pressure": sum(pressures)}))


def started(ranks: int, words: list[str]) -> subprocess.Popen:
    """Start the measurement on a number of ranks."""
    command = [*MPIRUN, str(ranks), "--bind-to", "none", sys.executable, __file__, "--rank"]
    return subprocess.Popen(
        [*command, *words], env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=None, text=True
    )


def facts(process: subprocess.Popen) -> dict:
    """Return what a measurement printed."""
    output, _ = process.communicate()
    if process.returncode:
        sys.exit("the measurement failed, see above")
    return json.loads(output.splitlines()[-1])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--cells", type=int, default=1024, help="heights along a side")
    parser.add_argument("--pairs", type=int, default=3, help="runs on 1 and 2 ranks in turn")
    parser.add_argument(
        "--kind", choices=("consistent", "isolated", "concurrent"), default="consistent"
    )
    parser.add_argument("--approach", type=float, default=8.0, help="largest approach [µm]")
    parser.add_argument("--no-ceiling", action="store_true", help="no two processes at once")
    parser.add_argument("--rank", action="store_true", help=argparse.SUPPRESS)
    choice = parser.parse_args()
    if choice.rank:
        measure(choice)
        return
    words = [word for word in sys.argv[1:] if word != "--no-ceiling"]
    found: dict[str, list[dict]] = {"1": [], "2": [], "two at once": []}
    for _ in range(choice.pairs):
        for ranks in (1, 2):
            found[str(ranks)].append(facts(started(ranks, words)))
        if not choice.no_ceiling:
            both = [facts(one) for one in [started(1, words), started(1, words)]]
            found["two at once"] += both
    names = found["1"][0]["seconds"]
    print(f"{choice.kind} on {choice.cells}², {found['1'][0]['rows']} rows or steps; seconds")
    print(
        f"{'':14}" + "".join(f"{key:>14}" for key in found) + f"{'efficiency':>14}{'ceiling':>10}"
    )
    for name in (*names, "all"):
        medians = {
            key: statistics.median(
                sum(one["seconds"].values()) if name == "all" else one["seconds"][name]
                for one in each
            )
            for key, each in found.items()
            if each
        }
        efficiency = 50.0 * medians["1"] / medians["2"]
        ceiling = 100.0 * medians["1"] / medians.get("two at once", float("nan"))
        numbers = "".join(f"{medians.get(key, float('nan')):14.2f}" for key in found)
        print(f"{name:14}{numbers}{efficiency:12.0f} %{ceiling:8.0f} %")
    sums = {one["pressure"] for each in found.values() for one in each}
    print(f"pressures or forces differ by {max(sums) / min(sums) - 1.0:.1e}")


if __name__ == "__main__":
    main()
