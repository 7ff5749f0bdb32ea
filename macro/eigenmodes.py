"""Natural frequencies and modes of elastic bodies about a loaded state.

Theory: section 17 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from petsc4py import PETSc
from scipy.linalg import eigh

from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.eigenpairs import images, lowest_eigenpairs
from patchlaw.macro.linear_solvers.node_matrices import free_unknowns
from patchlaw.macro.linear_solvers.options import has_mumps
from patchlaw.support.arguments import Count, Has, checked
from patchlaw.support.arrays import Array
from patchlaw.support.errors import InputError, NotConverged
from patchlaw.support.packages import optional_packages

_SHIFT = 1e-8
"""Shift below zero over the largest eigenvalue of single unknowns, by which the matrix of a free
body has an inverse; bodies of 100 cells have their first mode at 1e-4."""
_ROUNDING = 1e-12
"""Eigenvalues over that largest one which are zeros, and skew over symmetric parts that are."""
_TOLERANCE = 1e-10
"""Error of eigenvalues at which SLEPc's iteration ends."""
_LARGEST_RESIDUAL = 1e-5
"""Beyond it modes are refused; they have 1e-8 and less where everything is as it should be."""

Matrix = Annotated[Any, Has("an assembled matrix of PETSc", ("getDiagonal", "createVecRight"))]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NaturalModes:
    """Free vibrations φ exp(λ t) of K u + M ü = 0, by rising frequency.

    Attributes:
        eigenvalues: λ with an imaginary part not below zero, shape (n,) [1/s].
        shapes: This rank's rows of φ, with φᴴ M φ = 1, shape (m, n).
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
    preconditioner: Annotated[Any, Has("a context with apply", ("apply",))] | None = None,
) -> NaturalModes:
    """Return the lowest natural modes of K φ = −λ² M φ.

    Where K is not symmetric, as with `Interface.stiffness_matrix` of a face that slides, two modes
    that have merged are a pair of one frequency, of which one grows and one decays.

    Args:
        stiffness: K, assembled [N/mm].
        mass: M, symmetric, assembled [t].
        count: Number of modes; of a pair that the last one belongs to both come back.
        bcs: Dirichlet conditions; rows and columns that they constrain count in neither matrix,
            whatever stands there.
        preconditioner: Has ``apply`` as PETSc's contexts do, near the inverse of K; nothing is
            factorised then. None: a factorisation, by MUMPS where PETSc has it.

    Raises:
        InputError: When there are not as many modes; for matrices of two sizes, and a mass that
            is not symmetric or has no positive diagonal.
        NotConverged: When the iteration fails.

    Note:
        Collective.
    """
    free = free_unknowns(bcs, stiffness.createVecRight())
    return modes_of(stiffness, mass, free, count, preconditioner)


def modes_of(
    stiffness: PETSc.Mat, mass: PETSc.Mat, free: PETSc.Vec, count: int, preconditioner: Any = None
) -> NaturalModes:
    """Return natural modes with the unknowns that are free marked by 1; see `natural_modes`."""
    compat.collect_garbage(free.comm)
    unknowns = round(free.sum())
    if count > unknowns:
        allowed = f"up to {unknowns}, the free unknowns"
        raise InputError("there are not as many modes", value=count, allowed=allowed)
    problem = _Problem(stiffness, mass, free)
    start = None
    if preconditioner is None:
        preconditioner = _ShiftInvert(problem, count)
        start = preconditioner.found()
    matrices = problem.stiffness, problem.mass, free
    modes = problem.stated(
        *lowest_eigenpairs(*matrices, count, preconditioner, problem.symmetric, start)
    )
    left = modes.residuals[modes.eigenvalues != 0.0].max(initial=0.0)
    if not left < _LARGEST_RESIDUAL:
        raise NotConverged(
            "the natural modes",
            reason=f"a residual of {left:.1e}",
            iterations=0,
            remedy="see that supports and masses are those of the body, and the preconditioner",
        )
    return modes


class _Problem:
    """K and M, without what is held."""

    def __init__(self, stiffness: PETSc.Mat, mass: PETSc.Mat, free: PETSc.Vec) -> None:
        self._comm, own = free.comm.tompi4py(), free.array_r > 0.0
        both = stiffness, mass
        if any(one.getSizes() != stiffness.getSizes() or not one.isAssembled() for one in both):
            raise InputError("stiffness and mass are not of one size, or not assembled")
        self.stiffness, self.mass = (one.convert("aij", PETSc.Mat()) for one in both)
        for one in (self.stiffness, self.mass):
            one.diagonalScale(free, free)
        diagonal, weight = self.stiffness.getDiagonal(), self.mass.getDiagonal().array_r[own]
        ratios = diagonal.array_r[own] / np.where(weight > 0.0, weight, np.inf)
        self.largest = self._largest(ratios)
        if not self.largest > 0.0:
            raise InputError("the stiffness has no positive diagonal, or the mass has none")
        diagonal.array[~own] = self._largest(diagonal.array_r)  # what is held has no mass
        self.stiffness.setDiagonal(diagonal)
        self.symmetric = _is_symmetric(self.stiffness)
        if not _is_symmetric(self.mass):
            raise InputError("the mass is not symmetric")

    def stated(self, squares: Array, shapes: Array) -> NaturalModes:
        """Return the modes of κ and φ, with what is left of K φ + λ² M φ."""
        add, pair = self._comm.allreduce, (self.stiffness, self.mass)
        forces, momenta = (images(one, shapes.real) + 1j * images(one, shapes.imag) for one in pair)
        if self.symmetric:  # anew, as factors exaggerate rigid motions, at the cost of digits
            squares, turned = eigh(*(add((shapes.T @ one).real) for one in (forces, momenta)))
            shapes, forces, momenta = (one @ turned for one in (shapes, forces, momenta))
        # λ² = −κ: of a merged pair one grows, and what is negative leaves without vibrating
        squares = np.where(abs(squares) > _ROUNDING * self.largest, squares, 0.0)
        values = np.sqrt(-squares + 0j)
        values = np.where(values.imag < 0.0, -values, values) + 0.0
        order = np.lexsort((-values.real, values.imag))
        size = np.sqrt(add((shapes.conj() * momenta).sum(axis=0).real))
        values = values[order]
        shapes, forces, momenta = ((one / size)[:, order] for one in (shapes, forces, momenta))
        least = _SHIFT * self.largest  # rigid motions have no forces
        left, of_body, of_mass, unit = (
            np.sqrt(add((abs(one) ** 2).sum(axis=0)))
            for one in (forces + values**2 * momenta, forces, values**2 * momenta, momenta)
        )
        residuals = left / (of_body + of_mass + least * unit)
        return NaturalModes(eigenvalues=values, shapes=shapes, momenta=momenta, residuals=residuals)

    def _largest(self, values: Array) -> float:
        return float(max(self._comm.allgather(float(values.max(initial=0.0)))))


class _ShiftInvert:
    """SLEPc's Krylov-Schur method on factors of K + c M with a small c.

    It takes a third of the solves of `lowest_eigenpairs`, but starts from one vector, which may
    leave out some of the modes that are repeated.
    """

    def __init__(self, problem: _Problem, count: int) -> None:
        with optional_packages():
            from slepc4py import SLEPc

        kinds = SLEPc.EPS.ProblemType
        self._solver = solver = SLEPc.EPS().create(problem.stiffness.comm)
        solver.setOperators(problem.stiffness, problem.mass)
        solver.setProblemType(kinds.GHEP if problem.symmetric else kinds.GNHEP)
        solver.setDimensions(count)
        solver.setTolerances(_TOLERANCE, 1000)
        solver.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
        solver.setTarget(-_SHIFT * problem.largest)
        solver.getST().setType("sinvert")
        self._linear = linear = solver.getST().getKSP()
        linear.setType("preonly")
        linear.pc.setType("cholesky" if problem.symmetric else "lu")
        if has_mumps():
            linear.pc.setFactorSolverType("mumps")
        self._vectors = problem.stiffness.createVecs()

    def found(self) -> Array:
        """Return the modes found, of pairs the real and the imaginary part, shape (m, k)."""
        try:
            self._solver.solve()
        except PETSc.Error as error:  # of a factorisation: memory, or a matrix that has no inverse
            raise NotConverged(
                "the natural modes",
                reason=str(error).splitlines()[-1],
                iterations=0,
                remedy="see that supports and masses are those of the body",
            ) from None
        columns, (real, imaginary) = [np.zeros((self._vectors[0].local_size, 0))], self._vectors
        for k in range(self._solver.getConverged()):
            value = self._solver.getEigenpair(k, real, imaginary)
            parts = real.array_r, imaginary.array_r
            if value.imag >= 0.0:  # else the second of a pair
                columns.append(np.stack(parts[: 1 + int(value.imag > 0.0)], axis=1))
        return np.hstack(columns)

    def apply(self, _owner: Any, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the solution y for x."""
        self._linear.solve(x, y)


def _is_symmetric(matrix: PETSc.Mat) -> bool:
    skew = matrix.transpose(PETSc.Mat())
    skew.axpy(-1.0, matrix, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    size = skew.norm()
    skew.destroy()
    return bool(size <= _ROUNDING * matrix.norm())
