"""Factorisations by MUMPS, which get more room where it estimated too little.

What a front needs is estimated before pivots are known and before it is known which rank works on
what: on several ranks, the same matrix fits in one run and not in the next (its error −9).
"""

from __future__ import annotations

from collections.abc import Mapping

from petsc4py import PETSc

from geometry.errors import NotConverged

DIRECT_DEFAULTS: Mapping[str, object] = {
    "pc_type": "cholesky",
    "pc_factor_mat_solver_type": "mumps",
}
"""A factorisation, distributed over the ranks."""

_ROOM = 14  # MUMPS's ICNTL(14): room beyond the estimate
_ROOMS = (50, 200, 800, 3200)  # in percent; MUMPS itself takes 20
_SHORT_OF_ROOM = (-8, -9, -14, -15, -17, -20)  # its errors, which its guide answers with more room


def set_up(solver: PETSc.KSP) -> None:
    """Set up a solver; a factorisation by MUMPS that runs out of room is repeated with more.

    Args:
        solver: With its operators and options; another preconditioner is set up as it is.

    Raises:
        NotConverged: When MUMPS fails otherwise, or runs out of all the room that it may have.

    Note:
        Collective.
    """
    if not _by_mumps(solver.pc):
        solver.setUp()
        return
    for room in _ROOMS:
        solver.pc.setFactorSetUpSolverType()  # makes the factor, to be told its room
        factor = solver.pc.getFactorMatrix()
        factor.setMumpsIcntl(_ROOM, room)
        solver.setUp()
        error = factor.getMumpsInfog(1)
        if error >= 0:
            return
        if error not in _SHORT_OF_ROOM:
            break
        operators = solver.getOperators()
        solver.pc.reset()  # a factor that failed is never tried again
        solver.setOperators(*operators)
    raise NotConverged(
        "the factorisation of the block",
        reason=f"MUMPS's INFOG(1) = {error}",
        iterations=0,
        remedy="see MUMPS's guide for the number; more memory, or a coarser mesh",
    )


def _by_mumps(conditioner: PETSc.PC) -> bool:
    if conditioner.getType() not in ("cholesky", "lu"):
        return False
    conditioner.setFactorSetUpSolverType()  # before it, the one that PETSc will take is open
    return str(conditioner.getFactorSolverType()) == "mumps"
