"""Send the stage of a scene to all ranks; print what every rank got, and how it was sent."""

import hashlib
from pathlib import Path

from mpi4py import MPI
from mpi4py.util import pkl5

from multiscale import Run, Scene
from multiscale.nodes import nodes_of

COMM = MPI.COMM_WORLD
PAPER = Path(__file__).parents[2] / "demos" / "scenes" / "paper.toml"
SENT = []


def watched(value, dumps=pkl5.pickle.dumps):
    """Pickle a value for a message; keep the bytes of the pickle and of the arrays beside it."""
    words, arrays = dumps(value)
    SENT.append((len(words), *sorted(len(array) for array in arrays)))
    return words, arrays


if __name__ == "__main__":
    pkl5.pickle.dumps = watched
    scene = Scene.load(PAPER, ["surface.grid=[200, 256]", "coupling.kind=analytic"])
    stage = Run(scene, COMM if COMM.size > 1 else None).stage
    surface = stage.surface
    told = (
        hashlib.sha256(surface.heights.tobytes()).hexdigest(),
        surface.heights.flags.writeable,
        float(surface.interpolant(0.31, 0.62, dx=1)).hex(),
        stage.asperities.count,
        stage.model.contact_modulus.hex(),
    )
    nodes = nodes_of(COMM)
    everywhere = COMM.gather(told)
    if COMM.rank == 0:
        print(*sorted(set(everywhere)), SENT, nodes.ranks, sep="\n")
