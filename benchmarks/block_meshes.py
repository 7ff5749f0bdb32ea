"""Meshes of flat blocks: time, memory, what ranks share, products.

Run by hand on an idle machine: ``.venv/bin/python benchmarks/block_meshes.py``; every line in
clean processes, the least time of a few. Memory is the growth of rank 0's peak while the mesh is
made. The product is that of the stiffness with a vector, in CPU time of rank 0; its messages and
bytes are those that the busiest rank sends.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from helpers.mpi_environment import MPI_ENVIRONMENT

ROOT = Path(__file__).parents[1]
ENVIRONMENT = os.environ | MPI_ENVIRONMENT | {"PYTHONPATH": str(ROOT)}
PRODUCTS = 20
REPEATS = 3


def measure(cells: list[int], element: str, product: bool) -> None:
    """Make a mesh on this job's ranks; rank 0 prints what it took as JSON."""
    from mpi4py import MPI
    from petsc4py import PETSc

    from patchlaw.geometry import BlockShape
    from patchlaw.macro import Block, Material, block_mesh

    comm = MPI.COMM_WORLD
    PETSc.Log.begin()

    def largest(value):
        return comm.allreduce(value, op=MPI.MAX)

    def peak():
        return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    def timed(work):
        comm.Barrier()
        began = time.perf_counter(), time.process_time()
        result = work()
        return result, largest(time.perf_counter() - began[0]), time.process_time() - began[1]

    small = BlockShape(interface=(1.0, 1.0), height=0.5, cells=(1, 1, 1), element=element)
    block_mesh(small, comm)  # imports
    shape = BlockShape(
        interface=(1.0, 1.0), height=0.5, cells=tuple(cells), element=element, grading=4.0
    )
    before = peak()
    mesh, seconds, busy = timed(lambda: block_mesh(shape, comm))
    facts = {"seconds": seconds, "busy": busy, "memory": peak() - before}
    own = mesh.mesh.topology.index_map(3)
    facts |= {
        "cells": own.size_global,
        "imbalance": largest(own.size_local) * comm.size / own.size_global,
    }
    if product:
        matrix = Block(mesh, Material(young_modulus=4e3, poisson_ratio=0.15)).stiffness
        x, y = matrix.createVecs()
        x.set(1.0)
        event = PETSc.Log.Event("MatMult")
        before = event.getPerfInfo()
        facts["product"] = min(timed(lambda: matrix.mult(x, y))[2] for _ in range(PRODUCTS))
        after = event.getPerfInfo()
        # PETSc counts a message where it is sent and where it is received
        for name, key in (("messages", "numMessages"), ("bytes", "messageLength")):
            facts[name] = largest(0.5 * (after[key] - before[key]) / PRODUCTS)
    if comm.rank == 0:
        print(json.dumps(facts))


def on(ranks: int, *words: object) -> dict:
    """Start this file on a number of ranks and return what it measured."""
    command = ["mpirun", "-n", str(ranks), sys.executable, __file__, *map(str, words)]
    done = subprocess.run(
        command, cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def show(title: str, rows: list[tuple[object, ...]], product: bool) -> None:
    """Measure and print a table; rows are (ranks, element, cells along x, y, z)."""
    head = "ranks element      cells  wall [s]  rank 0: CPU [s]       MB  imbalance"
    print(f"\n{title}\n{head}{'  product [ms]  messages      kB' if product else ''}")
    for ranks, element, *cells in rows:
        words = ["--be", *cells, element, *(["--product"] if product else [])]
        facts = [on(int(str(ranks)), *words) for _ in range(REPEATS)]
        least = {name: min(fact[name] for fact in facts) for name in facts[0]}
        print(
            f"{ranks!s:>5s} {element!s:>7s} {least['cells']:10d} "
            f"{least['seconds']:9.2f} {least['busy']:16.2f} {least['memory'] / 1e6:8.0f} "
            f"{least['imbalance']:10.3f}",
            end="" if product else "\n",
        )
        if product:
            print(
                f" {1e3 * least['product']:13.2f} {least['messages']:9.1f} "
                f"{least['bytes'] / 1e3:7.1f}"
            )


def main() -> None:
    """Measure and print all tables, or be one of the ranks measured."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="up to 10⁵ cells only")
    parser.add_argument("--be", nargs=4, help="be one rank of a measurement: cells, element")
    parser.add_argument("--product", action="store_true", help="measure products as well")
    choice = parser.parse_args()
    if choice.be:
        *cells, element = choice.be
        return measure([int(count) for count in cells], element, choice.product)
    sizes = [(20, 20, 15), (28, 28, 25), (40, 40, 25), (64, 64, 24)]
    if not choice.quick:
        sizes += [(158, 158, 40), (250, 250, 48)]
    rows: list[tuple[object, ...]] = [(n, "Q1", *size) for size in sizes for n in (1, 2)]
    show("hexahedra", rows, product=False)
    rows = [(n, "P1", 30, 30, 20) for n in (1, 2)]
    show("tetrahedra", rows, product=False)
    rows = [(n, "Q1", 40, 40, 25) for n in (1, 2, 4, 8)]
    show("what a product of the stiffness costs", rows, product=True)
    return None


if __name__ == "__main__":
    main()
