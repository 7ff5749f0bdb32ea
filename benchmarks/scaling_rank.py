"""One rank of a scaling measurement: makes a block, solves it, tells time, memory and messages.

Started by `scaling.py` under mpirun, with the arguments of a `BlockShape` as JSON; rank 0 prints
the facts as JSON. By hand: ``mpirun -n 2 .venv/bin/python benchmarks/scaling_rank.py
'{"interface": [1, 1], "height": 1, "cells": [20, 20, 20]}'``. What is counted is counted by PETSc,
in the block's solver as it is; messages and bytes are those that the busiest rank sends.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import json
import math
import resource
import sys
import time
from collections.abc import Callable

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import BlockShape, PatchGrid
from patchlaw.macro import Block, LoadedFace, Material, block_mesh
from patchlaw.macro.linear_solvers.options import PREFIX

COMM = MPI.COMM_WORLD
SOLVES = 3
INSIDE = "MG Apply"
"""PETSc's name of the stage of its log that a multigrid's cycles are in."""

PARTS = ("MGSmooth", "MGResid", "MGInterp")
"""PETSc's names of what a multigrid does on a level: smooths, forms the residual, goes down and
up between the level and the next coarser one."""


def slowest(value: float) -> float:
    """Return the largest value of all ranks."""
    return COMM.allreduce(value, op=MPI.MAX)


class Clock:
    """Seconds of the slowest rank by name; the least where work is repeated."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def __call__(self, name: str, work: Callable):
        """Time work between barriers and return what it returns."""
        COMM.Barrier()
        began = time.perf_counter()
        result = work()
        spent = slowest(time.perf_counter() - began)
        self.seconds[name] = min(self.seconds.get(name, math.inf), spent)
        return result


def resident() -> int:
    """Return the peak memory of this rank so far [B]."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def logged(name: str, stage: str | None = None) -> dict[str, float]:
    """Return what PETSc has counted of an event of this rank, of one stage of the log."""
    of = PETSc.Log.Stage(stage).id if stage else 0
    return dict(PETSc.Log.Event(name).getPerfInfo(of))


def stored(matrix: PETSc.Mat) -> float:
    """Return the bytes that a product reads and writes at least, all ranks together.

    Entries and their column numbers, one for a block of them in formats of blocks, row starts, and
    two vectors: what a cache that never forgets would move.
    """
    block = matrix.getBlockSize() if "baij" in matrix.getType() else 1
    entries = matrix.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]
    number, value, rows = PETSc.IntType().itemsize, PETSc.ScalarType().itemsize, matrix.size[0]
    return entries * (value + number / block**2) + rows * (number / block + 2 * value)


def product(matrix: PETSc.Mat) -> dict[str, float]:
    """Multiply by a matrix alone: seconds, messages, bytes sent."""
    clock, (x, y) = Clock(), matrix.createVecs()
    x.set(1.0)
    matrix.mult(x, y)  # the first one sets up its messages
    before = logged("MatMult")
    for _ in range(SOLVES):
        clock("product", lambda: matrix.mult(x, y))
    after = logged("MatMult")
    share = {key: (after[key] - before[key]) / SOLVES for key in after}
    return {
        "product_s": clock.seconds["product"],
        "product_bytes": stored(matrix),
        # PETSc counts a message where it is sent and where it is received
        "neighbours": slowest(0.5 * share["numMessages"]),
        "halo_bytes": slowest(0.5 * share["messageLength"]),
    }


def levels(pc: PETSc.PC, cycle: Callable) -> list[dict[str, float]]:
    """Return what the levels of a multigrid are and take per cycle, the finest first."""
    found = []
    for level in reversed(range(pc.getMGLevels())):
        matrix = pc.getMGSmoother(level).getOperators()[0]
        parts = [cycle(f"{part} Level {level}") for part in PARTS[: 3 if level else 1]]
        found.append(
            {
                "unknowns": matrix.size[0],
                "imbalance": slowest(matrix.local_size[0]) * COMM.size / matrix.size[0],
                "seconds": slowest(sum(part["time"] for part in parts)),
                "messages": slowest(0.5 * sum(part["numMessages"] for part in parts)),
                "bytes": slowest(0.5 * sum(part["messageLength"] for part in parts)),
                "flops": slowest(sum(part["flops"] for part in parts)),
                **product(matrix),
            }
        )
    return found


class Counts:
    """What PETSc counts of a solver's iterations, by event.

    Args:
        solver: A solver with a multigrid, all set up.
    """

    def __init__(self, solver: PETSc.KSP) -> None:
        grids = range(solver.pc.getMGLevels())
        self._stages = dict.fromkeys((f"{part} Level {n}" for part in PARTS for n in grids), INSIDE)
        self._stages |= {"KSPSolve": None, "MatMult": INSIDE}
        self._before = {name: logged(name, stage) for name, stage in self._stages.items()}
        self._after = self._before
        self._iterations = 0

    def stop(self, iterations: int) -> None:
        """Count no further; all solves took so many iterations."""
        self._after = {name: logged(name, stage) for name, stage in self._stages.items()}
        self._iterations = iterations

    def __call__(self, name: str) -> dict[str, float]:
        """Return the counts of an event for one iteration."""
        after, before = self._after[name], self._before[name]
        return {key: (after[key] - before[key]) / self._iterations for key in after}


def loaded(block: Block) -> PETSc.Vec:
    """Return the load of a patch amid the interface."""
    patches = PatchGrid(grid=(4, 4), lengths=block.mesh.shape.interface)
    return LoadedFace.of_block(block, patches).load(np.eye(16)[5])


def measure(sizes: dict) -> dict:
    """Return the facts of one block.

    Args:
        sizes: Arguments of its `BlockShape`.
    """
    PETSc.Log.begin()
    PETSc.Options(PREFIX)["pc_mg_log"] = None
    clock, bare = Clock(), resident()
    mesh = clock("mesh", lambda: block_mesh(BlockShape(**sizes), COMM))
    block = Block(mesh, Material(young_modulus=4000.0, poisson_ratio=0.15))
    clock("matrix", lambda: block.stiffness)
    solver = clock("set-up", lambda: block.solver)
    load = loaded(block)
    solution = load.duplicate()
    solver.solve(load, solution)  # the first one sets up messages
    counts = Counts(solver)
    for _ in range(SOLVES):
        clock("solve", lambda: solver.solve(load, solution))
    counts.stop(SOLVES * solver.its)
    whole = counts("KSPSolve")
    flops = COMM.allreduce(whole["flops"])
    return {
        "ranks": COMM.size,
        "dofs": block.dofs,
        "iterations": solver.its,
        "seconds": clock.seconds,
        "messages": slowest(0.5 * whole["numMessages"]),
        "bytes": slowest(0.5 * whole["messageLength"]),
        "reductions": slowest(whole["numReductions"]),
        "flops": flops,
        "imbalance": slowest(whole["flops"]) * COMM.size / flops,
        "memory": COMM.allreduce(resident()),
        "memory_rank": slowest((resident() - bare) / block.owned_dofs),
        # of each grid but the coarsest, in a cycle
        "products": counts("MatMult")["count"] / max(solver.pc.getMGLevels() - 1, 1),
        "levels": levels(solver.pc, counts),
    }


if __name__ == "__main__":
    facts = measure(json.loads(sys.argv[1]))
    if COMM.rank == 0:
        print(json.dumps(facts))
