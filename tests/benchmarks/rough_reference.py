"""The rough block meshed in itself beside the concurrent coupling, with times and iterations.

Run by hand: `.venv/bin/python tests/benchmarks/rough_reference.py`; minutes. Heights and approach
scaled by 0.1 show the limit of small slopes that all models of flat interfaces share; as they are,
what finite slopes change.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import time
from dataclasses import replace

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
from patchlaw.micro import FiniteSlopes, FreeSides, HalfSpaceModel
from patchlaw.multiscale.bodies.face_terms import BlockTerms

MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
SPECTRUM = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1)
APPROACHES = (4e-3, 8e-3)
COMM = MPI.COMM_WORLD


def report(surface, name, shape, scale):
    """Print what one mesh finds, and return the forces."""
    start = time.process_time()
    rough = surface.scaled(scale)
    mesh, _ = rough_block_mesh(shape, rough, COMM)
    block = UnilateralContactProblem(Block(mesh, MATERIAL), rough.highest - rough.mean_height)
    states = [block.solve(Control(approach=approach * scale)) for approach in APPROACHES]
    forces = [state.force / scale for state in states]
    if COMM.rank == 0:
        told = ", ".join(f"{force:.4f}" for force in forces)
        sets = [state.iterations for state in states]
        cycles = [state.linear_iterations for state in states]
        print(
            f"{name}, {1e3 * shape.fine:5.2f} µm, {block.body.dofs:7d} unknowns, "
            f"heights × {scale:3.1f}: F = {told} N, active sets {sets}, cycles {cycles}, "
            f"{time.process_time() - start:.1f} s of this rank",
            flush=True,
        )
    return forces


def concurrent(surface):
    nu, side = MATERIAL.poisson_ratio, surface.lengths[0]
    sides = FreeSides(lengths=surface.lengths, poisson_ratio=nu, decay_length=0.25 * side)
    shape = BlockShape(interface=surface.lengths, height=1.0, cells=(1, 1, 1))
    body = BlockTerms(shape=shape, material=MATERIAL, sides="free", side_term=sides)
    model = HalfSpaceModel(
        surface=surface,
        contact_modulus=MATERIAL.contact_modulus,
        sides=sides,
        body=body.term(body.face(COMM)),
    )
    forces = [model.press(Control(approach=approach)).force for approach in APPROACHES]
    if COMM.rank == 0:
        told = ", ".join(f"{force:.4f}" for force in forces)
        print(f"concurrent: F = {told} N", flush=True)


def main():
    surface = synthesise(SPECTRUM, grid=(256, 256), lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface=surface, contact_modulus=MATERIAL.contact_modulus)
    slopes = FiniteSlopes(surface, MATERIAL)
    sloped = replace(model, slopes=(slopes,))
    effects = [
        sloped.press(Control(approach=at)).force / model.press(Control(approach=at)).force - 1.0
        for at in APPROACHES
    ]
    if COMM.rank == 0:
        told = ", ".join(f"{effect:+.1%}" for effect in effects)
        print(f"finite slopes change the force by {told}", flush=True)
    concurrent(surface)
    families(surface)


def families(surface):
    """Families of meshes and what they tend to, with the order of their elements' theory."""
    top = APPROACHES[-1]
    linear = suggested_fine(surface, top, edges=8.0)
    asked = {
        "P2": (4.0, {}),
        "P1": (2.0, {"element": "P1", "fine": linear}),
    }
    for scale in (0.1, 1.0):
        for name, (order, options) in asked.items():
            shapes = reference_shapes(surface, top, 1.0, count=2, **options)
            coarse, fine = (report(surface, name, shape, scale) for shape in shapes)
            ratio = shapes[0].fine / shapes[1].fine
            limits = [b - (a - b) / (ratio**order - 1.0) for a, b in zip(coarse, fine, strict=True)]
            if COMM.rank == 0:
                told = ", ".join(f"{limit:.4f}" for limit in limits)
                print(f"{name}, extrapolated with order {order:g}: F = {told} N", flush=True)


if __name__ == "__main__":
    main()
