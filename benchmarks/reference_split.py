"""The rough block's own meshes beside the concurrent coupling, towards small slopes.

Run by hand: `.venv/bin/python benchmarks/reference_split.py [--seeds 2 3 4 5]
[--scales 1 0.3 0.1 0.01] [--meshes 3]`; five minutes on one core. Heights and approach are scaled
by c. The half-space takes the contacts to lie in a plane, which they do where c tends to 0: there,
at the smallest c, the concurrent coupling has to lie within the error bar of the meshes, as far as
it knows its own force. What c = 1 differs by is the effect of finite slopes, of first order in c
and no error of either: at c = 0.1 it is still 0.3 %.

Contacts beside the block's free sides, as on seeds 1 and 6, feel them on their own scale: the
half-space knows these sides, and the body's modes only what is left.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import time

import numpy as np
from mpi4py import MPI

from patchlaw.geometry import (
    BlockShape,
    Control,
    Spectrum,
    reference_shapes,
    suggested_fine,
    synthesise,
)
from patchlaw.macro import Block, Material, UnilateralContactProblem, rough_block_mesh
from patchlaw.micro import FreeSides, HalfSpaceModel
from patchlaw.multiscale import extrapolated
from patchlaw.multiscale.bodies.face_terms import FaceTerms, block_term

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
SIDE, APPROACH, ORDER = 1.0, 8e-3, 4.0
COMM = MPI.COMM_WORLD
SIDES = FreeSides(
    lengths=(SIDE, SIDE), poisson_ratio=MATERIAL.poisson_ratio, decay_length=0.25 * SIDE
)


def rough(seed, grid=256):
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=seed)
    return synthesise(spectrum, grid=(grid, grid), lengths=(SIDE, SIDE))


def body_of():
    """Return what the block adds to the half-space with its sides, which serves every surface."""
    shape = BlockShape(interface=(SIDE, SIDE), height=SIDE, cells=(1, 1, 1))
    body = FaceTerms((block_term(shape, MATERIAL, "free", SIDES),))
    return body.term(body.face(COMM))


def concurrent(surface, approach, body):
    """Return the force of the contact problem on the block."""
    modulus = MATERIAL.contact_modulus
    model = HalfSpaceModel(surface=surface, contact_modulus=modulus, sides=SIDES, body=body)
    return model.press(Control(approach=approach)).force


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
        block = UnilateralContactProblem(Block(mesh, MATERIAL), top.highest - top.mean_height)
        forces.append(block.solve(Control(approach=approach * scale)).force / scale)
        unknowns.append(block.body.dofs)
    return np.array(forces), [shape.fine for shape in shapes], unknowns


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[2, 3, 4, 5])
    parser.add_argument("--scales", type=float, nargs="+", default=[1.0, 0.3, 0.1, 0.01])
    parser.add_argument("--meshes", type=int, default=3)
    parser.add_argument("--edges", type=float, default=3.0)
    parser.add_argument("--approach", type=float, default=APPROACH)
    parser.add_argument("--grids", type=int, nargs=2, default=[256, 512])
    choice = parser.parse_args()
    body = body_of()
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
        coarse, fine = (
            concurrent(rough(seed, grid), choice.approach, body) for grid in choice.grids
        )
        inside = "inside" if abs(fine - value) <= error else "outside"
        say(
            f"     concurrent {fine:.4f} N, of which finer cells {fine - coarse:+.4f}; "
            f"{fine / value - 1.0:+.2%} of the meshes' limit at heights × "
            f"{scale:g}: {inside} the bar"
        )


def say(line):
    if COMM.rank == 0:
        print(line, flush=True)


if __name__ == "__main__":
    main()
