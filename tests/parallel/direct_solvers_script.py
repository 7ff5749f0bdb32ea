"""Forces of blocks and bodies by the solvers that PETSc's options choose; for the test beside."""

from helpers.contact_laws import PowerLaw
from helpers.on_ranks import tell
from helpers.user_problems import BOTTOM, HEXAHEDRA, PATCHES, TETRAHEDRA, TOP, box, marked
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import BlockShape, Control
from patchlaw.geometry.face_frame import UPWARD
from patchlaw.macro import (
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

CHOICES = {
    "usual": {},
    "mumps": {"pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"},
    "superlu": {
        "ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "superlu_dist",
    },
    "bjacobi": {"pc_type": "bjacobi", "ksp_max_it": 9999},
}  # fmt: skip
COMM, MATERIAL = MPI.COMM_WORLD, Material(young_modulus=4000.0, poisson_ratio=0.3)
LAWS = [PowerLaw(k, touch) for k, touch in ((9e5, 0.0), (3e5, 2e-3), (2e6, 1e-3), (6e5, 0.0))]


EVERY_FACE = [("P", 1), ("P", 2), ("Q", 1), ("Q", 2)]
FEW_FACES = [("Q", 1), ("P", 2)]
"""What options choose does not depend on the element: one rank alone presses all of them."""


def faces(elements):
    """Yield blocks and bodies of linear and quadratic elements, laws by patches or at points."""
    for name, order in elements:
        cell = TETRAHEDRA if name == "P" else HEXAHEDRA
        cells = (4, 4, 3) if order == 1 else (3, 3, 2)
        shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=cells, element=f"{name}{order}")
        block = Block(block_mesh(shape, COMM), MATERIAL)
        modes = ("patchwise", "pointwise") if name == "P" else ("pointwise", "patchwise")
        yield f"block {name}{order}", LoadedFace.of_block(block, PATCHES), modes[0]
        mesh = box(cells=(4, 4, 3) if order == 1 else (2, 2, 2), cell=cell, comm=COMM)
        tags = marked(mesh)
        body = MeshedBody(
            TaggedMesh(mesh=mesh, facet_tags=tags), MATERIAL, [Support(tag=BOTTOM)], order=order
        )
        facets = contact_facets(mesh, tags.find(TOP), UPWARD)
        yield f"body {name}{order}", LoadedFace(body, facets, PATCHES), modes[1]


def forces(elements):
    """Return the forces on faces under an approach, and those of a plane that is free."""
    found = {}
    for name, face, mode in faces(elements):
        problem = LawContactProblem(face, LAWS, mode)
        pressed = problem.solve(Control(approach=6e-3))
        free = problem.solve(Control(force=4.0, tilt=None))
        found[name] = [pressed.force, *pressed.patch_pressure, *free.patch_pressure]
    return found


def by_choice(choice):
    """Return the forces by a solver that PETSc's options choose."""
    options = PETSc.Options("patchlaw_")
    for name, value in CHOICES[choice].items():
        options[name] = value
    try:
        few = FEW_FACES if choice == "mumps" else FEW_FACES[:1]
        return forces(EVERY_FACE if COMM.size == 1 else few)
    finally:
        for name in CHOICES[choice]:
            options.delValue(name)


if __name__ == "__main__":
    taken = ("usual", "mumps") if COMM.size == 1 else CHOICES.keys() - {"usual"}
    result = {choice: by_choice(choice) for choice in sorted(taken)}
    tell(result)
