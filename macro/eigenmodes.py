"""Natural frequencies and modes of elastic bodies about a loaded state, by SLEPc.

Theory: section 17 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from petsc4py import PETSc

from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.eigenpairs import lowest_eigenpairs
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
        InputError: When there are not as many modes.
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
    if preconditioner is None:
        squares, shapes = problem.solved(count)
    else:
        pencil = problem.stiffness, problem.mass, free
        squares, shapes = lowest_eigenpairs(
            *pencil, count, preconditioner, symmetric=problem.symmetric
        )
    # λ² = −κ: of a pair that has merged one grows, and what is negative leaves without vibrating
    squares = np.where(abs(squares) > _ROUNDING * problem.largest, squares, 0.0)
    values = np.sqrt(-squares)
    values = np.where(values.imag < 0.0, -values, values) + 0.0
    order = np.lexsort((-values.real, values.imag))
    return problem.stated(values[order], shapes[:, order])


class _Problem:
    """K and M, without what is held."""

    def __init__(self, stiffness: PETSc.Mat, mass: PETSc.Mat, free: PETSc.Vec) -> None:
        self._comm, own = free.comm.tompi4py(), free.array_r > 0.0
        self.stiffness, self.mass = (one.convert("aij", PETSc.Mat()) for one in (stiffness, mass))
        for one in (self.stiffness, self.mass):
            one.diagonalScale(free, free)
        diagonal, weight = self.stiffness.getDiagonal(), self.mass.getDiagonal().array_r[own]
        ratios = diagonal.array_r[own] / np.where(weight > 0.0, weight, np.inf)
        self.largest = self._largest(ratios)
        if not self.largest > 0.0:
            raise InputError("the stiffness has no positive diagonal, or the mass has none")
        diagonal.array[~own] = self._largest(diagonal.array_r)  # what is held has no mass
        self.stiffness.setDiagonal(diagonal)
        skew = self.stiffness.transpose(PETSc.Mat())
        skew.axpy(-1.0, self.stiffness, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        self.symmetric = bool(skew.norm() <= _ROUNDING * self.stiffness.norm())
        skew.destroy()

    def solved(self, count: int) -> tuple[Array, Array]:
        """Return κ of K φ = κ M φ, shape (n,), and this rank's rows of φ, (m, n)."""
        with optional_packages():
            from slepc4py import SLEPc

        kinds, which = SLEPc.EPS.ProblemType, SLEPc.EPS.Which.TARGET_MAGNITUDE
        solver = SLEPc.EPS().create(self.stiffness.comm)
        solver.setOperators(self.stiffness, self.mass)
        solver.setProblemType(kinds.GHEP if self.symmetric else kinds.GNHEP)
        solver.setDimensions(count)
        solver.setTolerances(_TOLERANCE, 1000)
        solver.setWhichEigenpairs(which)
        solver.setTarget(-_SHIFT * self.largest)
        solver.getST().setType("sinvert")
        linear = solver.getST().getKSP()
        linear.setType("preonly")
        linear.pc.setType("cholesky" if self.symmetric else "lu")
        if has_mumps():
            linear.pc.setFactorSolverType("mumps")
        problem = ""
        try:
            with compat.errors_of_callbacks():
                solver.solve()
        except PETSc.Error as error:  # of a linear solver: memory, or a matrix that has no inverse
            problem = str(error).splitlines()[-1]
        if problem or solver.getConverged() < count:
            raise NotConverged(
                "the natural modes",
                reason=problem or f"{solver.getConverged()} of {count} modes",
                iterations=solver.getIterationNumber(),
                remedy="ask for fewer modes; see that supports and masses are those of the body",
            )
        real, imaginary = self.stiffness.createVecs()
        values, shapes = list[complex](), list[Array]()
        while len(values) < count or values[-1].imag > 0.0:  # the first of a pair
            values.append(complex(solver.getEigenpair(len(values), real, imaginary)))
            shapes.append(real.array_r + 1j * imaginary.array_r)
        solver.destroy()
        return np.array(values), np.array(shapes).T

    def stated(self, values: Array, shapes: Array) -> NaturalModes:
        """Return modes with what is left of K φ + λ² M φ."""
        forces, momenta = (self._product(one, shapes) for one in (self.stiffness, self.mass))
        size = np.sqrt(self._sums(shapes.conj() * momenta))
        forces, momenta = forces / size, momenta / size
        least = _SHIFT * self.largest  # rigid motions have no forces
        left, of_body, of_mass, unit = (
            np.sqrt(self._sums(abs(one) ** 2))
            for one in (forces + values**2 * momenta, forces, values**2 * momenta, momenta)
        )
        return NaturalModes(
            eigenvalues=values,
            shapes=shapes / size,
            momenta=momenta,
            residuals=left / (of_body + of_mass + least * unit),
        )

    def _product(self, matrix: PETSc.Mat, columns: Array) -> Array:
        given, result = matrix.createVecs()
        product = np.empty_like(columns)
        for k, column in enumerate(columns.T):
            for part, unit in ((column.real, 1.0), (column.imag, 1j)):
                given.array[:] = part
                matrix.mult(given, result)
                product[:, k] = (0.0 if unit == 1.0 else product[:, k]) + unit * result.array_r
        return product

    def _sums(self, columns: Array) -> Array:
        return np.asarray(self._comm.allreduce(columns.sum(axis=0).real))

    def _largest(self, values: Array) -> float:
        return float(max(self._comm.allgather(float(values.max(initial=0.0)))))
