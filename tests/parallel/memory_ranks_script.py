"""Run one scene after another in one process; print the memory that the later ones added [MB]."""

import sys
from pathlib import Path

from mpi4py import MPI

from patchlaw.multiscale import Scene, run

COMM = MPI.COMM_WORLD
PAPER = Path(__file__).parents[2] / "demos" / "scenes" / "paper.toml"
SMALL = ["surface.grid=[64, 64]", "load.steps=1"]
SCENES = {
    "isolated": ["block.cells=[16, 16, 12]"],
    "reference": ["reference.fine='40 um'", "reference.meshes=1"],
    "concurrent": ["block.cells=[8, 8, 5]"],
}


def resident():
    """Return this rank's resident memory [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


if __name__ == "__main__":
    kind = sys.argv[1]
    scene = Scene.load(PAPER, [*SMALL, f"coupling.kind={kind}", *SCENES[kind]])
    sizes = []
    for _ in range(4):
        run(scene, COMM if COMM.size > 1 else None)
        sizes.append(resident())
    added = COMM.allreduce(sizes[-1] - sizes[1], op=MPI.MAX)
    if COMM.rank == 0:
        print(added)
