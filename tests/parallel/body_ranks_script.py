"""Make a block's compliance in modes on all ranks, print it as JSON; for test_body_ranks.py."""

from functools import partial
from unittest import mock

import numpy as np
from helpers.on_ranks import tell
from mpi4py import MPI

from patchlaw.geometry import BlockShape, PatchGrid
from patchlaw.macro import Material, face_compliance
from patchlaw.macro.compliance import face_compliance as module
from patchlaw.macro.compliance.face_compliance import lattice_compliance

COMM = MPI.COMM_WORLD
MATERIAL = Material(young_modulus=1.0, poisson_ratio=0.3)
BLOCKS = {
    "square": ((1.0, 1.0), 0.7, 4),
    "oblong": ((1.0, 1.2), 0.7, 3),
    "mean": ((1.0, 1.0), 0.7, 1),
}


def made(make, lengths, height, count):
    """Return all parts, after all ranks were found to have the very same ones."""
    found = make(lengths, height, MATERIAL, "free", count, COMM)
    parts = np.concatenate([[found.normal, found.growth], found.stresses])
    assert all((parts == other).all() for other in COMM.allgather(parts)), "ranks disagree"
    return parts.tolist()


def failed():
    """Return the error that every rank meets when the last one has no memory."""
    solve = module.ParityBlock.response

    def response(block):
        if COMM.rank == COMM.size - 1:
            raise MemoryError("no room")
        return solve(block)

    with mock.patch.object(module.ParityBlock, "response", response):
        try:
            face_compliance((1.0, 1.0), 1.0, MATERIAL, "free", 2, COMM)
            found = "none"
        except MemoryError as error:
            found = str(error)
    return COMM.allgather(found)


if __name__ == "__main__":
    result = {name: made(face_compliance, *block) for name, block in BLOCKS.items()}
    result["kept, first"] = made(partial(face_compliance, use_cache=True), *BLOCKS["square"])
    result["kept, again"] = made(partial(face_compliance, use_cache=True), *BLOCKS["square"])
    shape = BlockShape(interface=(1.0, 1.0), height=0.7, cells=(6, 6, 4))
    patches = PatchGrid(grid=(5, 5), lengths=(1.0, 1.0))
    on_lattice = lattice_compliance(shape, MATERIAL, "free", patches, np.arange(25), COMM)
    assert all((on_lattice == other).all() for other in COMM.allgather(on_lattice))
    result["patches"] = on_lattice.tolist()
    errors = failed()
    tell({"values": result, "errors": errors})
