"""Send the stage of a scene to all ranks; print what every rank got, and what is to be sent."""

import hashlib
import pickle
from pathlib import Path

from mpi4py import MPI

from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.machine import cluster_nodes

COMM = MPI.COMM_WORLD
PAPER = Path(__file__).parents[2] / "demos" / "scenes" / "paper.toml"


def parts(value):
    """Return the bytes of a value's pickle and those of the arrays that travel beside it."""
    arrays = []
    words = pickle.dumps(value, 5, buffer_callback=lambda array: arrays.append(array.raw().nbytes))
    return [len(words), *sorted(size for size in arrays if size > 10_000)]


if __name__ == "__main__":
    scene = Scene.load(PAPER, ["surface.grid=[200, 256]", "coupling.kind=analytic"])
    setup = Run(scene, COMM if COMM.size > 1 else None).coupling
    surface = setup.parts.surface
    told = (
        hashlib.sha256(surface.heights.tobytes()).hexdigest(),
        surface.heights.flags.writeable,
        float(surface.interpolant(0.31, 0.62, dx=1)).hex(),
        setup.parts.asperities.count,
        setup.parts.micro.contact_modulus.hex(),
    )
    nodes = cluster_nodes(COMM)
    everywhere = COMM.gather(told)
    if COMM.rank == 0:
        print(*sorted(set(everywhere)), parts(setup.parts), nodes.ranks, sep="\n")
