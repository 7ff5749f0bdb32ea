"""Scaling of the block's solve: times on 1 and 2 ranks, counts on more, and what they mean.

Run by hand on an idle machine: ``.venv/bin/python tests/benchmarks/scaling.py [--quick]``.
Strong scaling on 10⁶ unknowns, weak scaling on 5·10⁵ per rank, beside the bandwidth of a triad
a = b + s c; then iterations, messages, bytes and reductions on 1, 2, 4 and 8 ranks, which do not
depend on the machine even where ranks share cores, and messages grid by grid. Messages and bytes
are those that the busiest rank sends, reductions those that every rank joins.
"""

import argparse
import json
import math
import os
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
ENVIRONMENT = os.environ | {
    "OMP_NUM_THREADS": "1",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMPI_MCA_btl": "^tcp",
    "PYTHONPATH": str(ROOT),
}
# A cluster's network, for the model: latency [s] and bandwidth per rank [B/s]; an all-reduce takes
# a latency for each doubling of the ranks.
LATENCY, BANDWIDTH = 2e-6, 2e9
# Eight ranks have 7 neighbours and 3 faces between them each; inside a larger job it is 26 and 6.
NEIGHBOURS, FACES = 26 / 7, 2.0
SOLVES = 3
COARSEST = 1500  # unknowns that one rank solves for


def measure(cells: tuple[int, int, int], grading: float) -> None:
    """Solve under one loaded patch on this job's ranks; rank 0 prints what it took as JSON."""
    import numpy as np
    from mpi4py import MPI
    from petsc4py import PETSc

    from geometry.meshes import BlockShape
    from geometry.patches import PatchGrid
    from macro import Block, Interface, Material, block_mesh

    comm = MPI.COMM_WORLD
    PETSc.Log.begin()
    PETSc.Options("patchlaw_")["pc_mg_log"] = True
    height = cells[2] / cells[0]  # cells are cubes
    shape = BlockShape(interface=(1.0, 1.0), height=height, cells=cells, grading=grading)
    seconds = {}

    def timed(name, work):
        comm.Barrier()
        began = time.perf_counter()
        result = work()
        seconds[name] = min(seconds.get(name, math.inf), slowest(time.perf_counter() - began))
        return result

    def slowest(value):
        return comm.allreduce(value, op=MPI.MAX)

    mesh = timed("mesh", lambda: block_mesh(shape, comm))
    block = Block(mesh, Material(young_modulus=4000.0, poisson_ratio=0.15))
    timed("stiffness", lambda: block.stiffness)
    solver = timed("set-up", lambda: block.solver)
    patches = PatchGrid(grid=(4, 4), lengths=(1.0, 1.0))
    load = Interface(block, patches).load(np.eye(16)[5])
    solution = load.duplicate()
    timed("solve", lambda: solver.solve(load, solution))
    inside = PETSc.Log.Stage("MG Apply").id  # where PETSc counts what single grids take
    grids = [solver.pc.getMGSmoother(k).getOperators()[0] for k in range(solver.pc.getMGLevels())]
    events = {"KSPSolve": None} | {
        f"MG{part} Level {level}": inside
        for level in range(len(grids))
        for part in ("Smooth", "Resid", "Interp")
    }

    def counted():
        return {name: PETSc.Log.Event(name).getPerfInfo(at) for name, at in events.items()}

    before = counted()
    for _ in range(SOLVES):
        timed("solve", lambda: solver.solve(load, solution))
    after = counted()
    spent = {
        name: {
            what: (after[name][what] - before[name][what]) / (SOLVES * solver.its)
            for what in after[name]
        }
        for name in events
    }
    count = spent["KSPSolve"]

    def sent(level, what):
        # PETSc counts a message where it is sent and where it is received
        return slowest(
            0.5 * sum(spent[name][what] for name in events if name.endswith(f" {level}"))
        )

    owned = comm.allgather(block.owned_dofs)
    facts = {
        "ranks": comm.size,
        "dofs": block.dofs,
        "iterations": solver.its,
        "seconds": seconds,
        "messages": slowest(0.5 * count["numMessages"]),
        "bytes": slowest(0.5 * count["messageLength"]),
        "reductions": slowest(count["numReductions"]),
        "imbalance": max(owned) * comm.size / block.dofs,
        "flops": comm.allreduce(count["flops"]),
        "grids": [
            {
                "dofs": matrix.getSize()[0],
                "messages": sent(level, "numMessages"),
                "bytes": sent(level, "messageLength"),
            }
            for level, matrix in enumerate(grids)
        ],
        "memory": comm.allreduce(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss),
        "triad": triad(comm),  # after the memory, which it takes too
    }
    if comm.rank == 0:
        print(json.dumps(facts))


def triad(comm) -> float:
    """Return the bytes per second of a = b + s c on all ranks, vectors of 100 MB each in all."""
    from petsc4py import PETSc

    a, b, c = (PETSc.Vec().createMPI(12_500_000, comm=comm) for _ in range(3))
    best = math.inf
    for vector in (a, b, c):
        vector.set(1.0)
    for _ in range(10):
        comm.Barrier()
        began = time.perf_counter()
        a.waxpy(3.0, b, c)
        comm.Barrier()
        best = min(best, time.perf_counter() - began)
    return 3 * 8 * a.getSize() / best


def on(ranks: int, cells: tuple[int, int, int], grading: float) -> dict:
    """Start this file on a number of ranks and return what it measured."""
    words = [sys.executable, __file__, "--cells", *map(str, cells), "--grading", str(grading)]
    done = subprocess.run(
        ["mpirun", "-n", str(ranks), *words],
        cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def show_times(title: str, facts: list[dict], weak: bool) -> None:
    """Print times and efficiencies; the first row is the measure of the others."""
    print(f"\n{title}\n{'ranks':>5s} {'unknowns':>10s} {'its':>4s}", end="")
    names = list(facts[0]["seconds"])
    print("".join(f" {name + ' [s]':>13s}" for name in names), end="")
    print("  efficiency of solve  ns/(unknown·it)  kB/unknown  triad [GB/s]")
    for fact in facts:
        gain = facts[0]["seconds"]["solve"] / fact["seconds"]["solve"]
        # a longer solve by more iterations is no loss of parallel efficiency: it is told beside
        efficiency = gain if weak else gain * facts[0]["ranks"] / fact["ranks"]
        print(f"{fact['ranks']:5d} {fact['dofs']:10d} {fact['iterations']:4d}", end="")
        print("".join(f" {fact['seconds'][name]:13.2f}" for name in names), end="")
        each = 1e9 * fact["seconds"]["solve"] / (fact["iterations"] * fact["dofs"])
        print(
            f" {efficiency:20.0%} {each:16.0f} {fact['memory'] / fact['dofs'] / 1e3:11.2f}", end=""
        )
        print(f" {fact['triad'] / 1e9:13.0f}")


def show_counts(facts: list[dict]) -> None:
    """Print what an iteration takes, whatever the machine."""
    print("\nan iteration, on ranks that share cores")
    print("ranks   unknowns  its  messages       kB  reductions  imbalance  flops/unknown")
    for fact in facts:
        print(
            f"{fact['ranks']:5d} {fact['dofs']:10d} {fact['iterations']:4d} "
            f"{fact['messages']:9.1f} {fact['bytes'] / 1e3:8.1f} {fact['reductions']:11.1f} "
            f"{fact['imbalance']:10.3f} {fact['flops'] / fact['dofs']:14.0f}"
        )


def show_grids(fact: dict) -> None:
    """Print what an iteration sends grid by grid, coarsest first."""
    print(f"\nmessages of the busiest of {fact['ranks']} ranks, an iteration, grid by grid")
    print("  unknowns  messages       kB")
    for grid in fact["grids"]:
        print(f"{grid['dofs']:10d} {grid['messages']:9.1f} {grid['bytes'] / 1e3:8.1f}")


def show_model(one: dict, most: dict) -> None:
    """Print what the counts mean for many ranks.

    An iteration on P ranks with n unknowns each takes n c + m α L + v n^(2/3) / β + r α log₂ P +
    2 α min(P, g): work c of one rank, m messages on each of L = log₈(n P / 1500) grids, volume v
    over the faces of a rank's part, r reductions, and to and from the one rank that solves on the
    coarsest grid of g nodes.
    """
    work = one["seconds"]["solve"] / (one["iterations"] * one["dofs"])
    volume = FACES * most["bytes"] / (most["dofs"] / most["ranks"]) ** (2.0 / 3.0)
    m = NEIGHBOURS * statistics.mean(grid["messages"] for grid in most["grids"][1:])
    r = most["reductions"]

    def parts(n: float, ranks: int) -> list[float]:
        levels = max(1.0, math.log(n * ranks / COARSEST, 8))
        return [
            n * work,
            m * LATENCY * levels,
            volume * n ** (2.0 / 3.0) / BANDWIDTH,
            r * LATENCY * math.log2(ranks),
            2.0 * LATENCY * min(ranks, COARSEST / 3),
        ]

    print(f"\nmodel: {1e9 * work:.0f} ns of work per unknown and iteration, m = {m:.0f}, ", end="")
    print(f"v = {volume:.0f} B, r = {r:.1f}; α = {LATENCY:.0e} s, β = {BANDWIDTH:.0e} B/s")
    print("ranks   unknowns per rank for 80 %, 50 % efficiency, and an iteration at 50 % [ms]:")
    print(f"{'work':>42s} {'neighbours':>11s} {'volume':>9s} {'reductions':>11s} {'coarsest':>9s}")
    for ranks in (10**3, 10**4, 10**5):
        sizes = [10 ** (k / 20) for k in range(20, 161)]
        least = {
            wanted: next((n for n in sizes if n * work / sum(parts(n, ranks)) >= wanted), math.inf)
            for wanted in (0.8, 0.5)
        }
        half = [1e3 * part for part in parts(least[0.5], ranks)]
        print(f"{ranks:6d} {least[0.8]:12.0f} {least[0.5]:12.0f}", end="")
        print("{:10.2f} {:11.2f} {:9.2f} {:11.2f} {:9.2f}".format(*half))


def main() -> None:
    """Measure and print all tables, or be one of the ranks measured."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="a thousandth of the unknowns")
    parser.add_argument("--grading", type=float, default=1.0)
    parser.add_argument("--cells", type=int, nargs=3, help="be one rank of a measurement")
    choice = parser.parse_args()
    if choice.cells:
        return measure(tuple(choice.cells), choice.grading)
    scale = 10 if choice.quick else 1
    edges = {name: edge // scale for name, edge in {"strong": 68, "weak": 54, "counts": 40}.items()}

    def cube(edge: int, layers: int | None = None) -> tuple[int, int, int]:
        return (edge, edge, layers or edge)

    strong = [on(ranks, cube(edges["strong"]), choice.grading) for ranks in (1, 2)]
    show_times("strong scaling", strong, weak=False)
    weak = [
        on(ranks, cube(edges["weak"], ranks * edges["weak"]), choice.grading) for ranks in (1, 2)
    ]
    show_times("weak scaling", weak, weak=True)
    counts = [on(ranks, cube(edges["counts"]), choice.grading) for ranks in (1, 2, 4, 8)]
    show_counts(counts)
    show_grids(counts[-1])
    show_model(strong[0], counts[-1])
    return None


if __name__ == "__main__":
    main()
