"""Linear solvers of symmetric positive definite matrices: multigrid, others, and factorisations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.options import (
    ALGEBRAIC_DEFAULTS,
    GEOMETRIC_DEFAULTS,
    KRYLOV_DEFAULTS,
    PREFIX,
    SMOOTHED,
    WeakContext,
    default_options,
    has_mumps,
    reason_name,
)
from patchlaw.support import Array, NotConverged


class Fast(NamedTuple):
    """When a preconditioner has no slow modes.

    Attributes:
        iterations: Iterations to `_SMALL` up to which nothing is gained by solving for any.
        ritz: Smallest Ritz value, after `_FIRST_LOOK` iterations or more, that ends the search.
    """

    iterations: int
    ritz: float


_SWEEPS, _ONE_STEP = Fast(18, 0.22), Fast(24, 0.15)
"""Of hypre's cycles, and of ours with one step of Jacobi's method by blocks. hypre's smallest Ritz
value is 0.25 to 0.45 on bodies that need up to 18 iterations, 0.15 to 0.19 on those that need 21 to
27, and at most 0.02 on rings of flat cells, which need 36 to 48 (pads, flanges, L shapes, rings;
13,000 to 236,000 unknowns). Ours is 0.22 to 0.33 up to 20 iterations, 0.15 at 22, 0.08 at 32 and at
most 0.03 on these rings (16,000 to 58,000)."""
_MOST_ITERATIONS = 60
_SMALL = 1e-8
_SLOW = 0.3
"""Eigenvalue of the preconditioned matrix below which a mode counts as slow."""
_MOST_MODES = 24
_FIRST_LOOK = 8
"""Iterations after which Ritz values are looked at first."""
_HIDDEN = 0.1
"""Part of the share 1/√n of one mode in the random residual of n unknowns. What is left of the
residual must be less: Ritz values do not show a single slow mode so soon, the residual does."""
_SAME = 1e-8
"""Share of a mode's energy below which it is a copy of another one, by rounding."""


def slow_modes(matrix: PETSc.Mat, preconditioner: PETSc.PC, fast: Fast = _SWEEPS) -> Array:
    """Return the modes of a preconditioned matrix with its smallest eigenvalues.

    Algebraic multigrid interpolates each displacement component from its own kind, and so it misses
    the rotations by which a thin or locally held body bends. A few modes then stay, whose
    eigenvalues are hundredths of the others'. They are found once, by Lanczos' method in conjugate
    gradients (Golub & Van Loan 2013, section 11.3), and solved for exactly beside every cycle
    (`Balanced`). A plate with a lining on the rim of a piston took 79 iterations to 1e-8 without
    and 26 to 31 with them, rings of flat cells 36 to 48 and 16 to 21; bodies that need up to 18
    have none.

    Args:
        matrix: Symmetric positive definite.
        preconditioner: Likewise.
        fast: When it has none.

    Returns:
        This rank's rows of the modes, shape (n, k); none where conjugate gradients are fast.

    Note:
        Collective.
    """
    residual, step = matrix.createVecs()
    rng = np.random.default_rng(matrix.comm.rank)
    residual.array[:] = rng.standard_normal(residual.local_size)
    corrected, product = residual.duplicate(), residual.duplicate()
    preconditioner.apply(residual, corrected)
    corrected.copy(step)
    energy, first, looked = residual.dot(corrected), residual.norm(), False
    basis, lengths, ratios = list[Array](), list[float](), list[float]()
    while len(basis) < _MOST_ITERATIONS and residual.norm() > _SMALL * first:
        matrix.mult(step, product)
        # on a few cells both are rounding before the residual is, and then of any sign
        if not (energy > 0.0 and (curvature := step.dot(product)) > 0.0):
            break
        basis.append(corrected.array_r / energy**0.5)
        lengths.append(energy / curvature)
        residual.axpy(-lengths[-1], product)
        preconditioner.apply(residual, corrected)
        energy, before = residual.dot(corrected), energy
        ratios.append(energy / before)
        step.aypx(ratios[-1], corrected)
        left = residual.norm() / first * residual.size**0.5
        if not looked and len(basis) >= _FIRST_LOOK and left <= _HIDDEN:
            looked = True
            if _ritz(lengths, ratios)[0][0] >= fast.ritz:
                return np.zeros((residual.local_size, 0))
    if len(basis) <= fast.iterations:
        return np.zeros((residual.local_size, 0))
    values, vectors = _ritz(lengths, ratios)
    slow = np.flatnonzero(values < _SLOW)[:_MOST_MODES]
    modes = np.zeros((residual.local_size, slow.size), order="F")
    for vector, shares in zip(basis, vectors[:, slow], strict=True):
        for k, share in enumerate(shares):
            modes[:, k] += share * vector
    return modes


def _ritz(lengths: list[float], ratios: list[float]) -> tuple[Array, Array]:
    """Return Ritz values, ascending, and their vectors by the steps of conjugate gradients.

    Args:
        lengths: Lengths of the n steps.
        ratios: Energy of each new residual over that of the one before, shape (n,).
    """
    length, ratio = np.array(lengths), np.array(ratios[:-1])
    diagonal = 1.0 / length
    diagonal[1:] += ratio / length[:-1]
    beside = -np.sqrt(ratio) / length[:-1]
    values, vectors = np.linalg.eigh(np.diag(diagonal) + np.diag(beside, 1) + np.diag(beside, -1))
    return values, vectors


class Balanced:
    """A preconditioner M beside an exact solution Q for some modes W: balancing.

    With Q = W (Wᵀ A W)⁻¹ Wᵀ it is Q + (1 − Q A) M (1 − A Q), symmetric and positive definite like
    M, and as good as M on all that is no combination of the modes (Mandel 1993, doi
    10.1002/cnm.1640090307).

    Args:
        matrix: A.
        preconditioner: M.
        modes: This rank's rows of W, shape (n, k).

    Note:
        Collective.
    """

    def __init__(self, matrix: PETSc.Mat, preconditioner: PETSc.PC, modes: Array) -> None:
        self._preconditioner, self._comm = preconditioner, matrix.comm.tompi4py()
        self._work, product = matrix.createVecs()
        self._forces = np.empty_like(modes)  # A W
        for k, mode in enumerate(modes.T):
            self._work.array[:] = mode
            matrix.mult(self._work, product)
            self._forces[:, k] = product.array_r
        self._modes = modes
        self._inverse = np.linalg.pinv(self._sum(modes.T @ self._forces), _SAME, hermitian=True)

    def apply(self, _pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write y for x; PETSc calls this."""
        shares = self._inverse @ self._sum(self._modes.T @ x.array_r)
        x.copy(self._work)
        self._work.array[:] -= self._forces @ shares
        self._preconditioner.apply(self._work, y)
        shares -= self._inverse @ self._sum(self._forces.T @ y.array_r)
        y.array[:] += self._modes @ shares

    def _sum(self, values: Array) -> Any:
        return self._comm.allreduce(values, op=MPI.SUM)


def solved_among(
    matrix: PETSc.Mat, blocks: PETSc.Mat, load: PETSc.Vec, among: PETSc.Vec, steps: int
) -> tuple[PETSc.Vec, PETSc.Vec]:
    """Solve for some unknowns while all others are zero, by few steps of conjugate gradients.

    Args:
        matrix: The matrix, symmetric and positive definite.
        blocks: The blocks of its nodes, which precondition.
        load: The right-hand side.
        among: 1 for these unknowns, 0 for others.
        steps: Number of steps; the same on any ranks.

    Returns:
        The solution, and the residual of all unknowns.

    Note:
        Collective.
    """
    nodes = PETSc.PC().create(blocks.comm)
    nodes.setType("pbjacobi")
    nodes.setOperators(blocks)
    found, left, product = load.duplicate(), load.copy(), load.duplicate()
    part, change, way = (load.duplicate() for _ in range(3))
    before = 0.0
    for step in range(steps):
        part.pointwiseMult(left, among)
        nodes.apply(part, change)
        change.pointwiseMult(change, among)
        now = change.dot(part)
        if now == 0.0:
            break
        way.aypx(now / before if step else 0.0, change)
        matrix.mult(way, product)
        length, before = now / way.dot(product), now
        found.axpy(length, way)
        left.axpy(-length, product)
    for one in (nodes, product, part, change, way):  # PETSc keeps what Python drops
        one.destroy()
    return found, left


MARGINS = (50, 200, 800, 3200)
"""Memory beyond MUMPS's estimate that is tried in turn, in percent; its own default is 20. MUMPS
estimates the memory of a front before it knows the pivots and which rank works on what. On several
ranks the same matrix fits in one run and fails in the next (error −9)."""

_MARGIN = 14  # MUMPS's ICNTL(14): memory beyond the estimate, in percent
_OUT_OF_MEMORY = (-8, -9, -14, -15, -17, -20)  # errors that its guide answers with ICNTL(14)


COARSEST = 1500
"""Number of unknowns at which coarsening ends; the coarsest grid is solved by a factorisation."""


@dataclass(frozen=True, slots=True, eq=False)
class CoarserGrid:
    """One of the coarser grids of a geometric multigrid.

    Args:
        interpolation: From this grid to the next finer one.
        matrix: The matrix on this grid.
        blocks: Its diagonal blocks, which the smoother inverts; None: the matrix has them.
        source: What the matrix takes its products from; kept as long as this.
    """

    interpolation: PETSc.Mat
    matrix: PETSc.Mat
    blocks: PETSc.Mat | None = None
    source: Any = None


class LinearSolver(PETSc.KSP):
    """PETSc's solver, with what its preconditioner needs in Python.

    Attributes:
        modes: This rank's rows of the modes that `solve_slow_modes` added; None before.
        smoothing: Eigenvalues between which a geometric multigrid smooths, over the largest; None
            of any other preconditioner. A user's options may say otherwise.
    """

    modes: Array | None = None
    smoothing: tuple[float, float] | None = None
    _grids: Sequence[CoarserGrid] = ()
    _balanced: Any = None
    _inner: PETSc.PC | None = None

    @property
    def method(self) -> str:
        """PETSc's name of the preconditioner, that beside slow modes included."""
        return str((self._inner or self.pc).getType())

    def solve_slow_modes(
        self, grid: PETSc.KSP, matrix: PETSc.Mat | None = None, modes: Array | None = None
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
        if modes is None:
            modes = slow_modes(
                matrix, inner, _ONE_STEP if grid is self and self._grids else _SWEEPS
            )
        self.modes = modes
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
        solver._grids = coarser  # PETSc keeps none of their sources
        solver.pc.setType("mg")
        solver.pc.setMGLevels(len(coarser) + 1)
        for level, grid in enumerate(reversed(coarser)):
            solver.pc.setMGInterpolation(level + 1, grid.interpolation)
            solver.pc.getMGSmoother(level).setOperators(grid.matrix, grid.blocks)
        if finest is not None:
            solver.pc.getMGSmoother(len(coarser)).setOperators(*finest)
    one_rank = {"mg_coarse_pc_telescope_reduction_factor": matrix.comm.size}
    usual = ALGEBRAIC_DEFAULTS if coarser is None else {**GEOMETRIC_DEFAULTS, **one_rank}
    usual = {**KRYLOV_DEFAULTS, **usual, **(preconditioner or {})}
    if coarser:
        _, low, _, high = map(float, str(usual[f"{SMOOTHED}esteig"]).split(","))
        solver.smoothing = low, high
    with default_options(prefix, usual):
        solver.setFromOptions()
        if made_of is not matrix and solver.pc.getType() == "hypre":
            made_of = as_hypres(made_of)  # else hypre's own copy would stand beside this one
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


def as_hypres(matrix: PETSc.Mat) -> PETSc.Mat:
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


class Factors:
    """Factors of a matrix, by MUMPS where PETSc has it, that solve for many right-hand sides.

    Args:
        matrix: The matrix.
        symmetric: Whether it is symmetric.

    Raises:
        NotConverged: When the factorisation fails.

    Note:
        Everything is collective.
    """

    def __init__(self, matrix: PETSc.Mat, *, symmetric: bool = True) -> None:
        self._matrix, self._solver = pointwise(matrix), PETSc.KSP().create(matrix.comm)
        self._own = () if self._matrix is matrix else (self._matrix,)
        self._solver.setOperators(self._matrix)
        self._solver.setType("preonly")
        self._solver.pc.setType("cholesky" if symmetric else "lu")
        if has_mumps():
            self._solver.pc.setFactorSolverType("mumps")
        set_up(self._solver)

    def __call__(self, right: Array) -> Array:
        """Return the solutions for this rank's rows of right-hand sides, shape (n, m)."""
        arrays = np.asfortranarray(right), np.zeros(right.shape, order="F")
        size = (len(right), self._matrix.getSize()[0]), (None, right.shape[1])
        dense = [PETSc.Mat().createDense(size, array=a, comm=self._matrix.comm) for a in arrays]
        self._solver.pc.getFactorMatrix().matSolve(*dense)
        for one in dense:  # PETSc keeps objects that Python drops
            one.destroy()
        return arrays[1]

    def destroy(self) -> None:
        """Let go of the factors."""
        for part in (self._solver.pc, self._solver, *self._own):
            part.destroy()


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
