"""Make blocks with both builders on all ranks and print facts as JSON; for test_mesh_ranks.py."""

import hashlib
import json
import sys
from pathlib import Path

from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parents[1] / "unit" / "macro"))

from mesh_facts import cells_of, faces_of, measures_of

from geometry import BlockShape
from macro import BOTTOM, SIDES, TOP, block_mesh

COMM = MPI.COMM_WORLD
WIDE = {"margin": 0.4, "margin_cells": 2, "margin_grading": 3.0, "grading": 5.0}
SHAPES = {
    "wide hexahedra": {"cells": (4, 3, 3), **WIDE},
    "quadratic hexahedra": {"cells": (3, 2, 2), "element": "Q2", "grading": 2.0},
    "wide tetrahedra": {"cells": (3, 2, 3), "element": "P1", **WIDE},
    "quadratic tetrahedra": {"cells": (2, 3, 1), "element": "P2"},
    # fewer cells along every axis than ranks, then fewer cells than ranks
    "rod": {"cells": (1, 2, 1)},
    "box": {"cells": (1, 1, 1), "element": "P1"},
}


def facts(shape, builder):
    """Return what must not depend on builder and ranks, and how the cells are spread."""
    block = block_mesh(BlockShape(interface=(1.0, 2.0), height=0.7, **shape), COMM, builder)
    exact = [cells_of(block), *(faces_of(block, marker) for marker in (BOTTOM, TOP, SIDES))]
    cells = block.mesh.topology.index_map(3)
    return {
        "exact": [hashlib.sha256(part.tobytes()).hexdigest() for part in exact],
        "measures": measures_of(block),
        "cells_of_ranks": COMM.allgather(cells.size_local),
        "ghosts": COMM.allreduce(cells.num_ghosts),
    }


if __name__ == "__main__":
    result = {
        name: {builder: facts(shape, builder) for builder in ("gmsh", "lattice")}
        for name, shape in SHAPES.items()
    }
    if COMM.rank == 0:
        print(json.dumps(result))
