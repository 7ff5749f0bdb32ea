"""Counts the work and the memory of blocks: body terms, meshes under laws, explicit rough ones.

Counts are measured: operations and entries of factors as MUMPS tells them, on 2 to 82 thousand
unknowns; cycles and times of set-ups over the machine's rates, on 8 to 131 thousand.
"""

from __future__ import annotations

import math
import sys

from geometry.meshes.block import BlockShape
from multiscale.costs.work import Work
from multiscale.setup.reference_meshes import ReferenceMeshes

IMPORT = Work(call=2_700_000)
"""Loading dolfinx, PETSc and gmsh, unless they are there."""

BODY = Work(call=250_000)
"""The body term of a cube; thin blocks take several times more."""

_CYCLE = 6.6  # products with the stiffness that a cycle is worth
_SET_UP = 250.0  # products that mesh, stiffness and multigrid are worth
_ENTRIES = {"Q1": 81.0, "P1": 45.0, "Q2": 190.0, "P2": 85.0}  # of the stiffness, per unknown
_REFERENCE_CYCLES = {"Q1": 15, "Q2": 60, "P1": 40, "P2": 60}
"""Multigrid cycles of all active sets of a load step: 15 to 22, 31 to 44 and 51 to 76 were counted
with Q1, P1 and P2; Q2 is taken like P2."""

_TURNING = 1.4  # times more where the plane turns: up to 90 with P2


def import_work() -> Work:
    """Return the work of loading the finite elements, none where they are loaded."""
    return Work() if "dolfinx" in sys.modules else IMPORT


def mesh_unknowns(shape: BlockShape) -> int:
    """Return the degrees of freedom of a mesh under laws.

    Args:
        shape: The block.
    """
    x, y, z = shape.ticks
    return 3 * math.prod(shape.degree * (len(ticks) - 1) + 1 for ticks in (x, y, z))


def mesh_entries(shape: BlockShape) -> float:
    """Return the entries of its stiffness, roughly.

    Args:
        shape: The block.
    """
    return _ENTRIES[shape.element] * mesh_unknowns(shape)


def mesh_work(shape: BlockShape) -> Work:
    """Return the work of mesh, stiffness and multigrid set-up.

    Args:
        shape: The block.
    """
    return Work(call=100_000, product=_SET_UP * mesh_entries(shape))


def cycle_work(shape: BlockShape, cycles: float) -> Work:
    """Return the work of multigrid cycles on a mesh.

    Args:
        shape: The block.
        cycles: How many.
    """
    return Work(call=500.0 * cycles, product=_CYCLE * cycles * mesh_entries(shape))


def mesh_bytes(shape: BlockShape) -> float:
    """Return the memory of mesh, stiffness and multigrid [B].

    Args:
        shape: The block.
    """
    return 30.0 * mesh_entries(shape)


def reference_work(
    meshes: ReferenceMeshes, steps: int, *, turning: bool = False
) -> tuple[Work, Work]:
    """Return the work of explicit rough meshes: making them, and their load steps by active sets.

    Args:
        meshes: The meshes.
        steps: Load steps.
        turning: Whether the plane is free to turn.
    """
    kind = ("Q" if meshes.hexahedral else "P") + str(meshes.degree)
    entries = _ENTRIES[kind] * sum(meshes.unknowns)
    made = import_work() + Work(call=200_000, product=_SET_UP * entries)
    cycles = steps * _REFERENCE_CYCLES[kind] * (_TURNING if turning else 1.0)
    return made, Work(call=50_000.0 * steps, product=_CYCLE * cycles * entries)
