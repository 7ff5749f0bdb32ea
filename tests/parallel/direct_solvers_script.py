"""Forces of blocks and bodies by the solvers that PETSc's options choose; for the test beside."""

import json
import sys
from pathlib import Path

import petsc4py

petsc4py.init(["direct", *sys.argv[1:]])
sys.path.insert(0, str(Path(__file__).parents[1]))

from helpers.user_problems import (  # noqa: E402
    BOTTOM,
    HEXAHEDRA,
    PATCHES,
    TETRAHEDRA,
    TOP,
    PowerLaw,
    box,
    marked,
)
from mpi4py import MPI  # noqa: E402

from geometry.face_frame import UPWARD  # noqa: E402
from geometry.meshes.block import BlockShape  # noqa: E402
from geometry.rigid_plane import Control  # noqa: E402
from macro import (  # noqa: E402
    Block,
    LawContactProblem,
    LoadedFace,
    Material,
    MeshedBody,
    Support,
    TaggedMesh,
    block_mesh,
    contact_facets,
)

COMM, MATERIAL = MPI.COMM_WORLD, Material(young_modulus=4000.0, poisson_ratio=0.3)
LAWS = [PowerLaw(k, touch) for k, touch in ((9e5, 0.0), (3e5, 2e-3), (2e6, 1e-3), (6e5, 0.0))]


def faces():
    """Yield blocks and bodies, of linear and quadratic elements."""
    for cell, name in ((TETRAHEDRA, "P"), (HEXAHEDRA, "Q")):
        for order in (1, 2):
            shape = BlockShape(
                interface=(1.0, 1.0), height=1.0, cells=(5, 5, 3), element=f"{name}{order}"
            )
            yield (
                f"block {name}{order}",
                LoadedFace.of_block(Block(block_mesh(shape, COMM), MATERIAL), PATCHES),
            )
            mesh = box(cells=(4, 4, 3), cell=cell, comm=COMM)
            tags = marked(mesh)
            body = MeshedBody(
                TaggedMesh(mesh=mesh, facet_tags=tags), MATERIAL, [Support(tag=BOTTOM)], order=order
            )
            facets = contact_facets(mesh, tags.find(TOP), UPWARD)
            yield f"body {name}{order}", LoadedFace(body, facets, PATCHES)


if __name__ == "__main__":
    found = {}
    for kind, face in faces():
        for mode in ("patchwise", "pointwise"):
            problem = LawContactProblem(face, LAWS, mode)
            pressed = problem.solve(Control(approach=6e-3))
            free = problem.solve(Control(force=4.0, tilt=None))
            found[f"{kind} {mode}"] = [pressed.force, *pressed.patch_pressure, *free.patch_pressure]
    if COMM.rank == 0:
        sys.stdout.write(json.dumps(found) + "\n")
