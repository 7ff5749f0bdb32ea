"""Natural frequencies and modes of elastic bodies about a loaded state.

Theory: section 17 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from petsc4py import PETSc
from scipy.linalg import eigh

from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.node_matrices import free_unknowns
from patchlaw.macro.linear_solvers.options import has_mumps
from patchlaw.support.arguments import Count, Has, checked
from patchlaw.support.arrays import Array, Indices
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
_ACCURATE, _NEXT = 1e-10, 1e-6
"""Largest correction of a mode at which it is accurate, relative to the mode, in the norm of M, and
of the mode beyond the wanted ones. With 1e-8 residuals of tetrahedra were 1e-6, for a fifth fewer
cycles of multigrid."""
_NOISE = 1e-14
"""Residual over the forces of single nodes that is rounding: no correction makes it smaller."""
_BESIDE = 8
"""Modes beyond the wanted ones that are kept, so that the last of these do not converge slowly."""
_ROOM = 5
"""Vectors that are kept over those of a step: 4 took a fifth more cycles on a cube, and 6 saved a
twentieth."""
_MOST_STEPS = 300
_NEW, _COPY = 0.5, 1e-10
"""Part of a vector that a second orthogonalisation leaves: less is rounding. Share of one, squared,
among new ones that counts as a combination of the others."""

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
    stiffness: PETSc.Mat,
    mass: PETSc.Mat,
    free: PETSc.Vec,
    count: int,
    preconditioner: Any = None,
    start: Array | None = None,
) -> NaturalModes:
    """Return natural modes; see `natural_modes`.

    Args:
        stiffness: K.
        mass: M.
        free: 1 for unknowns that are free, 0 for others.
        count: Number of modes.
        preconditioner: As there.
        start: Vectors near the modes, as those of another load, shape (m, k); None: not known.
    """
    compat.collect_garbage(free.comm)
    unknowns = round(free.sum())
    if count > unknowns:
        allowed = f"up to {unknowns}, the free unknowns"
        raise InputError("there are not as many modes", value=count, allowed=allowed)
    problem = _Problem(stiffness, mass, free)
    if preconditioner is None:
        preconditioner = _ShiftInvert(problem, count)
        start = preconditioner.found()[:, :count]  # others may come after one that is left out
    matrices = problem.stiffness, problem.mass, free
    modes = problem.stated(
        *_lowest_eigenpairs(*matrices, count, preconditioner, problem.symmetric, start)
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

    It takes a third of the solves of `_lowest_eigenpairs`, but starts from one vector, which may
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


def images(
    matrix: PETSc.Mat,
    columns: Array,
    function: Callable[[PETSc.Vec, PETSc.Vec], None] | None = None,
) -> Array:
    """Return the products of a matrix with this rank's rows of some vectors, shape (n, k).

    Args:
        matrix: The matrix.
        columns: The vectors, shape (n, k).
        function: Writes what is asked for instead of the product into its second vector.

    Note:
        Collective.
    """
    x, y = matrix.createVecs()
    result = np.empty_like(columns, order="F")  # copies of columns are a tenth of a product else
    for k, column in enumerate(columns.T):
        x.array[:] = column
        (function or matrix.mult)(x, y)
        result[:, k] = y.array_r
    return result


class _Span:
    """Vectors V with Vᵀ M V = 1, this rank's rows, with M V and K V, and Vᵀ K V of all ranks.

    Args:
        stiffness: K.
        mass: M.
    """

    def __init__(self, stiffness: PETSc.Mat, mass: PETSc.Mat) -> None:
        self._stiffness, self._mass = stiffness, mass
        self._add = stiffness.comm.tompi4py().allreduce
        self._diagonal = stiffness.getDiagonal().array_r[:, None]
        self.vectors = self._momenta = self._forces = np.zeros((len(self._diagonal), 0))
        self.small: Array = np.zeros((0, 0))

    def beside(self, columns: Array) -> tuple[Array, Array, Array]:
        """Return columns less their part in the span, M times these, and their sizes by M."""
        columns = columns - self.vectors @ self._add(self._momenta.T @ columns)
        momenta = images(self._mass, columns)
        return columns, momenta, np.sqrt(self._add((columns * momenta).sum(axis=0)))

    def extend(self, new: Array, momenta: Array, sizes: Array) -> None:
        """Take what `beside` returned, as far as that is not rounding."""
        new, momenta = new / sizes, momenta / sizes
        shared = self._add(self._momenta.T @ new)  # once more: what is left of one may be small
        new, momenta = new - self.vectors @ shared, momenta - self._momenta @ shared
        apart = self._add((new * momenta).sum(axis=0)) > _NEW**2
        new, momenta = new[:, apart], momenta[:, apart]
        if not new.shape[1]:
            return
        weights, turned = np.linalg.eigh(self._add(new.T @ momenta))
        apart = weights > _COPY * weights[-1]
        turned = turned[:, apart] / np.sqrt(weights[apart])
        new, momenta = new @ turned, momenta @ turned
        forces, below = images(self._stiffness, new), self._add(new.T @ self._forces)
        self.vectors = np.hstack([self.vectors, new])
        self._momenta = np.hstack([self._momenta, momenta])
        self._forces = np.hstack([self._forces, forces])
        self.small = np.hstack([np.vstack([self.small, below]), self._add(self.vectors.T @ forces)])

    def restart(self, shares: Array) -> None:
        """Keep some orthonormal combinations of the vectors alone."""
        self.vectors, self._momenta, self._forces = (
            part @ shares for part in (self.vectors, self._momenta, self._forces)
        )
        self.small = shares.T @ self.small @ shares

    def modes(self, symmetric: bool) -> tuple[Any, Any]:
        """Return κ of K φ = κ M φ in the span by rising magnitude, and the shares of the vectors.

        Of a pair both stand together.
        """
        values, shares = (
            np.linalg.eigh(0.5 * (self.small + self.small.T))
            if symmetric
            else np.linalg.eig(self.small)
        )
        order = np.argsort(abs(values), kind="stable")
        return values[order], shares[:, order]

    def residuals(self, shares: Array, chosen: Indices) -> tuple[Array, Array]:
        """Return what modes leave of their equations, and whether it is more than rounding.

        Args:
            shares: Of a pair the real and the imaginary part of the first, which span what both do.
            chosen: The modes that are asked for.
        """
        along = np.linalg.lstsq(shares, self.small @ shares, rcond=None)[0][:, chosen]
        mine = shares[:, chosen]
        left = self._forces @ mine - self._momenta @ (shares @ along)
        sizes = [left, self._diagonal * (self.vectors @ mine)]
        rest, largest = np.sqrt([self._add((one**2).sum(axis=0)) for one in sizes])
        return left, rest > _NOISE * largest


def _lowest_eigenpairs(
    stiffness: PETSc.Mat,
    mass: PETSc.Mat,
    free: PETSc.Vec,
    count: int,
    preconditioner: Any,
    symmetric: bool,
    start: Array | None = None,
) -> tuple[Array, Array]:
    """Return κ of K φ = κ M φ next to zero, by Davidson's method in blocks.

    Modes are those of K and M in the span of some vectors. Preconditioned residuals of the modes
    that are not accurate extend it, and it restarts from the latest modes and those of the step
    before, as conjugate gradients do (Stathopoulos & Saad 1998, ETNA 7, 163-181). A
    residual costs one cycle of multigrid; a linear solve costs some twenty. Modes that are repeated
    are found as often as they are, as no single vector leads to them. The mode beyond the wanted
    ones is found roughly, too: one that the first vectors leave out is the lowest of all others.
    All vectors are real, also where K has complex pairs.

    Args:
        stiffness: K, rows and columns of what is held apart.
        mass: M, symmetric, zero where it is held.
        free: 1 for what is free, 0 for what is held.
        count: Number of modes; of a pair that the last one belongs to both come back.
        preconditioner: Has ``apply``.
        symmetric: Whether K is.
        start: Vectors that come first, random ones beside them, shape (m, k); None: random ones.

    Returns:
        κ by rising magnitude, shape (n,), and this rank's rows of φ, complex, shape (m, n).

    Raises:
        NotConverged: After 300 steps.

    Note:
        Collective.
    """
    block, own = count + _BESIDE, free.array_r[:, None] > 0.0
    span, errors, past = _Span(stiffness, mass), np.ones(0), np.zeros((0, 0))

    def corrected(columns: Array) -> Array:
        with compat.errors_of_callbacks():
            return own * images(stiffness, columns, lambda x, y: preconditioner.apply(None, x, y))

    first = np.zeros((len(own), 0)) if start is None else own * start
    width = max(_BESIDE, block - first.shape[1])
    random = np.random.default_rng(free.comm.rank).standard_normal((len(own), width))
    new, momenta, sizes = span.beside(np.hstack([first, corrected(own * random)]))
    if not (sizes > 0.0).all():
        raise NotConverged(
            "the natural modes",
            reason="the preconditioner returns zeros, or what is no number",
            iterations=0,
            remedy="see that it is near the inverse of the stiffness",
        )
    for _ in range(_MOST_STEPS):
        span.extend(new, momenta, sizes)
        values, shares = span.modes(symmetric)
        wanted, kept = (
            end + int(values[end - 1].imag > 0.0)
            for end in (min(size, len(values)) for size in (count, block))
        )
        real = np.where(values.imag < 0.0, shares.imag, shares.real)[:, :kept]
        limits = np.where(np.arange(min(wanted + 1, kept)) < wanted, _ACCURATE, _NEXT)
        if len(errors) != len(limits) or (errors < limits).all():
            errors = np.ones(len(limits))  # once more of all: modes may have changed places
        asked = np.flatnonzero(errors >= limits)
        left, is_some = span.residuals(real, asked)
        new, momenta, sizes = span.beside(corrected(left))  # in the span modes are the best ones
        errors[asked] = np.where(is_some, sizes, 0.0)
        converged = len(asked) == len(limits) and (errors < limits).all()
        if converged or span.vectors.shape[1] == round(free.sum()):
            shares, basis = shares[:, :wanted], span.vectors
            return values[:wanted] + 0j, basis @ shares.real + 1j * (basis @ shares.imag)
        more = (errors >= limits)[asked]
        new, momenta, sizes = new[:, more], momenta[:, more], sizes[more]
        if span.vectors.shape[1] + new.shape[1] > _ROOM * block:
            before = np.pad(past, ((0, len(real) - len(past)), (0, 0)))
            both, triangle = np.linalg.qr(np.hstack([real, before]))
            both = both[:, abs(np.diag(triangle)) > _COPY]
            span.restart(both)
            real = both.T @ real
        past = real
    raise NotConverged(
        "the natural modes",
        reason=f"{int((errors[:count] < _ACCURATE).sum())} of {count} modes",
        iterations=_MOST_STEPS,
        remedy="ask for fewer modes; see that supports and masses are those of the body",
    )


def _is_symmetric(matrix: PETSc.Mat) -> bool:
    skew = matrix.transpose(PETSc.Mat())
    skew.axpy(-1.0, matrix, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    size = skew.norm()
    skew.destroy()
    return bool(size <= _ROUNDING * matrix.norm())
