"""The rough block's own meshes beside the concurrent coupling, towards small slopes.

Run by hand: `.venv/bin/python tests/benchmarks/reference_split.py [--seeds 2 3 4 5]
[--scales 1 0.3 0.1 0.01] [--meshes 3]`; five minutes on one core. Heights and approach are scaled
by c. The half-space takes the contacts to lie in a plane, which they do where c tends to 0: there,
at the smallest c, the concurrent coupling has to lie within the error bar of the meshes, as far as
it knows its own force. What c = 1 differs by is the effect of finite slopes, of first order in c
and no error of either: at c = 0.1 it is still 0.3 %.

Contacts beside the block's free sides, as on seeds 1 and 6, feel them on their own scale: the
half-space knows these sides, and the rectangles of load and the elements only what is left.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import time

import numpy as np
from mpi4py import MPI
from multiscale.couplings.concurrent import ConcurrentCoupling

from geometry import (
    BlockShape,
    Control,
    PatchGrid,
    Spectrum,
    UnevenPartition,
    characteristic_size,
    patch_means,
    reference_shapes,
    suggested_fine,
    synthesise,
)
from macro import Block, Material, ObstacleBlock, make_correction, rough_block_mesh
from micro import FreeSides, HalfSpace, HalfSpaceModel
from multiscale.reference.extrapolation import extrapolated

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
SIDE, APPROACH, ORDER = 1.0, 8e-3, 3.0
COMM = MPI.COMM_WORLD
SIDES = FreeSides(lengths=(SIDE, SIDE), poisson_ratio=MATERIAL.poisson_ratio, reach=0.25 * SIDE)


def rough(seed, grid=256):
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=seed)
    return synthesise(spectrum, grid=(grid, grid), lengths=(SIDE, SIDE))


def graded(count):
    """Return rectangles of load, halved towards the free sides as in scenes."""
    ticks = np.linspace(0.0, SIDE, count + 1)
    ticks = np.concatenate([[0.0], ticks[1:2] / 2, ticks[1:-1], SIDE - ticks[1:2] / 2, [SIDE]])
    return UnevenPartition(ticks_x=tuple(ticks), ticks_y=tuple(ticks))


def rest_of(count):
    """Return what the block adds to the half-space with its sides, which serves every surface."""
    shape = BlockShape(interface=(SIDE, SIDE), height=SIDE, cells=(24, 24, 16))
    half_space = HalfSpace(MATERIAL.young_modulus, MATERIAL.poisson_ratio)
    found = make_correction(shape, MATERIAL, "free", graded(count), half_space, COMM)
    beside = SIDES.top(found.x, found.y, found.loads)
    return found.less(beside / MATERIAL.contact_modulus)


def concurrent(surface, approach, rest):
    """Return the force of the half-space whose plane follows the block's smooth rest."""
    model = HalfSpaceModel(surface=surface, contact_modulus=MATERIAL.contact_modulus, sides=SIDES)
    patches = PatchGrid(grid=(4, 4), lengths=(SIDE, SIDE))
    coupling = ConcurrentCoupling(model, patches, patch_means(surface, patches), rest)
    return coupling.press(Control(approach=approach)).force_N


def meshed(surface, approach, scale, edges, meshes):
    """Return F/c of meshes of falling size, those sizes, and the unknowns.

    The meshes are the same for every scale: what finite slopes change is then free of their error.
    """
    shapes = reference_shapes(
        surface, approach, SIDE, count=meshes, fine=suggested_fine(surface, approach, edges=edges)
    )
    top, forces, unknowns = surface.scaled(scale), [], []
    for shape in shapes:
        mesh, _ = rough_block_mesh(shape, top, COMM)
        block = ObstacleBlock(Block(mesh, MATERIAL), top.highest - top.mean_height)
        forces.append(block.press(Control(approach=approach * scale)).force / scale)
        unknowns.append(block.block.dofs)
    return np.array(forces), [characteristic_size(shape) for shape in shapes], unknowns


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[2, 3, 4, 5])
    parser.add_argument("--scales", type=float, nargs="+", default=[1.0, 0.3, 0.1, 0.01])
    parser.add_argument("--meshes", type=int, default=3)
    parser.add_argument("--edges", type=float, default=3.0)
    parser.add_argument("--approach", type=float, default=APPROACH)
    parser.add_argument("--loads", type=int, nargs=2, default=[16, 32])
    parser.add_argument("--grids", type=int, nargs=2, default=[256, 512])
    choice = parser.parse_args()
    rests = [rest_of(count) for count in choice.loads]
    say("seed      c   F/c of each mesh [N]         size zero ± bar      rate  unknowns   CPU [s]")
    for seed in choice.seeds:
        surface = rough(seed)
        for scale in choice.scales:
            began = time.process_time()
            forces, sizes, unknowns = meshed(
                surface, choice.approach, scale, choice.edges, choice.meshes
            )
            found = extrapolated(forces[:, None], np.array(sizes), ORDER)
            value, error, rate = (float(x[0]) for x in (found.value, found.error, found.rate))
            told = " ".join(f"{force:8.4f}" for force in forces)
            say(
                f"{seed:4d} {scale:6.2f} {told}   {value:8.4f} ± {error:.4f} ({error / value:.2%}) "
                f"{rate:5.2f} {unknowns[-1]:9d} {time.process_time() - began:8.1f}"
            )
        coarse, finer, fine = (
            concurrent(rough(seed, grid), choice.approach, rest)
            for grid, rest in (
                (choice.grids[0], rests[0]),
                (choice.grids[0], rests[1]),
                (choice.grids[1], rests[1]),
            )
        )
        inside = "inside" if abs(fine - value) <= error else "outside"
        say(
            f"     concurrent {fine:.4f} N, of which finer loads {finer - coarse:+.4f} and cells "
            f"{fine - finer:+.4f}; {fine / value - 1.0:+.2%} of the meshes' limit at heights × "
            f"{scale:g}: {inside} the bar"
        )


def say(line):
    if COMM.rank == 0:
        print(line, flush=True)


if __name__ == "__main__":
    main()
