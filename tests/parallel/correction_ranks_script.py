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


if __name__ == "__main__":
    result = {
        "more loads than ranks": made(make_correction, (3, 2), "free"),
        "rollers": made(make_correction, (2, 2), "roller"),
        "ranks without loads": made(make_correction, (1, 1), "free"),
        "kept, first": made(cached_correction, (2, 1), "free"),
        "kept, again": made(cached_correction, (2, 1), "free"),
    }
    if COMM.rank == 0:
        print(json.dumps(result))
