"""Press two meshed bodies on each other on all ranks, print as JSON; for test_pair_ranks.py."""

from dataclasses import replace

from helpers.body_meshes import SIDE, box, hanging, standing
from helpers.contact_laws import PowerLaw
from helpers.on_ranks import tell
from mpi4py import MPI

from patchlaw.geometry import Control, PatchGrid
from patchlaw.macro import FacePair, LawContactProblem, Material, Support

COMM = MPI.COMM_WORLD
PATCHES = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))


def held_at_the_side(face):
    """Return a face whose body is held at an edge of it, and moved there."""
    supports = [Support(tag=SIDE, displacement=(0.0, 1e-4, -2e-4))]
    return replace(face, body=replace(face.body, supports=supports))


def pressed(mode, order, holds_edge):
    """Return force, moment, reaction and pressures of two load steps."""
    below = box((0, 0, -0.7), (1, 1, 0), (3, 2, 2), "tetrahedron", COMM)
    above = box((0, 0, 0), (1, 1, 1), (2, 3, 2), "hexahedron", COMM)
    soft, hard = (Material(young_modulus=e, poisson_ratio=0.3) for e in (2e3, 5e3))
    first = standing(below, soft, PATCHES, order)
    second = hanging(above, hard, PATCHES, order)
    if holds_edge:
        first, second = held_at_the_side(first), held_at_the_side(second)
    faces = FacePair(first, second)
    problem = LawContactProblem(faces, [PowerLaw(1e7 * (1 + i), power=2.0) for i in range(4)], mode)
    found = []
    for control in (Control(approach=2e-3, tilt=(1e-3, 0.0)), Control(force=3.0, tilt=None)):
        state = problem.solve(control)
        found += [state.force, state.reaction, state.approach, *state.patch_pressure]
    return found


if __name__ == "__main__":
    result = {
        f"{mode} {order} {holds_edge}": pressed(mode, order, holds_edge)
        for mode, order, holds_edge in (("patchwise", 1, False), ("pointwise", 2, True))
    }
    tell(result)
