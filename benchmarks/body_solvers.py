"""Solvers of bodies whose mesh is no lattice: iterations, times and memory on machine parts.

Run by hand: `.venv/bin/python benchmarks/body_solvers.py [PART …] [--scale 1.5]`, also under
mpirun; ``--scale 2`` halves the cells. Every part is written by gmsh, read, assembled and solved to
1e-8 under a load of all frequencies. Iterations with the options of the body and with PETSc's
smoothed aggregation; times are CPU seconds of the slowest rank; memory is that of all ranks, per
unknown, beyond what they had before each phase, and in the whole (once with ``--file`` to make the
mesh, once more to measure). ``--steps 8`` presses the part instead, under a plane and one
pointwise law, and prints the time of every phase.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import ctypes
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from json_rows import keep
from machine_parts import STEEL, Part, part_body, read_part

from patchlaw.geometry import Control, PatchGrid
from patchlaw.macro import (
    LawContactProblem,
    LoadedFace,
    Material,
    compat,
    contact_facets,
    planar_face,
    read_mesh,
)
from patchlaw.macro.linear_solvers.options import PREFIX

COMM = MPI.COMM_WORLD
LINING, SOFT, RUBBERY = (
    Material(young_modulus=modulus, poisson_ratio=ratio)
    for modulus, ratio in ((5e3, 0.3), (500.0, 0.3), (500.0, 0.45))
)
PARTS = {
    # part, element degree, material of the second volume, whether on rollers
    "pad, 42:1": (Part(name="pad", cells="tet", size=1.6), 1, LINING, False),
    "pad, 420:1": (Part(name="pad", cells="tet", size=1.6), 1, SOFT, False),
    "pad, 420:1, rollers": (Part(name="pad", cells="tet", size=1.6), 1, SOFT, True),
    "pad, nu 0.45": (Part(name="pad", cells="tet", size=1.6), 1, RUBBERY, True),
    "pad, P2": (Part(name="pad", cells="tet", size=3.0), 2, SOFT, False),
    "pad, Q1": (Part(name="pad", cells="hex", size=1.8), 1, SOFT, True),
    "pad, Q2": (Part(name="pad", cells="hex", size=3.6), 2, SOFT, False),
    "flange": (Part(name="flange", cells="tet", size=2.2), 1, STEEL, False),
    "flange, P2": (Part(name="flange", cells="tet", size=4.4), 2, STEEL, False),
    "flange, Q1": (Part(name="flange", cells="hex", size=2.2), 1, STEEL, False),
    "L": (Part(name="L", cells="tet", size=1.4), 1, STEEL, False),
    "L, Q2": (Part(name="L", cells="hex", size=3.6), 2, STEEL, True),
    "ring 8:1": (Part(name="ring", cells="layers", size=0.6, flat=8), 1, STEEL, True),
    "ring 16:1": (Part(name="ring", cells="layers", size=0.8, flat=16), 1, STEEL, True),
    "ring 8:1, P2": (Part(name="ring", cells="layers", size=1.0, flat=8), 2, STEEL, True),
    "ring 8:1, Q1": (Part(name="ring", cells="hex", size=0.5, flat=8), 1, STEEL, True),
    "ring 20:1, Q1": (Part(name="ring", cells="hex", size=0.7, flat=20), 1, STEEL, True),
    "ring 8:1, Q2": (Part(name="ring", cells="hex", size=1.2, flat=8), 2, STEEL, True),
}


class Law:
    """p = 10 GPa/mm² c², about that of a rough steel surface."""

    def pressure(self, closure):
        return 1e4 * np.maximum(closure, 0.0) ** 2

    def stiffness(self, closure):
        return 2e4 * np.maximum(closure, 0.0)


PEAKS = []
"""Memory of every rank before every phase of a part, and the largest during it [B]."""


def memory(*, restart=False):
    """Return the largest memory of all ranks together, since a restart [B]."""
    if restart:
        ctypes.CDLL("libc.so.6").malloc_trim(0)
        Path("/proc/self/clear_refs").write_text("5")
    shown = Path("/proc/self/status").read_text().splitlines()
    (peak,) = (line.split()[1] for line in shown if line.startswith("VmHWM"))
    return 1024 * np.array(COMM.allgather(int(peak)))


def timed(work):
    """Return what work returns, CPU and wall seconds of the slowest rank, and memory per rank."""
    before = memory(restart=True)
    began = time.process_time(), time.perf_counter()
    found = work()
    spent = time.process_time() - began[0], time.perf_counter() - began[1]
    largest = memory()
    PEAKS.append((before, largest))
    return found, *(COMM.allreduce(part, op=MPI.MAX) for part in spent), largest - before


def whole_memory():
    """Return the largest memory since the first phase, beyond what was there, per rank [B]."""
    return np.max([largest for _, largest in PEAKS], axis=0) - PEAKS[0][0]


def iterations(body, solver):
    """Solve to 1e-8 under random forces."""
    load = body.stiffness.createVecRight()
    load.array[:] = np.random.default_rng(COMM.rank).standard_normal(body.owned_dofs)
    load.pointwiseMult(load, body.free)
    found = load.duplicate()
    solver.setTolerances(rtol=1e-8)
    solver.solve(load, found)
    return solver.its if solver.reason > 0 else -1


def solve(name, body, *, aggregation, json):
    """Print one line of the table."""
    assembly = timed(lambda: body.stiffness)
    setup = timed(lambda: body.solver)
    run = timed(lambda: iterations(body, body.solver))
    other, whole = "", whole_memory()
    if aggregation:
        for made in ("solver", "stiffness"):  # the matrix gets its rigid body modes by the option
            vars(body).pop(made)
        PETSc.Options(PREFIX)["pc_type"] = "gamg"
        second = timed(lambda: body.solver)
        third = timed(lambda: iterations(body, body.solver))
        other = f"{third[0]:7d} {second[1]:7.2f} {third[1]:7.2f}"
        PETSc.Options(PREFIX).delValue("pc_type")
    if COMM.rank == 0:
        used = (assembly[3], setup[3], whole)
        sizes = " ".join(f"{part.sum() / body.dofs:6.0f}" for part in used)
        bytes_each = whole.sum() / body.dofs
        seconds = {"set_up": setup[1], "solution": run[1]}
        keep(json, part=name, unknowns=body.dofs, iterations=run[0], bytes=bytes_each, **seconds)
        print(
            f"{name:22s} {body.dofs:8d} {run[0]:6d} {setup[1]:7.2f} {run[1]:7.2f}   {sizes}{other}",
            flush=True,
        )


def press(name, tagged, body, steps, json):
    """Press the part step by step, and print the time and memory of every phase."""
    tag = tagged.facet_names["contact"]
    face, facets = planar_face(tagged, tag), tagged.facet_tags.find(tag)

    def solved():
        for step in range(1, steps + 1):
            state = problem.solve(Control(approach=0.02 * step / steps))
            yield replace(state, displacement=None)  # a run keeps the last one alone

    lines = [
        (phase, (None, *timed(made)[1:]))  # holds no solver that laws replace
        for phase, made in (("assembly", lambda: body.stiffness), ("set-up", lambda: body.solver))
    ]
    patches = PatchGrid(grid=(1, 1), lengths=face.lengths)
    problem, *spent = timed(
        lambda: LawContactProblem(
            LoadedFace(body, contact_facets(tagged.mesh, facets, face.frame), patches),
            [Law()],
            "pointwise",
        )
    )
    lines.append(("law on the face", (None, *spent)))
    states, *spent = timed(lambda: list(solved()))
    lines.append((f"{steps} load steps", (None, *spent)))
    whole = whole_memory()
    if COMM.rank == 0:
        print(f"{name}, {body.dofs} unknowns")
        for phase, (_, cpu, wall, used) in lines:
            print(f"  {phase:16s} {cpu:7.2f} s CPU {wall:7.2f} s   {used / 1e9} GB")
        newton = [state.iterations for state in states]
        linear = [state.linear_iterations for state in states]
        print(f"  whole {whole / 1e9} GB, {whole.sum() / body.dofs:.0f} B per unknown")
        print(f"  Newton {newton}, linear {linear}, force {states[-1].force:.3f} N")
        seconds = {phase: wall for phase, (_, _, wall, _) in lines}
        counts = {"newton": newton, "linear": linear, "bytes": whole.sum() / body.dofs}
        keep(json, part=name, unknowns=body.dofs, seconds=seconds, **counts)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*")
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--steps", type=int, default=0)
    parser.add_argument("--aggregation", action="store_true", help="beside PETSc's GAMG")
    parser.add_argument("--file", help="keep the mesh here, or take it: memory without gmsh's")
    parser.add_argument("--json", metavar="FILE", help="append the rows to it")
    choice = parser.parse_args()
    if COMM.rank == 0 and not choice.steps:
        print(
            "part                   unknowns  iter. set-up[s] solve[s]  "
            "matrix, set-up, whole [B]   GAMG"
        )
    for name in choice.parts or PARTS:
        PEAKS.clear()
        part, *rest = PARTS[name]
        part = replace(part, size=part.size / choice.scale, fast=part.cells == "tet")
        tagged, cpu, wall, used = read_part(
            part, COMM, lambda path, comm: timed(lambda: read_mesh(path, comm)), choice.file
        )
        if COMM.rank == 0:
            print(f"# {name}: read in {cpu:.1f} s CPU, {wall:.1f} s, {used / 1e9} GB", flush=True)
        body = part_body(tagged, *rest)
        if choice.steps:
            press(name, tagged, body, choice.steps, choice.json)
        else:
            solve(name, body, aggregation=choice.aggregation, json=choice.json)
        compat.collect_garbage(PETSc.COMM_WORLD)


if __name__ == "__main__":
    main()
