"""The solver that a block gets beside algebraic multigrid, on many shapes: iterations and times.

Run by hand: `.venv/bin/python benchmarks/multigrid.py [--runs 3] [--large] [SHAPE …]`, also
under mpirun. Solves to 1e-8 under a load of all frequencies; times are medians of CPU seconds of
the slowest rank. "refined" are tetrahedra that are small where a rough surface can touch; "nu"
means Poisson's ratio, 0.15 elsewhere. Five minutes, or ten with 10⁶ unknowns.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import statistics
import time

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import BlockShape, RefinedShape, Spectrum, places_in_reach, synthesise
from patchlaw.macro import Block, Material, block_mesh, rough_block_mesh
from patchlaw.macro.linear_solvers.options import PREFIX

COMM = MPI.COMM_WORLD
CUBE = {"interface": (1.0, 1.0), "height": 1.0}
SHAPES = {
    "uniform": {"cells": (32, 32, 24)},
    "graded 10": {"cells": (40, 40, 16), "grading": 10.0},
    "graded 30": {"cells": (40, 40, 20), "grading": 30.0},
    "flat cells 12:1": {"cells": (32, 32, 32), "height": 1.0 / 12.0},
    "tall cells 8:1": {"cells": (36, 36, 18), "height": 4.0},
    "long cells 8:1": {"cells": (28, 28, 28), "interface": (8.0, 1.0)},
    "1:50 pancake": {"cells": (64, 64, 8), "interface": (50.0, 50.0), "grading": 4.0},
    "margin": {
        "cells": (20, 20, 14), "height": 3.0, "grading": 10.0,
        "margin": 2.0, "margin_cells": 7, "margin_grading": 10.0,
    },
    "rough, graded 16": {"cells": (48, 48, 16), "grading": 16.0},
    "P1, graded 10": {"cells": (40, 40, 16), "grading": 10.0, "element": "P1"},
    "P2, graded 10": {"cells": (16, 16, 8), "grading": 10.0, "element": "P2"},
    "Q2, graded 10": {"cells": (16, 16, 8), "grading": 10.0, "element": "Q2"},
    "P1, refined": {"fine": 0.006, "coarse": 0.10, "element": "P1"},
    "P2, refined": {"fine": 0.016, "coarse": 0.16, "element": "P2"},
    "P2, rough refined": {"fine": 0.016, "coarse": 0.16, "element": "P2"},
    "nu 0.49": {"cells": (28, 28, 16), "grading": 4.0},
    "nu 0.49, P1": {"cells": (28, 28, 16), "grading": 4.0, "element": "P1"},
    "nu 0.49, Q2": {"cells": (12, 12, 8), "grading": 4.0, "element": "Q2"},
    "nu 0.4, refined": {"fine": 0.020, "coarse": 0.20, "element": "P2"},
    "nu 0.49, refined": {"fine": 0.020, "coarse": 0.20, "element": "P2"},
    "nu 0.4999, Q2": {"cells": (8, 8, 6), "grading": 4.0, "element": "Q2"},
}  # fmt: skip
LARGE = {"10⁶, graded 20": {"cells": (128, 128, 20), "grading": 20.0}}


def make(name, sizes):
    """Return the block with its matrix assembled."""
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1)
    surface = synthesise(spectrum, grid=(128, 128), lengths=CUBE["interface"])
    if "fine" in sizes:
        places = places_in_reach(surface, 8e-3, spacing=sizes["fine"])
        shape = RefinedShape(**CUBE, places=places, **sizes)
    else:
        shape = BlockShape(**(CUBE | sizes))
    rough = "rough" in name
    mesh = rough_block_mesh(shape, surface, COMM)[0] if rough else block_mesh(shape, COMM)
    ratio = float(name.split(",")[0].removeprefix("nu ")) if name.startswith("nu") else 0.15
    block = Block(mesh, Material(young_modulus=4e3, poisson_ratio=ratio))
    block.stiffness  # noqa: B018 - assembled here, so that it is not timed
    return block


def spent(work):
    """Return the CPU seconds of the slowest rank, and what the work returns."""
    began = time.process_time()
    result = work()
    return COMM.allreduce(time.process_time() - began, op=MPI.MAX), result


def once(block, kind):
    """Set up and solve; return both times and the iterations. None is the block's own choice."""
    database = PETSc.Options(PREFIX)
    database.delValue("pc_type")
    if kind:
        database["pc_type"] = kind
    vars(block).pop("solver", None)
    setup, solver = spent(lambda: block.solver)
    solver.setTolerances(rtol=1e-8)
    load = block.stiffness.createVecRight()
    load.array[:] = np.random.default_rng(COMM.rank).standard_normal(block.owned_dofs)
    load.pointwiseMult(load, block.free)
    found = load.duplicate()
    solve, _ = spent(lambda: solver.solve(load, found))
    return setup, solve, solver.its


def report(name, sizes, runs):
    """Print one line of the table."""
    block = make(name, sizes)
    found = {kind: [once(block, kind) for _ in range(runs)] for kind in ("gamg", None)}
    old, new = ([statistics.median(part) for part in zip(*found[k], strict=True)] for k in found)
    if COMM.rank == 0:
        print(
            f"{name:18s} {block.dofs:8d} {old[2]:5.0f} →{new[2]:3.0f}   "
            f"{old[0]:6.2f} → {new[0]:5.2f} ({old[0] / new[0]:4.1f})   "
            f"{old[1]:6.2f} → {new[1]:5.2f} ({old[1] / new[1]:4.1f})   {block.solver.pc.getType()}",
            flush=True,
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("shapes", nargs="*")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--large", action="store_true")
    choice = parser.parse_args()
    shapes = SHAPES | (LARGE if choice.large else {})
    if COMM.rank == 0:
        print(
            "block              unknowns  iterations   "
            "set-up [s] (ratio)     solve [s] (ratio)   kind"
        )
    for name in choice.shapes or shapes:
        report(name, shapes[name], choice.runs)


if __name__ == "__main__":
    main()
