"""The contact problem on a block against the rough block itself, meshed as it is.

Run by hand: `.venv/bin/python benchmarks/rough_block_error.py [--set1 1 2 3 4 5 6]
[--set2 1 2 3] [--caps] [--edges 3] [--scale 1]`; half a minute a surface on one core. Every row is
a surface at 2, 4, 6 and 8 µm on the paper's cube (caps at 4 and 8 µm): the force of three meshes
extrapolated to mesh size zero with its bar, and what `concurrent` gives for it, with finite slopes
and without, off by what part of the largest force. With `--scale 0.01` heights and approaches are
scaled down, where slopes are small.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import time

import numpy as np
from mpi4py import MPI

from patchlaw.geometry import (
    Control,
    Spectrum,
    Surface,
    reference_shapes,
    suggested_fine,
    synthesise,
)
from patchlaw.macro import Block, Material, UnilateralContactProblem, rough_block_mesh
from patchlaw.multiscale import CellContact, ElasticBlock, extrapolated

GRID, SIDE, RADIUS, FLOOR = 256, 1.0, 0.16, -0.05
MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
CAPS = {"cap in the middle": 0.5, "cap 0.06 mm from a side": 0.06, "cap on a side": 0.0}
BANDS = {1: {"waves": (2, 10)}, 2: {"waves_x": (2, 7), "waves_y": (2, 12)}}
APPROACHES = (2e-3, 4e-3, 6e-3, 8e-3)


def rough(number, seed):
    spectrum = Spectrum(hurst=0.95, rms_slope=0.215, seed=seed, **BANDS[number])
    return synthesise(spectrum, grid=(GRID, GRID), lengths=(SIDE, SIDE))


def cap(x0):
    x = (np.arange(GRID) + 0.5) * SIDE / GRID
    squares = (x[:, None] - x0) ** 2 + (x - 0.5 * SIDE) ** 2
    heights = np.maximum(-squares / (2.0 * RADIUS), FLOOR)
    return Surface(heights=heights, lengths=(SIDE, SIDE))


def meshed(surface, scale, approaches, edges):
    """Return the forces over the scale, extrapolated, and their bars."""
    largest_interference = max(approaches)
    fine = suggested_fine(surface, largest_interference, edges=edges)
    shapes = reference_shapes(surface, largest_interference, SIDE, count=3, fine=fine)
    top, forces = surface.scaled(scale), []
    for shape in shapes:
        mesh, _ = rough_block_mesh(shape, top, MPI.COMM_SELF)
        block = UnilateralContactProblem(Block(mesh, MATERIAL), top.highest - top.mean_height)
        forces.append([block.solve(Control(approach=scale * a)).force / scale for a in approaches])
    sizes = np.array([shape.fine for shape in shapes])
    found = extrapolated(np.array(forces), sizes, 4.0)
    return found.value, found.error


def models(surface):
    """Return the contact problem of a surface with finite slopes and without."""
    block = ElasticBlock(MATERIAL, height=SIDE)
    return tuple(CellContact.of(surface, block, finite_slopes=slopes) for slopes in (True, False))


def curve(model, scale, approaches):
    steps = [model.press(Control(approach=scale * approach)) for approach in approaches]
    return np.array([step.force_N for step in steps]) / scale


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--set1", type=int, nargs="*", default=[])
    parser.add_argument("--set2", type=int, nargs="*", default=[])
    parser.add_argument("--caps", action="store_true")
    parser.add_argument("--edges", type=float, default=3.0)
    parser.add_argument("--scale", type=float, default=1.0)
    choice = parser.parse_args()
    cases = [(f"Set 1, seed {seed}", rough(1, seed), APPROACHES) for seed in choice.set1]
    cases += [(f"Set 2, seed {seed}", rough(2, seed), APPROACHES) for seed in choice.set2]
    if choice.caps:
        cases += [(name, cap(x0), APPROACHES[1::2]) for name, x0 in CAPS.items()]
    worst = []
    for name, surface, approaches in cases:
        began = time.perf_counter()
        value, bar = meshed(surface, choice.scale, approaches, choice.edges)
        steep, small = (
            (curve(model, choice.scale, approaches) - value) / value.max()
            for model in models(surface.scaled(choice.scale))
        )
        worst.append(np.abs(steep).max())
        print(
            f"{name:24s} {value[-1]:8.4f} N ± {bar[-1] / value[-1]:.2%}; with slopes "
            + " ".join(f"{part:+.2%}" for part in steep)
            + f"; without {small[-1]:+.2%}; {time.perf_counter() - began:.0f} s",
            flush=True,
        )
    print(f"largest {max(worst):.2%}, median {np.median(worst):.2%} of {len(worst)} surfaces")


if __name__ == "__main__":
    main()
