"""The rough block meshed in itself beside the concurrent coupling, with times and iterations.

Run by hand: `.venv/bin/python tests/benchmarks/rough_reference.py [--large]`; several minutes, or
half an hour with 1.2 million unknowns. Heights and approach scaled by 0.1 show the limit of small
slopes that all models of flat interfaces share; as they are, what finite slopes change.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import time

from mpi4py import MPI

from geometry import (
    BlockShape,
    Control,
    PatchGrid,
    RefinedShape,
    Spectrum,
    patch_means,
    places_in_reach,
    synthesise,
)
from macro import Block, Material, ObstacleBlock, make_correction, rough_block_mesh
from micro import HalfSpace, HalfSpaceModel, finite_slope_effect
from multiscale import ConcurrentCoupling

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
SPECTRUM = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1)
APPROACHES = (4e-3, 8e-3)
COMM = MPI.COMM_WORLD


def refined(surface, fine):
    """All sizes follow the finest one."""
    return RefinedShape(
        interface=surface.lengths,
        height=1.0,
        places=places_in_reach(surface, APPROACHES[-1], spacing=fine),
        fine=fine,
        coarse=min(0.2, 20.0 * fine),
        growth=0.3,
    )


def report(surface, name, shape, scale):
    """Print what one mesh finds."""
    start = time.perf_counter()
    rough = surface.scaled(scale)
    mesh, _ = rough_block_mesh(shape, rough, COMM)
    block = ObstacleBlock(Block(mesh, MATERIAL), rough.highest - rough.mean_height)
    states = [block.press(Control(approach=approach * scale)) for approach in APPROACHES]
    if COMM.rank == 0:
        forces = ", ".join(f"{state.force / scale:.4f}" for state in states)
        sets = [state.active_sets for state in states]
        cycles = [state.linear_iterations for state in states]
        print(
            f"{name:24s} {block.block.dofs:8d} unknowns, heights × {scale:3.1f}: F = {forces} N, "
            f"active sets {sets}, cycles {cycles}, {time.perf_counter() - start:.0f} s",
            flush=True,
        )


def concurrent(surface, count):
    shape = BlockShape(interface=surface.lengths, height=1.0, cells=(24, 24, 12))
    loads = PatchGrid(grid=(count, count), lengths=surface.lengths)
    half_space = HalfSpace(MATERIAL.young_modulus, MATERIAL.poisson_ratio)
    rest = make_correction(shape, MATERIAL, "free", loads, half_space, COMM)
    model = HalfSpaceModel(surface=surface, contact_modulus=MATERIAL.contact_modulus)
    patches = PatchGrid(grid=(4, 4), lengths=surface.lengths)
    coupling = ConcurrentCoupling(model, patches, patch_means(surface, patches), rest)
    forces = [coupling.press(Control(approach=approach)).force_N for approach in APPROACHES]
    if COMM.rank == 0:
        told = ", ".join(f"{force:.4f}" for force in forces)
        print(f"concurrent, contacts on {count} × {count} rectangles: F = {told} N", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--large", action="store_true")
    choice = parser.parse_args()
    surface = synthesise(SPECTRUM, grid=(256, 256), lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface=surface, contact_modulus=MATERIAL.contact_modulus)
    nu = MATERIAL.poisson_ratio
    effects = [finite_slope_effect(model, at, poisson_ratio=nu) for at in APPROACHES]
    if COMM.rank == 0:
        told = ", ".join(f"{effect:+.1%}" for effect in effects)
        print(f"finite slopes change the force, to first order, by {told}", flush=True)
    for count in (8, 16, 32) if choice.large else (8, 16):
        concurrent(surface, count)
    sizes = [(32, 12), (64, 16), (128, 24)][: 3 if choice.large else 2]
    for cells, layers in sizes:
        shape = BlockShape(
            interface=surface.lengths, height=1.0, cells=(cells, cells, layers), grading=layers
        )
        for scale in (0.1, 1.0) if cells < 128 else (0.1,):
            report(surface, f"hexahedra {cells} × {cells} × {layers}", shape, scale)
    for fine in (10e-3, 5e-3, 3.5e-3, 2.5e-3):
        for scale in (0.1, 1.0):
            report(surface, f"tetrahedra, {1e3 * fine:g} µm", refined(surface, fine), scale)


if __name__ == "__main__":
    main()
