"""Linear solvers of bodies that contact laws join.

Laws stiffer than the bodies let their faces move together. A preconditioner that knows one body at
a time damps that motion little, however well it knows the laws: only one multigrid of both bodies,
with the laws between them, does.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from petsc4py import PETSc
from scipy.linalg import block_diag

from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.node_matrices import Stiffened, joined, with_springs
from patchlaw.macro.linear_solvers.options import DIRECT_DEFAULTS, PREFIX
from patchlaw.macro.linear_solvers.selection import (
    COMPRESSIBLE,
    FACTORISED,
    algebraic_options,
    has_slow_modes,
    quadratic_options,
)
from patchlaw.macro.linear_solvers.solvers import CoarserGrid, LinearSolver, linear_solver
from patchlaw.support.arrays import Array


def joint_solver(bodies: Sequence[Any], stiffness: PETSc.Mat, stiffened: Stiffened) -> LinearSolver:
    """Return a solver for bodies that springs join, by one multigrid of all.

    Args:
        bodies: Each an `ElasticBody`.
        stiffness: That of the bodies, block diagonal, which may be without entries.
        stiffened: The same with springs, which the preconditioner is to know; it must be kept as
            long as the solver.

    Note:
        Collective.
    """
    options, incompressible = algebraic_options(_hardest(bodies)), False
    if max(body.poisson_ratio for body in bodies) > COMPRESSIBLE:
        incompressible = stiffness.getSize()[0] <= FACTORISED
    quadratic = any(body.degree == 2 for body in bodies)
    if quadratic and not incompressible:
        solver = _two_grids(bodies, stiffness, stiffened)
        if has_slow_modes(solver):
            solver.solve_slow_modes(solver.pc.getMGCoarseSolve(), None, _slow_modes(bodies))
    else:
        options = DIRECT_DEFAULTS if incompressible else options
        solver = linear_solver(stiffness, preconditioner=options, whole=stiffened.assembled())
        if not incompressible and not PETSc.Options(PREFIX).hasName("pc_type"):
            solver.solve_slow_modes(solver, stiffened.product, _slow_modes(bodies))
    return solver


def _two_grids(bodies: Sequence[Any], stiffness: PETSc.Mat, stiffened: Stiffened) -> LinearSolver:
    """Return a solver on the nodes of all bodies and, coarser, their vertices."""
    transfers = [_from_vertices(body) for body in bodies]
    count = range(len(bodies))
    transfer = joined([[transfers[i] if i == k else None for k in count] for i in count])
    springs = stiffened.springs.ptap(transfer)
    matrices = [body.linear.stiffness if body.degree == 2 else body.stiffness for body in bodies]
    grid = CoarserGrid(transfer, with_springs(matrices, springs))
    springs.destroy()
    options = quadratic_options(_hardest(bodies), grid.matrix)
    finest = stiffened.product, stiffened.block_diagonal()
    return linear_solver(stiffness, [grid], options, finest=finest)


def _from_vertices(body: Any) -> PETSc.Mat:
    """Return the interpolation of a body's displacements from its vertices."""
    if body.degree == 2:
        return body.from_vertices
    sizes = body.stiffness.getSizes()
    same = PETSc.Mat().createAIJ(sizes, nnz=1, comm=body.stiffness.comm)
    same.setDiagonal(body.free.duplicate())  # inserts the entries
    same.shift(1.0)
    return same


def _slow_modes(bodies: Sequence[Any]) -> Array | None:
    """Return this rank's rows of the modes that the bodies' own solvers solve for.

    None where the grid of a body was small enough for a factorisation, and that of all is not.
    """
    modes = []
    for body in bodies:
        own = body.linear if body.degree == 2 else body
        modes.append(body.spectrum.modes)
        if modes[-1] is None:
            if body.degree == 2 and body.lattice is None:
                return None
            modes[-1] = np.zeros((own.owned_dofs, 0))
    return np.asarray(block_diag(*modes))


def _hardest(bodies: Sequence[Any]) -> Any:
    """Return the mesh whose multigrid serves all: one of hexahedra, if there is one."""
    return max((body.mesh.mesh for body in bodies), key=compat.is_hexahedral)
