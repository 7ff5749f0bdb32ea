"""Work of a scene's load steps on the mesh: products with matrices, shares of the time, bandwidth.

Run by hand on an idle machine, also under ``mpirun -n 2``:
``.venv/bin/python benchmarks/solver_work.py`` runs the paper's scene as users do, with
40 × 40 × 25 hexahedra and laws; ``… --reference`` its rough surface meshed in 48 × 48 × 12
hexahedra, and with ``--cells 158 158 24`` in six hundred thousand (four minutes). PETSc counts;
times are means over ranks. Bytes are what the matrices and vectors of products hold, moved once,
told beside what STREAM's triad gets of the memory on as many ranks: the floor is what they take at
that rate. Steps of a reference are told with their active sets as Newton's.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc
from scaling_rank import INSIDE, PARTS, logged, stored
from stream_triad import bandwidth

from patchlaw.macro.linear_solvers.options import PREFIX
from patchlaw.multiscale import Run, Scene

COMM = MPI.COMM_WORLD
SCENE = Path(__file__).parents[1] / "demos" / "scenes" / "paper.toml"
REFERENCE = ("coupling.kind=reference", "reference.meshes=1", "block.grading=8")
SHARES = ("finest", "coarser", "transfers", "coarsest", "CG's K", "CG's rest", "Newton, contact")


def mean(value: float) -> float:
    """Return the mean over the ranks."""
    return COMM.allreduce(value) / COMM.size


class Log:
    """What PETSc has counted since the last question."""

    def __init__(self, grids: int) -> None:
        levels = [f"{part} Level {level}" for part in PARTS for level in range(grids)]
        self._names = [("KSPSolve", None), ("MatMult", None), ("MatMult", INSIDE)]
        self._names += [(name, INSIDE) for name in levels]
        self._before = self._now()
        self._began = time.perf_counter()

    def _now(self) -> dict:
        return {name: logged(*name) for name in self._names}

    def lap(self) -> tuple[float, dict]:
        """Return wall time, and of every event the count, time and flops."""
        COMM.Barrier()
        now, clock = self._now(), time.perf_counter()
        keys = ("count", "time", "flops")
        spent = {
            name: {key: now[name][key] - self._before[name][key] for key in keys} for name in now
        }
        wall, self._before, self._began = clock - self._began, now, clock
        return wall, spent


class Work:
    """Products and times of the solves with one matrix.

    Args:
        solver: Solver of the block.
    """

    def __init__(self, solver: PETSc.KSP) -> None:
        pc, matrix = solver.pc, solver.getOperators()[1]
        self.grids = pc.getMGLevels() if pc.getType() == "mg" else 0
        smoothed = [
            pc.getMGSmoother(level).getOperators()[0] for level in range(1, max(self.grids, 1))
        ]
        self._bytes, self._bytes_inside = stored(matrix), sum(map(stored, smoothed))
        x, y = matrix.createVecs()
        log = Log(self.grids)
        matrix.mult(x, y)
        self._flops = COMM.allreduce(log.lap()[1]["MatMult", None]["flops"])
        self.unknowns = matrix.size[0]

    def of(self, wall: float, spent: dict, linear: int) -> dict[str, float]:
        """Return products, gigabytes and shares of the time of a load step.

        Products outside of the cycles cost the same each: one for an iteration of conjugate
        gradients, the others belong to Newton's residuals.
        """

        def seconds(part: str, levels: range) -> float:
            found = (spent[f"{part} Level {level}", INSIDE]["time"] for level in levels)
            return mean(sum(found))

        top = self.grids - 1
        cycles = spent["MGSmooth Level 0", INSIDE]["count"] if self.grids else 0
        outside, inside = spent["MatMult", None], spent["MatMult", INSIDE]
        # flops tell products with the block's matrix from those with small ones of the interface
        outer = COMM.allreduce(outside["flops"]) / self._flops
        each = inside["count"] / (cycles * top) if cycles else 0.0
        solves, multiply = mean(spent["KSPSolve", None]["time"]), mean(outside["time"])
        finest, coarser = range(top, self.grids), range(1, max(top, 1))
        parts = {
            "finest": sum(seconds(part, finest) for part in PARTS[:2]) if self.grids else 0.0,
            "coarser": sum(seconds(part, coarser) for part in PARTS[:2]),
            "transfers": seconds("MGInterp", range(1, self.grids)),
            "coarsest": seconds("MGSmooth", range(min(self.grids, 1))),
            "CG's K": multiply * min(1.0, linear / outer) if outer else 0.0,
        }
        parts["CG's rest"] = solves - sum(parts.values())
        parts["Newton, contact"] = wall - solves
        return {
            "wall": wall,
            "products": outer + each * cycles,
            "on coarser": each * cycles * max(top - 1, 0),
            "in products": (multiply + mean(inside["time"])) / wall,
            "GB": 1e-9 * (outer * self._bytes + each * cycles * self._bytes_inside),
            "product_s": multiply + mean(inside["time"]),
            **{name: part / wall for name, part in parts.items()},
        }


def show(step: str, newton: int, linear: int, work: dict[str, float], stream: float) -> None:
    """Print a load step."""
    say(
        f"{step:>5s} {newton:7d} {linear:7d} {work['products']:7.0f} {work['on coarser']:6.0f} "
        f"{work['GB']:7.2f} {work['wall']:9.3f} {work['in products']:5.0%} "
        f"{work['GB'] / work['product_s']:7.1f} {1e9 * work['GB'] / stream / work['wall']:7.0%}"
        + "".join(f" {work[name]:{max(9, len(name))}.0%}" for name in SHARES)
    )


def steps(run: Run, work: Work) -> Iterator[tuple[str, int, int, dict[str, float]]]:
    """Yield the load steps with what they took, and all together."""
    log, whole, newton, linear = Log(work.grids), [], 0, 0
    for step in run.load_steps():
        whole.append(log.lap())
        newton, linear = newton + step.newton_iterations, linear + step.linear_iterations
        yield (
            str(step.step),
            step.newton_iterations,
            step.linear_iterations,
            work.of(*whole[-1], step.linear_iterations),
        )
    keys = ("count", "time", "flops")
    events = {
        name: {key: sum(spent[name][key] for _, spent in whole) for key in keys}
        for name in whole[0][1]
    }
    yield "all", newton, linear, work.of(sum(wall for wall, _ in whole), events, linear)


def say(line: str, end: str = "\n") -> None:
    """Print on one rank."""
    if COMM.rank == 0:
        print(line, end=end, flush=True)


def main() -> None:
    """Run the scene and print its load steps."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--reference", action="store_true", help="the rough surface meshed")
    parser.add_argument("--cells", type=int, nargs=3)
    choice = parser.parse_args()
    PETSc.Log.begin()
    PETSc.Options(PREFIX)["pc_mg_log"] = None
    cells = choice.cells or ([48, 48, 12] if choice.reference else None)
    section = "reference" if choice.reference else "block"
    words = [f"{section}.cells={cells}"] if cells else []
    words += REFERENCE if choice.reference else ["coupling.interface=pointwise"]
    stream = bandwidth(COMM)
    run = Run(Scene.load(SCENE, words), COMM)
    _ = run.coupling.model
    solver: Any = run.coupling.model
    finest = solver.finest if choice.reference else solver.face
    work = Work(finest.body.solver)
    rates = ", ".join(f"{name} {rate / 1e9:.1f} GB/s" for name, rate in stream.items())
    say(f"{work.unknowns} unknowns on {COMM.size} ranks, {work.grids} grids; memory gives {rates}")
    made = mean(logged("PCSetUp")["time"])
    say(f"block {run.clock.seconds['block']:.1f} s, of which its multigrid {made:.1f} s")
    say("                       products with K,             in them,            ", end="")
    say("  shares of the wall time")
    say(" step  Newton  linear   coarser ones      GB  wall [s]   all    GB/s   floor", end="")
    say("".join(f" {name:>9s}" for name in SHARES))
    for step in steps(run, work):
        show(*step, stream["triad"])


if __name__ == "__main__":
    main()
