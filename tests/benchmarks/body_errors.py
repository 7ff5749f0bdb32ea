"""Measured errors of bodies under laws against uniformly refined meshes, on bodies drawn at random.

Run by hand: `.venv/bin/python tests/benchmarks/body_errors.py [--bodies 20] [--first 0]`, also
under mpirun. Every body is pressed as a run presses it; its errors by elements and quadrature are
those that a run would state. The force at the same approach on the same mesh refined twice, every
cell into 64, is taken for the true one; ``rest`` is what the second refinement still changed,
relative to the true error. All errors are relative to the force.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parents[1]))

from helpers.random_bodies import drawn, stated_and_true

COMM = MPI.COMM_WORLD
ALLOWED = 1.5  # true over stated
ROUNDING = 1e-9  # of the force, to which Newton's method converges; a uniform state has no error


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bodies", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    choice = parser.parse_args()
    ratios, kept = [], 0
    for seed in range(choice.first, choice.first + choice.bodies):
        body, began = drawn(seed), time.process_time()
        found = stated_and_true(body, COMM)
        once, twice = (found.forces[-2:] - found.forces[0]) / found.load
        stated = np.array([found.mesh, found.quadrature]) / found.load
        ratios.append(abs(twice) / stated.sum())
        kept += abs(twice) <= ALLOWED * stated.sum() + ROUNDING
        if COMM.rank == 0:
            print(
                f"| {seed} | {body.name} | {found.dofs[0]} | {stated[0]:.2e} | {stated[1]:.2e} | "
                f"{-twice:+.2e} | {(twice - once) / twice:.2f} | {ratios[-1]:.2f} | "
                f"{time.process_time() - began:.0f} s |",
                flush=True,
            )
    if COMM.rank == 0:
        print(
            f"true within {ALLOWED} × stated: {kept} of {len(ratios)}; true over stated in the "
            f"median {np.median(ratios):.2f}, at most {max(ratios):.2f}"
        )


if __name__ == "__main__":
    main()
