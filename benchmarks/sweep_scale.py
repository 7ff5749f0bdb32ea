"""A sweep over seeds of the paper's scene on several ranks: time, memory and files.

    .venv/bin/python benchmarks/sweep_scale.py [--cases 1000] [--ranks 1 2 4] [KEY=VALUE …]

The scene is that of `demos/scatter.py`: Set 1 of Waddad et al. 2016 on the paper's cube, 64 × 64
heights, half-space contacts, 8 load steps, errors measured at the last one. The contact problem
itself (`concurrent`) takes the place of the laws. CPU seconds are those of all ranks; they are told
apart from wall seconds, which count only where every rank has a core of its own.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
SCENE = (
    "coupling.kind=concurrent", "micro.model=half-space", "micro.finite_slopes=false",
    "surface.grid=[64, 64]", "output.figures=false",
)  # fmt: skip


def of_rank(cases: int, keys: list[str], folder: Path) -> None:
    """Run the sweep on this rank; rank 0 prints what all ranks took."""
    from mpi4py import MPI

    from patchlaw.multiscale import Scene, sweep
    from patchlaw.multiscale.loading.load_step import COLUMNS
    from patchlaw.multiscale.machine import peak_memory

    comm = MPI.COMM_WORLD
    scene = Scene.load(ROOT / "demos/scenes/paper.toml", [*SCENE, *keys])
    seed, first = "surface.spectrum.seed", []
    comm.Barrier()
    spent, cpu, done = [time.perf_counter()], [time.process_time()], []

    def observe(case, result):
        if not done:
            first.append(peak_memory())
        done.append(case.number)
        spent.append(time.perf_counter())
        cpu.append(time.process_time())

    found = sweep(scene, {seed: range(cases)}, comm, folder=folder, observe=observe)
    found.statistics  # noqa: B018
    comm.Barrier()
    whole, all_cpu = time.perf_counter() - spent[0], time.process_time() - cpu[0]
    own = np.diff(cpu)
    mine = [len(done), all_cpu, own[0], float(np.mean(own[1:])), float(np.std(own[1:])), first[0],
            peak_memory(), whole]  # fmt: skip
    table = found.force_N
    every = np.array(comm.gather(mine, root=0) or [mine])
    values = [
        part.of(c.name, "mean").tobytes() + part.of(c.name, "median").tobytes()
        for _, part in found.statistics
        for c in COLUMNS
        if c.name not in ("reason", "wall_s")
    ]
    if comm.rank == 0:
        once = float(every[:, 2].mean() - every[:, 3].mean())
        print(json.dumps({
            "ranks": comm.size, "wall": every[:, 7].max(), "cpu": every[:, 1].sum(),
            "case": float(np.average(every[:, 3], weights=every[:, 0])),
            "scatter": float(every[:, 4].max()), "once": once,
            "most": every[:, 0].max(), "fewest": every[:, 0].min(),
            "memory": every[:, 6].max() / 1e6, "grown": (every[:, 6] - every[:, 5]).max() / 1e6,
            "files": len(list((folder / "cases").iterdir())),
            "table": hashlib.sha256(table.tobytes() + b"".join(values)).hexdigest()[:12],
        }))  # fmt: skip


def main() -> None:
    """Run the sweep on several numbers of ranks and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--ranks", type=int, nargs="*", default=[1, 2, 4])
    parser.add_argument("--folder", type=Path)
    parser.add_argument("keys", nargs="*")
    choice = parser.parse_args()
    if choice.folder:
        of_rank(choice.cases, choice.keys, choice.folder)
        return
    print("| ranks | wall [s] | CPU [s] | a case, CPU | once a rank | cases of a rank | MB a rank |"
          " files | results |")  # fmt: skip
    for ranks in choice.ranks:
        with tempfile.TemporaryDirectory() as folder:
            words = [__file__, "--cases", str(choice.cases), "--folder", folder, *choice.keys]
            mpirun = ["mpirun", "--oversubscribe", "-n", str(ranks), sys.executable, *words]
            environment = os.environ | {"OMP_NUM_THREADS": "1"}
            shown = subprocess.run(
                mpirun, env=environment, capture_output=True, text=True, check=True
            )
            one = json.loads(shown.stdout.splitlines()[-1])
        print(
            f"| {ranks} | {one['wall']:.1f} | {one['cpu']:.1f} | {1e3 * one['case']:.0f} ± "
            f"{1e3 * one['scatter']:.0f} ms | {one['once']:.2f} s | {one['fewest']:.0f} … "
            f"{one['most']:.0f} | {one['memory']:.0f} (+{one['grown']:.0f}) | {one['files']} | "
            f"{one['table']} |"
        )


if __name__ == "__main__":
    main()
