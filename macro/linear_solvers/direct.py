"""Factorisations by MUMPS, which are repeated with more memory where its estimate was too small.

MUMPS estimates the memory of a front before it knows the pivots and which rank works on what. On
several ranks the same matrix fits in one run and fails in the next (error −9).
"""

from __future__ import annotations

from collections.abc import Sequence

from petsc4py import PETSc

from geometry.errors import NotConverged

DIRECT_DEFAULTS = {"pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"}
"""A factorisation, distributed over the ranks."""

MARGINS = (50, 200, 800, 3200)
"""Memory beyond MUMPS's estimate that is tried in turn, in percent; its own default is 20."""

_MARGIN = 14  # MUMPS's ICNTL(14): memory beyond the estimate, in percent
_OUT_OF_MEMORY = (-8, -9, -14, -15, -17, -20)  # errors that its guide answers with ICNTL(14)


def set_up(solver: PETSc.KSP, margins: Sequence[int] = MARGINS) -> None:
    """Set up a solver; a factorisation by MUMPS that runs out of memory is repeated with more.

    Args:
        solver: With its operators and options. Any other preconditioner is set up as it is.
        margins: Memory beyond MUMPS's estimate to try in turn [%].

    Raises:
        NotConverged: When MUMPS fails otherwise, or with the largest margin.

    Note:
        Collective.
    """
    if not _by_mumps(solver.pc):
        solver.setUp()
        return
    for margin in margins:
        solver.pc.setFactorSetUpSolverType()  # makes the factor, which then takes its options
        factor = solver.pc.getFactorMatrix()
        factor.setMumpsIcntl(_MARGIN, margin)
        solver.setUp()
        error = factor.getMumpsInfog(1)
        if error >= 0:
            return
        if error not in _OUT_OF_MEMORY:
            break
        operators = solver.getOperators()
        solver.pc.reset()  # PETSc never retries a factor that failed
        solver.setOperators(*operators)
    raise NotConverged(
        "the factorisation of the block",
        reason=f"MUMPS's INFOG(1) = {error}",
        iterations=0,
        remedy="see MUMPS's guide for the number; more memory, or a coarser mesh",
    )


def _by_mumps(preconditioner: PETSc.PC) -> bool:
    if preconditioner.getType() not in ("cholesky", "lu"):
        return False
    preconditioner.setFactorSetUpSolverType()  # PETSc chooses the package here
    return str(preconditioner.getFactorSolverType()) == "mumps"
