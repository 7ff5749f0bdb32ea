"""What the body's term of the contact's compliance costs, and how far it is from its limit.

Run by hand: `.venv/bin/python benchmarks/body_term.py`. Medians of seven, one thread, no
cache; imports, and the table of the quarter-space that all free sides of a process share, aside.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"
os.environ["PATCHLAW_CACHE"] = "off"

import statistics
import time

from mpi4py import MPI

from patchlaw.geometry import BlockShape
from patchlaw.macro import Material
from patchlaw.micro import FreeSides, half_space_modes, side_modes
from patchlaw.multiscale.bodies.face_terms import FaceTerms, block_term

REPEATS = 7
BLOCKS = {"cube": 1.0, "pancake": 0.1, "column": 10.0, "wide margin": 1.0, "rollers": 1.0}


def body(name, height):
    """Return the block of a name, and the free sides that its contact knows of."""
    margin = {"margin": 0.25, "margin_cells": 1} if name == "wide margin" else {}
    shape = BlockShape(interface=(1.0, 1.0), height=height, cells=(1, 1, 1), **margin)
    decay_length = 0.25 * min(1.0, height)
    sides = FreeSides(lengths=(1.0, 1.0), poisson_ratio=0.15, decay_length=decay_length)
    material = Material(young_modulus=4000.0, poisson_ratio=0.15)
    held = "roller" if name == "rollers" else "free"
    own = None if margin or name == "rollers" else sides
    return block_term(shape, material, held, own)


def median(action, *given):
    """Return the median time of an action [s], and what it returned last."""
    times = []
    for _ in range(REPEATS):
        start = time.process_time()  # other processes do not count
        result = action(*given)
        times.append(time.process_time() - start)
    return statistics.median(times), result


def main():
    """Print times."""
    print("block        modes    whole   half-space   sides")
    for name, height in BLOCKS.items():
        block = body(name, height)
        terms = FaceTerms((block,))
        whole, _ = median(lambda terms=terms: terms.term(terms.face(MPI.COMM_SELF)))
        half, _ = median(half_space_modes, block.lengths, block.modes)
        beside = median(side_modes, block.side_term, block.modes)[0] if block.side_term else 0.0
        print(f"{name:12s} {block.modes:5d} {whole:7.3f} s {half:9.3f} s {beside:7.3f} s")


if __name__ == "__main__":
    main()
