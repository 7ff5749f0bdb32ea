"""Predicts the times of meshes: products with the stiffness, multigrid cycles, active sets.

Multigrid cycles and set-ups were measured on meshes of 8 to 131 thousand unknowns.
"""

from __future__ import annotations

from multiscale.planning.contact_costs import Speed
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.reference_meshes import ReferenceMeshes, mesh_unknowns

_MESH, _REFERENCE_MESH, _ACTIVE_SETS = 0.026, 0.052, 0.013
"""Times of meshing a block, of meshing a rough block, and of a load step by active sets [s]."""
_ENTRY = 1.15e-9
"""Time of an entry of the stiffness in a product with a vector [s]."""
_ENTRIES = {"Q1": 81.0, "P1": 45.0, "Q2": 190.0, "P2": 85.0}
"""Entries of the stiffness per unknown."""
_SET_UP, _CYCLE, _CYCLE_OVERHEAD = 80.0, 9.0, 0.13e-3
"""Products with the stiffness that mesh, stiffness and multigrid take as long as; those of a
multigrid cycle; and the time of a cycle besides [s]."""
_ALGEBRAIC_SET_UP = {"Q1": 400.0, "P1": 400.0, "Q2": 100.0, "P2": 170.0}
_ALGEBRAIC_CYCLE = 14.0
"""The same of meshes without a lattice, reading included: a pad of 10⁶ unknowns of tetrahedra took
490 and 17, quadratic ones 170; a ring of 10⁵ of flat hexahedra 1000 and 14, a cube of 10⁴ of
hexahedra 150 and 10, of 10⁵ of quadratic ones 60."""
_REFERENCE_CYCLES = {"Q1": 15.0, "Q2": 60.0, "P1": 40.0, "P2": 60.0}
"""Multigrid cycles of a load step of a reference. 15 to 22, 31 to 44 and 51 to 76 were counted with
Q1, P1 and P2. Q2 is taken to be like P2."""
_FACE, _CUBE, _FACTORISATION = 11.0, 11_271, 1.2
"""Time of solving for the compliance of the face of a cube in 8 × 8 modes [s], the unknowns of its
linear elements, and the power of them that the time grows with."""
_FREE_TILT = 1.4
"""Factor of these cycles where the plane is free to tilt: up to 90 were counted with P2."""


def face_work(setup: ProblemSetup) -> float:
    """Return the work of solving for the compliance of the meshed bodies' faces, in modes.

    It is 1 for a cube of 16 × 16 × 12 trilinear hexahedra, which are raised to quadratic ones and
    whose stiffness is factorised.

    Args:
        setup: The problem.
    """
    faces = filter(None, (setup.face, setup.counter_face))
    return sum((face.unknowns / _CUBE) ** _FACTORISATION for face in faces if face.digest)


def face_seconds(setup: ProblemSetup, speed: Speed) -> float:
    """Return the time of solving for the compliance of the meshed bodies' faces [s].

    Args:
        setup: The problem.
        speed: How fast work is done.
    """
    return speed.arrays * _FACE * face_work(setup)


def reference_seconds(
    setup: ProblemSetup, meshes: ReferenceMeshes, steps: int, speed: Speed
) -> tuple[float, float]:
    """Return the time of meshing a rough block, and of its load steps by active sets [s].

    Args:
        setup: The problem.
        meshes: Its meshes.
        steps: Load steps.
        speed: How fast work is done.
    """
    element = ("Q" if meshes.hexahedral else "P") + str(meshes.degree)
    product = speed.sparse * _ENTRY * _ENTRIES[element] * sum(meshes.unknowns)
    cycles = steps * _REFERENCE_CYCLES[element]
    if setup.scene.loading.tilt == "free":
        cycles *= _FREE_TILT
    load_steps = speed.arrays * _ACTIVE_SETS * steps + _CYCLE * cycles * product
    return speed.arrays * _REFERENCE_MESH + _SET_UP * product, load_steps


def mesh_seconds(setup: ProblemSetup, speed: Speed, cycles: int, *, made: bool = True) -> float:
    """Return the time of multigrid cycles on a mesh, and of making it and its multigrid [s].

    Args:
        setup: The problem.
        speed: How fast work is done.
        cycles: Multigrid cycles.
        made: Whether the mesh is to be made.
    """
    cycle, set_up = speed.arrays * _CYCLE_OVERHEAD, speed.arrays * _MESH
    for face in filter(None, (setup.face, setup.counter_face)):
        product = speed.sparse * _ENTRY * _ENTRIES[face.element] * face.unknowns
        cycle += _ALGEBRAIC_CYCLE * product
        set_up += _ALGEBRAIC_SET_UP[face.element] * product
    if setup.face is None:
        shape = setup.shape
        product = speed.sparse * _ENTRY * _ENTRIES[shape.element] * mesh_unknowns(shape)
        cycle, set_up = cycle + _CYCLE * product, set_up + _SET_UP * product
    return cycles * cycle + made * set_up
