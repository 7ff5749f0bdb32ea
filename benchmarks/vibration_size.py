"""Natural modes of large bodies about a loaded state: seconds, memory, and what is solved for them.

Run by hand: ``.venv/bin/python benchmarks/vibration_size.py [CASE …] [--modes 20] [--scale 1]``,
also under mpirun; ``--scale 2`` halves the cells, ``--factorised N`` factorises up to N unknowns.
Cubes and plates under laws of four patches at points; each held first, then sliding with μ = 0.4.
CPU seconds are those of all ranks together, wall seconds in brackets; memory is what the modes need
beyond the body with its matrix, all ranks together. PETSc counts factorisations, and applications
of the preconditioner, which are cycles of multigrid. Ten minutes.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from body_solvers import memory
from helpers.user_problems import PowerLaw

from patchlaw.geometry import BlockShape, Control, PatchGrid
from patchlaw.macro import (
    BOTTOM,
    Block,
    LawContactProblem,
    LoadedFace,
    Material,
    MeshedBody,
    Support,
    TaggedMesh,
    block_mesh,
)
from patchlaw.macro.contact.face_vibration import FACTORISED, FaceVibration

COMM = MPI.COMM_WORLD
CASES = {
    "cube, Q1, lattice": ("Q1", (32, 32, 31), 10.0, True),
    "cube, P2, lattice": ("P2", (16, 16, 15), 10.0, True),
    "cube, Q1": ("Q1", (32, 32, 31), 10.0, False),
    "cube, P1": ("P1", (32, 32, 31), 10.0, False),
    "cube, P2": ("P2", (16, 16, 15), 10.0, False),
    "plate, Q2": ("Q2", (28, 28, 4), 2.0, False),
}
"""Elements, cells, height of a face of 10 mm × 10 mm [mm], and whether the lattice is used."""
LAWS = [PowerLaw(k) for k in (3e4, 1e4, 5e4, 2e4)]
EVENTS = ("MatCholFctrNum", "MatLUFactorNum", "PCApply")


def pressed(element, cells, height, *, lattice):
    """Return the face and its contact problem, solved at a load."""
    shape = BlockShape(interface=(10.0, 10.0), height=height, cells=cells, element=element)
    material = Material(young_modulus=4000.0, poisson_ratio=0.3, density=2e-9)
    mesh = block_mesh(shape, COMM)
    face = LoadedFace.of_block(Block(mesh, material), PatchGrid(grid=(2, 2), lengths=(10.0, 10.0)))
    if not lattice:
        tagged = TaggedMesh(mesh=mesh.mesh, facet_tags=mesh.facet_tags)
        order = int(element[1])
        face = replace(face, body=MeshedBody(tagged, material, [Support(tag=BOTTOM)], order=order))
    problem = LawContactProblem(face, LAWS, "pointwise")
    return face, problem, problem.solve(Control(approach=0.02))


def counted():
    """Return what PETSc has counted."""
    return np.array([PETSc.Log.Event(name).getPerfInfo()["count"] for name in EVENTS])


def measure(name, case, factorised, modes):
    """Print the lines of a body."""
    *shape, lattice = case
    face, problem, state = pressed(*shape, lattice=lattice)
    spent = []
    for friction in (None, 0.4):
        along = None if friction is None else np.array([friction, 0.0])
        tangents = problem.forces.vibration_tangents(state, along)
        before, counts = memory(restart=True), counted()
        began = time.process_time(), time.perf_counter()
        found, *_ = FaceVibration(face, "pointwise", None, factorised).modes(tangents, modes)
        wall, cpu = time.perf_counter() - began[1], time.process_time() - began[0]
        spent.append(COMM.allreduce(cpu))
        taken, grown = counted() - counts, (memory() - before).sum() / 1e6
        if COMM.rank == 0:
            pairs = int((found.damping < -1.0).sum())
            print(
                f"{name:18s} {'slides' if friction else 'held':7s} {face.body.dofs:8d} "
                f"{spent[-1]:7.1f} ({wall:6.1f}) {spent[-1] / spent[0]:5.2f} {grown:8.0f} "
                f"{taken[0] + taken[1]:7.0f} {taken[2]:7.0f} {found.residuals.max():9.1e} "
                f"{found.frequencies[0]:10.1f} {pairs:6d}",
                flush=True,
            )


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("cases", nargs="*", default=list(CASES))
    parser.add_argument("--modes", type=int, default=20)
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--factorised", type=int, default=FACTORISED)
    choice = parser.parse_args()
    PETSc.Log.begin()
    if COMM.rank == 0:
        print(
            f"body               plane   unknowns   CPU [s] (wall) ratio  memory [MB] "
            f"factors applied  residual  first [Hz]  pairs   {choice.modes} modes"
        )
    for name in choice.cases:
        element, cells, *rest = CASES[name]
        fewer = tuple(max(2, round(count * choice.scale)) for count in cells)
        measure(name, (element, fewer, *rest), choice.factorised, choice.modes)


if __name__ == "__main__":
    main()
