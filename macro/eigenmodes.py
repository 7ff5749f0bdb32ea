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
from patchlaw.macro.linear_solvers.many_vectors import Corrections, one_by_one, products
from patchlaw.macro.linear_solvers.node_matrices import free_unknowns
from patchlaw.macro.linear_solvers.options import has_mumps
from patchlaw.support import Array, Count, Flags, Has, Indices, InputError, NotConverged, checked
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
    correct = None
    if preconditioner is not None:
        correct = one_by_one(stiffness, lambda x, y: preconditioner.apply(None, x, y))
    return modes_of(stiffness, mass, free, count, correct)


def modes_of(
    stiffness: PETSc.Mat,
    mass: PETSc.Mat,
    free: PETSc.Vec,
    count: int,
    correct: Corrections | None = None,
    start: Array | None = None,
) -> NaturalModes:
    """Return natural modes; see `natural_modes`.

    Args:
        stiffness: K.
        mass: M.
        free: 1 for unknowns that are free, 0 for others.
        count: Number of modes.
        correct: The preconditioner, for many vectors; None: a factorisation.
        start: Vectors near the modes, as those of another load, shape (m, k); None: not known.
    """
    compat.collect_garbage(free.comm)
    unknowns = round(free.sum())
    if count > unknowns:
        allowed = f"up to {unknowns}, the free unknowns"
        raise InputError("there are not as many modes", value=count, allowed=allowed)
    problem = _Problem(stiffness, mass, free)
    if correct is None:
        factors = _ShiftInvert(problem, count)
        start = factors.found()[:, :count]  # others may come after one that is left out
        correct = one_by_one(problem.stiffness, factors.solve)

    def corrected(columns: Array) -> Array:
        return problem.own[:, None] * correct(columns)

    modes = problem.stated(*_lowest_eigenpairs(problem, count, corrected, start))
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
    """K and M, without what is held, and which unknowns are free, of all and of this rank's own."""

    def __init__(self, stiffness: PETSc.Mat, mass: PETSc.Mat, free: PETSc.Vec) -> None:
        self._comm, self.free = free.comm.tompi4py(), free
        self.own = own = free.array_r > 0.0
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
        forces, momenta = (
            products(one, shapes.real) + 1j * products(one, shapes.imag) for one in pair
        )
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

    def solve(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the solution y for x."""
        self._linear.solve(x, y)


class _Span:
    """Vectors V with Vᵀ M V = 1, this rank's rows, with M V and K V, and Vᵀ K V of all ranks.

    Vectors stand as rows here, behind one another in memory.

    Args:
        problem: K and M.
        most: Number of vectors that it has room for.
    """

    def __init__(self, problem: _Problem, most: int) -> None:
        self._problem = problem
        self._add = problem.free.comm.tompi4py().allreduce
        self._diagonal = problem.stiffness.getDiagonal().array_r
        self._room = np.empty((3, most, len(self._diagonal)))
        self._small = np.zeros((0, 0))

    def __len__(self) -> int:
        return len(self._small)

    @property
    def _parts(self) -> Array:
        return self._room[:, : len(self)]

    def combined(self, shares: Array) -> Array:
        """Return combinations of the vectors, shape (m, k)."""
        real, imaginary = (part.T @ self._parts[0] for part in (shares.real, shares.imag))
        return np.asarray((real + 1j * imaginary).T)

    def beside(self, columns: Array) -> _New:
        """Return columns less their part in the span, with M times these and their sizes by M."""
        vectors, momenta, _ = self._parts
        rows = columns.T
        rows = rows - self._add(rows @ momenta.T) @ vectors
        again = self._add(rows @ momenta.T)  # what is left of one may be small
        rows -= again @ vectors
        moved = products(self._problem.mass, rows.T).T
        squares = self._add(np.einsum("kn,kn->k", rows, moved))
        return _New(rows, moved, np.sqrt(squares), (again**2).sum(axis=1))

    def extend(self, new: _New) -> None:
        """Take what `beside` returned, as far as that is not rounding."""
        apart = new.sizes**2 > _NEW**2 * (new.sizes**2 + new.lost)
        if not apart.any():
            return
        rows, momenta = (one[apart] / new.sizes[apart, None] for one in (new.rows, new.momenta))
        for _ in range(2):  # vectors that are nearly copies leave 1e-6 of one another at first
            weights, turned = np.linalg.eigh(self._add(rows @ momenta.T))
            apart = weights > _COPY * weights[-1]
            turned = (turned[:, apart] / np.sqrt(weights[apart])).T
            rows, momenta = turned @ rows, turned @ momenta
        first, last = len(self), len(self) + len(rows)
        self._room[:2, first:last] = rows, momenta
        fresh = self._room[:, first:last]
        fresh[2] = products(self._problem.stiffness, fresh[0].T).T
        right = self._add(self._room[0, :last] @ fresh[2].T)
        below = right[:first].T if self._problem.symmetric else self._below(first, last)
        self._small = np.block([[self._small, right[:first]], [below, right[first:]]])

    def _below(self, first: int, last: int) -> Array:
        vectors, _, forces = self._room
        return np.asarray(self._add(vectors[first:last] @ forces[:first].T))

    def restart(self, shares: Array) -> None:
        """Keep some orthonormal combinations of the vectors alone."""
        for part in self._room:
            part[: shares.shape[1]] = shares.T @ part[: len(self)]
        self._small = shares.T @ self._small @ shares

    def modes(self) -> tuple[Any, Any]:
        """Return κ of K φ = κ M φ in the span by rising magnitude, and the shares of the vectors.

        Of a pair both stand together.
        """
        values, shares = (
            np.linalg.eigh(0.5 * (self._small + self._small.T))
            if self._problem.symmetric
            else np.linalg.eig(self._small)
        )
        order = np.argsort(abs(values), kind="stable")
        return values[order], shares[:, order]

    def residuals(self, shares: Array, chosen: Indices) -> tuple[Array, Flags, Flags]:
        """Return what modes leave of their equations, whether that is no rounding, and too large.

        Args:
            shares: Of a pair the real and the imaginary part of the first, which span what both do.
            chosen: The modes that are asked for.
        """
        along = np.linalg.lstsq(shares, self._small @ shares, rcond=None)[0][:, chosen]
        vectors, momenta, forces = self._parts
        mine = shares[:, chosen].T
        left = mine @ forces - (shares @ along).T @ momenta
        own = mine @ forces, _SHIFT * self._problem.largest * (mine @ momenta)
        sizes = [left, (mine @ vectors) * self._diagonal, *own]
        rest, most, *usual = np.sqrt([self._add(np.einsum("kn,kn->k", one, one)) for one in sizes])
        return left.T, rest > _NOISE * most, rest > _LARGEST_RESIDUAL * np.add(*usual)


@dataclass(frozen=True, slots=True, eq=False)
class _New:
    """Vectors beside a span, as rows, M times these and their sizes by M.

    ``lost`` are the squares of what a second orthogonalisation took from them.
    """

    rows: Array
    momenta: Array
    sizes: Array
    lost: Array

    def only(self, chosen: Flags) -> _New:
        """Return some of them."""
        parts = self.rows, self.momenta, self.sizes, self.lost
        return _New(*(one[chosen] for one in parts))


def _lowest_eigenpairs(
    problem: _Problem, count: int, correct: Corrections, start: Array | None = None
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
        problem: K and M.
        count: Number of modes; of a pair that the last one belongs to both come back.
        correct: The preconditioner.
        start: Vectors that come first, random ones beside them, shape (m, k); None: random ones.

    Returns:
        κ by rising magnitude, shape (n,), and this rank's rows of φ, complex, shape (m, n).

    Raises:
        NotConverged: After 300 steps.

    Note:
        Collective.
    """
    block, unknowns = count + _BESIDE, round(problem.free.sum())
    first = _first(problem, block, correct, start)
    span = _Span(problem, _ROOM * block + first.shape[1])
    errors, past, new = np.ones(0), np.zeros((0, 0)), span.beside(first)
    if not (new.sizes > 0.0).all():
        raise NotConverged(
            "the natural modes",
            reason="the preconditioner returns zeros, or what is no number",
            iterations=0,
            remedy="see that it is near the inverse of the stiffness",
        )
    for _ in range(_MOST_STEPS):
        span.extend(new)
        values, shares = span.modes()
        wanted, kept = (
            end + int(values[end - 1].imag > 0.0)
            for end in (min(size, len(values)) for size in (count, block))
        )
        real = np.where(values.imag < 0.0, shares.imag, shares.real)[:, :kept]
        limits = np.where(np.arange(min(wanted + 1, kept)) < wanted, _ACCURATE, _NEXT)
        if len(errors) != len(limits) or (errors < limits).all():
            errors = np.ones(len(limits))  # once more of all: modes may have changed places
        asked = np.flatnonzero(errors >= limits)
        left, is_some, is_large = span.residuals(real, asked)
        new = span.beside(correct(left))  # in the span modes are the best ones
        errors[asked] = np.where(is_some, new.sizes, 0.0)
        vibrates = abs(values[asked]) > _ROUNDING * problem.largest
        errors[asked[is_some & is_large & vibrates & (asked < wanted)]] = 1.0  # would be refused
        converged = len(asked) == len(limits) and (errors < limits).all()
        if converged or len(span) == unknowns:
            return values[:wanted] + 0j, span.combined(shares[:, :wanted])
        new = new.only((errors >= limits)[asked])
        if len(span) + len(new.sizes) > _ROOM * block:
            both = _latest(real, past)
            span.restart(both)
            real = both.T @ real
        past = real
    raise NotConverged(
        "the natural modes",
        reason=f"{int((errors[:count] < _ACCURATE).sum())} of {count} modes",
        iterations=_MOST_STEPS,
        remedy="ask for fewer modes; see that supports and masses are those of the body",
    )


def _first(problem: _Problem, block: int, correct: Corrections, start: Array | None) -> Array:
    """Return vectors that the span starts from: given ones, and corrected random ones."""
    own, rank = problem.own[:, None], problem.free.comm.rank
    first = np.zeros((len(own), 0)) if start is None else own * start
    width = max(_BESIDE, block - first.shape[1])
    random = np.random.default_rng(rank).standard_normal((len(own), width))
    return np.hstack([first, correct(own * random)])


def _latest(real: Array, past: Array) -> Array:
    """Return orthonormal shares of the latest modes and of those of the step before."""
    before = np.pad(past, ((0, len(real) - len(past)), (0, 0)))
    both, triangle = np.linalg.qr(np.hstack([real, before]))
    return np.asarray(both[:, abs(np.diag(triangle)) > _COPY])


def _is_symmetric(matrix: PETSc.Mat) -> bool:
    skew = matrix.transpose(PETSc.Mat())
    skew.axpy(-1.0, matrix, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    size = skew.norm()
    skew.destroy()
    return bool(size <= _ROUNDING * matrix.norm())
