"""Linear solvers of symmetric positive definite matrices: multigrid, others, and factorisations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.options import (
    ALGEBRAIC_DEFAULTS,
    GEOMETRIC_DEFAULTS,
    KRYLOV_DEFAULTS,
    PREFIX,
    WeakContext,
    default_options,
    reason_name,
)
from patchlaw.macro.linear_solvers.solvers import Balanced, slow_modes
from patchlaw.support.errors import NotConverged

MARGINS = (50, 200, 800, 3200)
"""Memory beyond MUMPS's estimate that is tried in turn, in percent; its own default is 20. MUMPS
estimates the memory of a front before it knows the pivots and which rank works on what. On several
ranks the same matrix fits in one run and fails in the next (error −9)."""

_MARGIN = 14  # MUMPS's ICNTL(14): memory beyond the estimate, in percent
_OUT_OF_MEMORY = (-8, -9, -14, -15, -17, -20)  # errors that its guide answers with ICNTL(14)


@dataclass(frozen=True, slots=True, eq=False)
class CoarserGrid:
    """One of the coarser grids of a geometric multigrid.

    Args:
        interpolation: From this grid to the next finer one.
        matrix: The matrix on this grid.
    """

    interpolation: PETSc.Mat
    matrix: PETSc.Mat


class LinearSolver(PETSc.KSP):
    """PETSc's solver, with what its preconditioner needs in Python.

    Attributes:
        modes: This rank's rows of the modes that `solve_slow_modes` added; None before.
    """

    modes: NDArray[np.float64] | None = None
    _balanced: Any = None
    _inner: PETSc.PC | None = None

    @property
    def method(self) -> str:
        """PETSc's name of the preconditioner, that beside slow modes included."""
        return str((self._inner or self.pc).getType())

    def solve_slow_modes(
        self,
        grid: PETSc.KSP,
        matrix: PETSc.Mat | None = None,
        modes: NDArray[np.float64] | None = None,
    ) -> None:
        """Solve for modes that the preconditioner of a grid misses; see `slow_modes`.

        Args:
            grid: This solver, or that of the coarsest grid of its multigrid; set up.
            matrix: The grid's matrix, which must be kept as long as this; None: its operator.
            modes: The modes; None: they are found, where there are some.

        Note:
            Collective.
        """
        matrix, inner = matrix or grid.getOperators()[0], grid.pc
        self.modes = slow_modes(matrix, inner) if modes is None else modes
        if not self.modes.shape[1]:
            return
        self._balanced = Balanced(matrix, inner, self.modes)
        self._inner = inner if grid is self else None
        outer = PETSc.PC().create(self.comm)
        outer.setOperators(*grid.getOperators())
        outer.setType("python")
        outer.setPythonContext(WeakContext(self._balanced))
        outer.setUp()
        grid.setPC(outer)


def linear_solver(
    matrix: PETSc.Mat,
    coarser: Sequence[CoarserGrid] | None = None,
    preconditioner: Mapping[str, object] | None = None,
    *,
    finest: tuple[PETSc.Mat, PETSc.Mat] | None = None,
    whole: PETSc.Mat | None = None,
    prefix: str = PREFIX,
) -> LinearSolver:
    """Return a solver for a symmetric positive definite matrix, its preconditioner set up.

    Args:
        matrix: The matrix, with its near-nullspace attached.
        coarser: Coarser grids of a geometric multigrid, finest first; None for another
            preconditioner.
        preconditioner: Options of the preconditioner, which override the defaults here.
        finest: What the finest grid of a geometric multigrid smooths in place of the matrix, and
            the matrix with its diagonal blocks.
        whole: The matrix that another preconditioner is made of, which is destroyed; None: the
            matrix.
        prefix: Prefix of its PETSc options.

    Note:
        Collective.
    """
    solver: LinearSolver = LinearSolver().create(matrix.comm)
    solver.setOptionsPrefix(prefix)
    made_of = pointwise(whole or matrix) if coarser is None else matrix
    solver.setOperators(matrix, made_of)
    if coarser is not None:
        solver.pc.setType("mg")
        solver.pc.setMGLevels(len(coarser) + 1)
        for level, grid in enumerate(reversed(coarser)):
            solver.pc.setMGInterpolation(level + 1, grid.interpolation)
            solver.pc.getMGSmoother(level).setOperators(grid.matrix)
        if finest is not None:
            solver.pc.getMGSmoother(len(coarser)).setOperators(*finest)
    one_rank = {"mg_coarse_pc_telescope_reduction_factor": matrix.comm.size}
    usual = ALGEBRAIC_DEFAULTS if coarser is None else {**GEOMETRIC_DEFAULTS, **one_rank}
    with default_options(prefix, {**KRYLOV_DEFAULTS, **usual, **(preconditioner or {})}):
        solver.setFromOptions()
        if made_of is not matrix and solver.pc.getType() == "hypre":
            made_of = _hypres(made_of)  # else hypre's own copy would stand beside this one
            solver.setOperators(matrix, made_of)
        set_up(solver)  # multigrid reads the options of its levels here
    if made_of is not matrix:
        solver.pc.setReusePreconditioner(True)
        solver.setOperators(matrix)
        made_of.destroy()  # preconditioners that need it still hold it
    return solver


def pointwise(matrix: PETSc.Mat) -> PETSc.Mat:
    """Return a matrix of type ``aij``, because few preconditioners take 3 × 3 blocks."""
    if not matrix.getType().endswith("baij"):
        return matrix
    copy = matrix.convert("aij", PETSc.Mat())
    copy.setOption(PETSc.Mat.Option.SPD, True)
    copy.setNearNullSpace(matrix.getNearNullSpace())
    return copy


def _hypres(matrix: PETSc.Mat) -> PETSc.Mat:
    """Return a matrix as one of hypre's, and destroy it."""
    # converted in place, 3.18 keeps the entries twice
    other, size = matrix.convert("hypre", PETSc.Mat()), matrix.getBlockSize()
    matrix.destroy()
    other.setBlockSize(size)  # of the components of a node
    return other


def solve_linear(
    solver: PETSc.KSP, load: PETSc.Vec, solution: PETSc.Vec, *, tolerance: float | None = None
) -> int:
    """Solve and return the number of iterations.

    Args:
        solver: The solver.
        load: Right-hand side.
        solution: Receives the solution.
        tolerance: Largest residual relative to the load, if that is more than the solver's own.

    Raises:
        NotConverged: With the name of PETSc's reason.

    Note:
        Collective.
    """
    own = solver.getTolerances()[0]
    solver.setTolerances(rtol=max(own, tolerance or 0.0))
    with compat.errors_of_callbacks():
        solver.solve(load, solution)
    solver.setTolerances(rtol=own)
    if solver.reason < 0:
        raise NotConverged(
            "the linear solve of the block",
            reason=reason_name(PETSc.KSP.ConvergedReason, solver.reason),
            iterations=solver.its,
            remedy=f"see PETSc's options -{PREFIX}ksp_* and -{PREFIX}pc_*",
        )
    return int(solver.its)


def solved_at_once(matrix: PETSc.Mat, right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve for many right-hand sides with one factorisation by MUMPS.

    Args:
        matrix: Symmetric positive definite.
        right: This rank's rows of the right-hand sides, shape (n, m).

    Returns:
        The solutions, shape (n, m).

    Note:
        Collective.
    """
    solver, factorised = PETSc.KSP().create(matrix.comm), pointwise(matrix)
    solver.setOperators(factorised)
    solver.setType("preonly")
    solver.pc.setType("cholesky")
    solver.pc.setFactorSolverType("mumps")
    set_up(solver)
    arrays = np.asfortranarray(right), np.zeros(right.shape, order="F")
    size = (matrix.getLocalSize()[0], matrix.getSize()[0]), (None, right.shape[1])
    dense = [PETSc.Mat().createDense(size, array=a, comm=matrix.comm) for a in arrays]
    solver.pc.getFactorMatrix().matSolve(*dense)
    own = () if factorised is matrix else (factorised,)
    for part in (*dense, solver.pc, solver, *own):  # PETSc keeps objects that Python drops
        part.destroy()
    return arrays[1]


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
