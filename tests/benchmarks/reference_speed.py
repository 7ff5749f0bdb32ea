"""The reference at full size: time, memory, active sets and iterations of an 8-step curve.

Run by hand on an idle machine:
`mpirun -n 2 .venv/bin/python tests/benchmarks/reference_speed.py [--edges 1.5 2 3 4]`. Errors are
told against the extrapolation from the two finest. Memory is the peak of all ranks together.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import resource
import time

import numpy as np
from mpi4py import MPI

from patchlaw.geometry import (
    Control,
    Spectrum,
    reference_shapes,
    suggested_fine,
    synthesise,
)
from patchlaw.macro import Block, Material, UnilateralContactProblem, rough_block_mesh

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
SPECTRUM = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1)
SIDE, ORDER = 1.0, 3.0
COMM = MPI.COMM_WORLD


class Clock:
    """Wall time since the last question, of the slowest rank."""

    def __init__(self):
        COMM.Barrier()
        self._began = time.perf_counter()

    def lap(self):
        spent = COMM.allreduce(time.perf_counter() - self._began, op=MPI.MAX)
        self._began = time.perf_counter()
        return spent


def per_solve(block):
    """Return a list to which every linear solve of an active set adds its iterations."""
    counts, solver = [], block.method._solver
    improve = solver.improve

    def counted(*arguments):
        counts.append(improve(*arguments))
        return counts[-1]

    solver.improve = counted
    return counts


def curve(surface, shape, approaches):
    """Press one mesh along the curve, print what it takes, and return forces and wall time."""
    clock = Clock()
    mesh, _ = rough_block_mesh(shape, surface, COMM)
    meshing = clock.lap()
    block = UnilateralContactProblem(Block(mesh, MATERIAL), surface.highest - surface.mean_height)
    setup, counts = clock.lap(), per_solve(block)
    say(
        f"{block.body.dofs} unknowns, {1e3 * shape.fine:.2f} µm: "
        f"mesh {meshing:.1f} s, matrix and preconditioner {setup:.1f} s, {memory():.2f} GB"
    )
    say("  µm    force [N]   area [%]  nodes  active sets  iterations of each solve   wall [s]")
    forces, total = [], meshing + setup
    for approach in approaches:
        counts.clear()
        state, wall = block.solve(Control(approach=approach)), clock.lap()
        total += wall
        forces.append(state.force)
        say(
            f"{1e3 * approach:4.1f} {state.force:12.6f} {100 * state.contact_area:10.4f} "
            f"{state.nodes:6d} {state.iterations:12d}  {counts!s:26s} {wall:8.1f}"
        )
    say(f"  {total:.1f} s in all, peak {memory():.2f} GB on {COMM.size} ranks")
    return np.array(forces), total


def memory():
    """Return the peak memory of all ranks together [GB]."""
    return COMM.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, op=MPI.SUM) / 1e6


def tetrahedra(surface, approaches, edges):
    """Print the errors of single meshes, their curves extrapolated from the two finest."""
    found, sizes = [], []
    for count in sorted(edges):
        fine = suggested_fine(surface, approaches[-1], edges=count)
        (shape,) = reference_shapes(surface, approaches[-1], SIDE, count=1, fine=fine)
        found.append(curve(surface, shape, approaches))
        sizes.append(fine)
    if len(found) < 2:
        return
    (coarse, _), (fine, _) = found[-2:]
    best = fine - (coarse - fine) / ((sizes[-2] / sizes[-1]) ** ORDER - 1.0)
    say("edges   error at the last step   largest error of the last half   wall [s]")
    for count, (forces, wall) in zip(sorted(edges), found, strict=True):
        error = forces / best - 1.0
        later = np.abs(error[len(error) // 2 :]).max()
        say(f"{count:5.2f} {error[-1]:20.3%} {later:29.3%} {wall:18.1f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--edges", type=float, nargs="+", default=[1.5, 2.0, 3.0, 4.0])
    parser.add_argument("--approach", type=float, default=8e-3)
    parser.add_argument("--steps", type=int, default=8)
    choice = parser.parse_args()
    surface = synthesise(SPECTRUM, grid=(256, 256), lengths=(SIDE, SIDE))
    approaches = choice.approach * np.arange(1, choice.steps + 1) / choice.steps
    tetrahedra(surface, approaches, choice.edges)


def say(line):
    if COMM.rank == 0:
        print(line, flush=True)


if __name__ == "__main__":
    main()
