"""Make a block's correction on all ranks and print it as JSON; for test_correction_ranks.py."""

import json

from mpi4py import MPI

from geometry import PatchGrid
from geometry.meshes import BlockShape
from macro import Material, cached_correction, make_correction
from micro.boussinesq import HalfSpace

COMM = MPI.COMM_WORLD
SHAPE = BlockShape(interface=(1.0, 1.2), height=0.7, cells=(8, 6, 4))


def made(make, grid, sides):
    """Return the nodal values, after all ranks were found to have the very same one."""
    loads = PatchGrid(grid=grid, lengths=SHAPE.interface)
    material = Material(young_modulus=1.0, poisson_ratio=0.3)
    values = make(SHAPE, material, sides, loads, HalfSpace(1.0, 0.3), COMM).values
    assert all((values == other).all() for other in COMM.allgather(values)), "ranks disagree"
    return values.tolist()


class Failing(HalfSpace):
    """A half-space that the last rank has no memory for."""

    def displacements(self, *_points):
        if COMM.rank == COMM.size - 1:
            raise MemoryError("no room")
        return super().displacements(*_points)


def failed():
    """Return the error that every rank meets when one fails."""
    loads = PatchGrid(grid=(3, 1), lengths=SHAPE.interface)
    material = Material(young_modulus=1.0, poisson_ratio=0.3)
    try:
        make_correction(SHAPE, material, "free", loads, Failing(1.0, 0.3), COMM)
        found = "none"
    except MemoryError as error:
        found = str(error)
    return COMM.allgather(found)


if __name__ == "__main__":
    result = {
        "more loads than ranks": made(make_correction, (3, 2), "free"),
        "rollers": made(make_correction, (2, 2), "roller"),
        "ranks without loads": made(make_correction, (1, 1), "free"),
        "kept, first": made(cached_correction, (2, 1), "free"),
        "kept, again": made(cached_correction, (2, 1), "free"),
    }
    errors = failed()
    if COMM.rank == 0:
        print(json.dumps({"values": result, "errors": errors}))
