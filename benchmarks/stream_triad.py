"""What memory gives the ranks of a job: bandwidth of STREAM's triad and of a dot product.

Run by hand on an idle machine: ``.venv/bin/python benchmarks/stream_triad.py``, and the same
under ``mpirun -n 2``; ``--json`` for scripts. Every rank has vectors of its own, far larger than
caches, and works between barriers, so that all work at once. Bytes are counted as STREAM does
(McCalpin 1995, IEEE TCCA Newsletter): 24 for an entry of the triad w = a x + y, which on caches
that read a line before they write it are 32; 16 for one of the dot product, which reads alone, as
a product with a matrix almost does.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import json
import sys
import time

from mpi4py import MPI
from petsc4py import PETSc

ENTRIES = 3 * 2**23  # 0.2 GB a vector, six times the last-level cache of a large processor
REPEATS = 7


def bandwidth(comm: MPI.Comm, entries: int = ENTRIES, repeats: int = REPEATS) -> dict[str, float]:
    """Return bytes per second of all ranks at once: the best of the repeats, the slowest rank.

    Args:
        comm: The ranks that work at once.
        entries: Length of every rank's vectors.
        repeats: How often each loop is run, after one that touches all pages.
    """
    x, y, w = (PETSc.Vec().createSeq(entries, comm=MPI.COMM_SELF) for _ in range(3))
    for value, vector in enumerate((x, y, w), start=1):
        vector.set(float(value))
    loops = {"triad": (24, lambda: w.waxpy(0.5, x, y)), "dot": (16, lambda: x.dot(y))}
    found = {}
    for name, (size, loop) in loops.items():
        loop()
        fastest = min(_slowest(comm, loop) for _ in range(repeats))
        found[name] = comm.size * entries * size / fastest
    for vector in (x, y, w):
        vector.destroy()
    return found


def _slowest(comm: MPI.Comm, loop) -> float:
    """Return the seconds of the slowest rank."""
    comm.Barrier()
    began = time.perf_counter()
    loop()
    return comm.allreduce(time.perf_counter() - began, op=MPI.MAX)


def main() -> None:
    """Print the bandwidths of all ranks of this job together."""
    found = bandwidth(MPI.COMM_WORLD)
    if MPI.COMM_WORLD.rank:
        return
    if "--json" in sys.argv:
        print(json.dumps(found))
    else:
        for name, rate in found.items():
            print(f"{name:6s} {rate / 1e9:6.1f} GB/s on {MPI.COMM_WORLD.size} ranks at once")


if __name__ == "__main__":
    main()
