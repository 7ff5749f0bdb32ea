"""Make blocks on all ranks and print facts as JSON; for test_mesh_ranks.py."""

import hashlib

import numpy as np
from helpers.mesh_facts import cells_of, faces_of, measures_of
from helpers.on_ranks import tell
from mpi4py import MPI

from patchlaw.geometry import BlockShape, PatchGrid
from patchlaw.macro import BOTTOM, SIDES, TOP, Block, Material, RoughFace, block_mesh, compat
from patchlaw.macro.contact.face_nodes import TopNodes

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


def facts(shape):
    """Return what must not depend on the ranks, and how the cells are spread."""
    block = block_mesh(BlockShape(interface=(1.0, 2.0), height=0.7, **shape), COMM)
    exact = [cells_of(block), *(faces_of(block, marker) for marker in (BOTTOM, TOP, SIDES))]
    cells = block.mesh.topology.index_map(3)
    return {
        "exact": [hashlib.sha256(part.tobytes()).hexdigest() for part in exact],
        "measures": measures_of(block),
        "cells_of_ranks": COMM.allgather(cells.size_local),
        "ghosts": COMM.allreduce(cells.num_ghosts),
    }


def dealt(order):
    """Return the measures of a box whose six tetrahedra are dealt out in some order."""
    made = compat.mesh_from_cells

    def deal(cells, points, _beyond, comm):
        mine = np.concatenate(comm.allgather(cells))[order][comm.rank :: comm.size]
        others = np.delete(np.arange(comm.size), comm.rank)
        beyond = np.repeat(np.arange(len(mine)), len(others)), np.tile(others, len(mine))
        return made(mine, points, beyond, comm)

    compat.mesh_from_cells = deal
    shape = BlockShape(interface=(1.0, 2.0), height=0.7, **SHAPES["box"])
    block = block_mesh(shape, COMM)
    compat.mesh_from_cells = made
    return measures_of(block)


def regions(patterns):
    """Return in how many regions nodes of a top are in contact, for patterns (9, 8) of contact."""
    shape = BlockShape(interface=(8.0, 7.0), height=1.0, cells=(8, 7, 1))
    mesh = block_mesh(shape, COMM)
    block = Block(mesh, Material(young_modulus=1.0, poisson_ratio=0.3))
    top = TopNodes(RoughFace.of_block(block), PatchGrid(grid=(1, 1), lengths=(8.0, 7.0)))
    at = np.rint(top.x).astype(int), np.rint(top.y).astype(int)
    return [top.regions(pattern[at])[1] for pattern in patterns]


if __name__ == "__main__":
    result = {name: facts(shape) for name, shape in SHAPES.items()}
    orders = np.random.default_rng(2).permuted(np.tile(np.arange(6), (10, 1)), axis=1)
    result["dealt"] = [dealt(order) for order in orders] if COMM.size > 1 else []
    # sparse to dense, from single nodes to one region that winds through all ranks
    shares = np.random.default_rng(5).random((12, 9, 8))
    patterns = shares < np.linspace(0.05, 0.7, 12)[:, None, None]
    result["regions"] = {"found": regions(patterns), "patterns": patterns.astype(int).tolist()}
    tell(result)
