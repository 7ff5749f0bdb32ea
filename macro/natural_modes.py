"""Natural frequencies and modes of elastic bodies about a loaded state, by SLEPc.

Theory: section 18 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import scipy.linalg
from petsc4py import PETSc

from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.node_matrices import free_unknowns
from patchlaw.macro.linear_solvers.options import WeakContext, has_mumps
from patchlaw.support.arguments import Count, Has, checked
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError, NotConverged
from patchlaw.support.parallel import on_root

_SHIFT = 1e-8
"""Shift below zero over the largest eigenvalue of single unknowns, by which the matrix of a free
body has an inverse; bodies of 100 cells have their first mode at 1e-4."""
_ROUNDING = 1e-12
"""Eigenvalues over that largest one which are zeros, and skew over symmetric parts that are."""
_TOLERANCE, _RESIDUAL = 1e-10, 1e-8
"""Change of eigenvalues, and residual of unsymmetric problems, at which iterations end."""
_FEWEST, _MOST, _ROUNDS = 30, 100, 5
"""Real modes that an unsymmetric problem is projected on, and corrections of them at most."""
_SOLVED = 1e-12
"""Relative residual of linear solves by iterations."""

Matrix = Annotated[Any, Has("an assembled matrix of PETSc", ("getDiagonal", "createVecRight"))]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NaturalModes:
    """Free vibrations φ exp(λ t) of K u + M ü = 0, by rising frequency.

    Attributes:
        eigenvalues: λ with an imaginary part not below zero, shape (n,) [1/s].
        shapes: Rows φ of this rank, with φᴴ M φ = 1, shape (m, n); real where K is symmetric.
        momenta: M φ likewise.
        residuals: |K φ + λ² M φ| / (|K φ| + |λ² M φ|) of the full problem, shape (n,).
    """

    eigenvalues: Array
    shapes: Array
    momenta: Array
    residuals: Array

    @property
    def frequencies(self) -> Array:
        """Im λ / 2π, shape (n,) [Hz] where K is in N/mm and M in t; 0 of rigid motions."""
        return np.asarray(self.eigenvalues.imag / (2.0 * np.pi))

    @property
    def damping(self) -> Array:
        """−Re λ, shape (n,) [1/s]; below zero where the vibration grows."""
        return np.asarray(0.0 - self.eigenvalues.real)


@checked
def natural_modes(
    stiffness: Matrix,
    mass: Matrix,
    count: Count,
    *,
    bcs: Sequence[compat.Condition] = (),
    preconditioner: Any = None,
) -> NaturalModes:
    """Return the lowest natural modes of K φ = −λ² M φ.

    Real modes come from shift and invert just below zero. Where K is not symmetric, as with
    `Interface.stiffness_matrix` of a face that slides, K is projected on real modes of its
    symmetric part, 30 to 100 of them, which are corrected by K's residuals; two modes that have
    merged are a pair, one of which grows.

    Args:
        stiffness: K, assembled [N/mm].
        mass: M, symmetric, assembled [t].
        count: Number of modes.
        bcs: Dirichlet conditions; rows and columns that they constrain count in neither matrix,
            whatever stands there.
        preconditioner: Has ``apply`` as PETSc's contexts do, near the inverse of the symmetric part
            of K; solves are then those of conjugate gradients. None: a factorisation, by MUMPS
            where PETSc has it.

    Raises:
        InputError: When there are not as many modes.
        NotConverged: When the iteration fails.

    Note:
        Collective.
    """
    free = free_unknowns(bcs, stiffness.createVecRight())
    compat.collect_garbage(free.comm)
    problem = _Problem(stiffness, mass, free, preconditioner)
    unknowns = int(round(free.sum()))
    if count > unknowns:
        allowed = f"up to {unknowns}, the free unknowns"
        raise InputError("there are not as many modes", value=count, allowed=allowed)
    wanted = count if problem.symmetric else min(max(_FEWEST, 3 * count), _MOST, unknowns)
    found = problem.projected(problem.real_modes(wanted), count)
    for _ in range(0 if problem.symmetric else _ROUNDS):
        if found.residuals.max() <= _RESIDUAL:
            break
        found = problem.projected(problem.corrected(found), count)
    return found


class _Problem:
    """K, its symmetric part, and M, without what is held."""

    def __init__(
        self, stiffness: PETSc.Mat, mass: PETSc.Mat, free: PETSc.Vec, preconditioner: Any
    ) -> None:
        self.comm, self.preconditioner = free.comm.tompi4py(), preconditioner
        self.whole, self.mass = (_within(one, free) for one in (stiffness, mass))
        weight, own = self.mass.getDiagonal().array_r, free.array_r > 0.0
        ratios = self.whole.getDiagonal().array_r[own] / np.where(weight > 0.0, weight, np.inf)[own]
        self.largest = float(max(self.comm.allgather(float(ratios.max(initial=0.0)))))
        if not self.largest > 0.0:
            raise InputError("the stiffness has no positive diagonal, or the mass has none")
        diagonal = self.whole.getDiagonal()  # what is held is stiff, and has no mass
        diagonal.array[~own] = max(self.comm.allgather(float(diagonal.array_r.max(initial=0.0))))
        self.whole.setDiagonal(diagonal)
        skew = self.whole.transpose(PETSc.Mat())
        skew.axpy(-1.0, self.whole, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        self.symmetric = bool(skew.norm() <= _ROUNDING * self.whole.norm())
        self.even = self.whole
        if not self.symmetric:
            self.even = self.whole.copy()
            self.even.axpy(0.5, skew, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        skew.destroy()
        self.basis = np.zeros((free.local_size, 0))

    def real_modes(self, count: int) -> Array:
        """Return this rank's rows of real modes of the symmetric part."""
        from slepc4py import SLEPc

        solver = self._solver = SLEPc.EPS().create(self.even.comm)
        solver.setOperators(self.even, self.mass)
        solver.setProblemType(SLEPc.EPS.ProblemType.GHEP)
        solver.setDimensions(count)
        solver.setTolerances(_TOLERANCE, 1000)
        solver.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
        solver.setTarget(-_SHIFT * self.largest)
        transform = solver.getST()
        transform.setType("sinvert")
        self._linear = linear = transform.getKSP()
        if self.preconditioner is None:
            linear.setType("preonly")
            linear.pc.setType("cholesky")
            if has_mumps():
                linear.pc.setFactorSolverType("mumps")
        else:
            linear.setType("cg")
            linear.setTolerances(rtol=_SOLVED)
            linear.pc.setType("python")
            linear.pc.setPythonContext(WeakContext(self.preconditioner))
        with compat.errors_of_callbacks():
            solver.solve()
        if solver.getConverged() < count:
            raise NotConverged(
                "the natural modes",
                reason=f"{solver.getConverged()} of {count} modes",
                iterations=solver.getIterationNumber(),
                remedy="ask for fewer modes; see that supports and masses are those of the body",
            )
        vector, rows = self.even.createVecRight(), []
        for k in range(count):
            solver.getEigenvector(k, vector)
            rows.append(vector.array_r.copy())
        return np.array(rows).T

    def projected(self, more: Array, count: int) -> NaturalModes:
        """Return the modes among combinations of the known vectors and more of them."""
        for _ in range(2):  # once loses digits where more are near the known ones
            more = more - self.basis @ self._sums(self.basis.T @ self._product(self.mass, more))
            gram = self._sums(more.T @ self._product(self.mass, more))
            size, turn = on_root(self.comm, lambda gram=gram: np.linalg.eigh(gram))
            kept = size > 1e-20 + _ROUNDING * size[-1]
            more = more @ (turn[:, kept] / np.sqrt(size[kept]))
        basis = self.basis = np.column_stack([self.basis, more])
        forces, momenta = self._product(self.whole, basis), self._product(self.mass, basis)
        reduced = self._sums(basis.T @ forces), self._sums(basis.T @ momenta)
        values, y = on_root(self.comm, lambda: self._small_modes(*reduced, count))
        forces, momenta = forces @ y, momenta @ y
        self._residual = forces + values**2 * momenta
        left, *right = (
            np.sqrt(self._sums((abs(one) ** 2).sum(axis=0)))
            for one in (self._residual, forces, abs(values) ** 2 * momenta)
        )
        none = _SHIFT * self.largest * np.sqrt(self._sums((abs(momenta) ** 2).sum(axis=0)))
        return NaturalModes(
            eigenvalues=values,
            shapes=basis @ y,
            momenta=momenta,
            residuals=left / (right[0] + right[1] + none),
        )

    def _small_modes(self, stiffness: Array, mass: Array, count: int) -> tuple[Array, Array]:
        """Return λ and the parts of the basis in the lowest modes."""
        if self.symmetric:
            squares, y = scipy.linalg.eigh(0.5 * (stiffness + stiffness.T), mass)
        else:
            squares, y = scipy.linalg.eig(stiffness, mass)
            y = y / np.sqrt(np.einsum("ki,kl,li->i", y.conj(), mass, y).real)
        # of a pair that has merged one grows; real ones below zero leave without vibrating
        squares = np.where(abs(squares) > _ROUNDING * self.largest, squares, 0.0)
        values = np.sqrt(-squares.astype(complex))
        values = np.where(values.imag < 0.0, -values, values) + 0.0
        order = np.lexsort((-values.real, np.round(values.imag, 6)))[:count]
        return values[order], y[:, order]

    def corrected(self, found: NaturalModes) -> Array:
        """Return what the linear solver gives for the residuals, real and imaginary parts."""
        poor = found.residuals > _RESIDUAL
        loads = np.column_stack([self._residual[:, poor].real, self._residual[:, poor].imag])
        load, solution = self.even.createVecs()
        rows = []
        for column in loads.T:
            load.array[:] = column
            self._linear.solve(load, solution)
            size = np.sqrt(self._sums(solution.array_r @ solution.array_r))
            rows.append(solution.array_r / (size or 1.0))
        return np.array(rows).T

    def _product(self, matrix: PETSc.Mat, columns: Array) -> Array:
        given, result = matrix.createVecs()
        product = np.empty_like(columns)
        for k, column in enumerate(columns.T):
            given.array[:] = column
            matrix.mult(given, result)
            product[:, k] = result.array_r
        return product

    def _sums(self, values: Any) -> Any:
        return self.comm.allreduce(values)


def _within(matrix: PETSc.Mat, free: PETSc.Vec) -> PETSc.Mat:
    """Return a copy of type ``aij`` with rows and columns of free unknowns alone."""
    copied = matrix.convert("aij", PETSc.Mat())
    copied.diagonalScale(free, free)
    return copied
