"""Natural frequencies and modes of elastic bodies about a loaded state.

Theory: section 17 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from petsc4py import PETSc
from scipy.linalg import cholesky, eig, eigh, inv, schur
from scipy.sparse.csgraph import connected_components

from patchlaw.macro import compat
from patchlaw.macro.linear_solvers.many_vectors import Corrections, one_by_one, products
from patchlaw.macro.linear_solvers.node_matrices import free_unknowns
from patchlaw.macro.linear_solvers.solvers import Factors
from patchlaw.support import Array, Count, Flags, Has, Indices, InputError, NotConverged, checked

_SHIFT = 1e-8
"""Shift below zero over the geometric mean of eigenvalues of single unknowns, by which the matrix
of a free body has an inverse; bodies of 100 cells have their first mode at 1e-4 of the largest.
What is left of a mode is compared with this part of the forces of its single nodes where its own
forces are less."""
_OF_LEAST = 1e-2
"""Largest shift over the smallest eigenvalue of single unknowns, which the first mode is below."""
_ROUNDING = 1e-12
"""Squared frequency of a mode over the one that its nodes would have alone, and skew over symmetric
part of a matrix, which are zeros."""
_LARGEST_RESIDUAL = 1e-5
"""Beyond it modes are refused; they have 1e-8 and less where everything is as it should be."""
_MOST_REFINED = 30
"""Corrections of modes whose residual is larger, one by one: in a span they have the rounding of
forces that are 1e14 times as large, which those of a heavy plane on a soft law are less than."""
_ACCURATE, _NEXT = 3e-10, 1e-6
"""Last correction of a mode that is accurate then, relative to the mode, in the norm of M, and of
the mode beyond the wanted ones: residuals are 1e-8 and less."""
_REPEATED, _UNSURE = 1e-8, 1e-10
"""Distance of squared frequencies, relative to these, within which they are one that is repeated:
rounding and loads that are found to a tolerance part them by less. Relative error of stiffness that
leaves open whether two modes of a face that slides have just merged or are just apart: that of
eigenvalues of a matrix that is not symmetric, which err like the shapes."""
NEARLY = 2e-5
"""Distance of squared frequencies, relative to these, within which rounding of the load mixes the
shapes by more than 1e-8: what they span is accurate, so all or none of them are returned."""
_NOISE = 1e-14
"""Residual over the forces of single nodes that is rounding: no correction makes it smaller."""
_GROWN = 2.0
"""Times by which the residual of an accurate mode grows if another one has taken its place."""
_BESIDE = 8
"""Modes beyond the wanted ones that are kept, so that the last of these do not converge slowly."""
_ROOM = 5
"""Vectors that are kept over those of a step: 4 took a tenth more cycles on a cube, and 6 saved a
fortieth."""
_MOST_STEPS = 300
_MOST_STARTS = 4
"""Draws of first vectors, until none of the modes that are asked for has too few of them."""
_MUCH, _NEW, _COPY = 100.0, 0.5, 1e-10
"""Times by which squares fall in an orthogonalisation that is repeated. Part of a vector that the
second one leaves: less is rounding. Share of one, squared, among new ones that counts as a
combination of the others."""

Matrix = Annotated[Any, Has("an assembled matrix of PETSc", ("getDiagonal", "createVecRight"))]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NaturalModes:
    """Free vibrations φ exp(λ t) of K u + M ü = 0, by rising frequency.

    Modes whose λ² are equal within 1e-8, or where two modes merge to rounding, are a group: its
    members have their mean as λ, and shapes that are an orthonormal basis of what they span.

    Attributes:
        eigenvalues: λ with an imaginary part not below zero, shape (n,) [1/s].
        shapes: This rank's rows of φ, with φᴴ M φ = 1, shape (m, n).
        momenta: M φ likewise.
        residuals: |K φ + λ² M φ| / (|K φ| + |λ² M φ|) of the full problem, shape (n,); in a group
            less the part of K φ in its space.
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
        count: Number of modes, those of least |λ|; of a pair or of a repeated mode that the last
            one belongs to all come back.
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
    problem = _Problem(stiffness, mass, free)
    if count > problem.unknowns:
        allowed = f"up to {problem.unknowns}, the free unknowns with a mass"
        raise InputError("there are not as many modes", value=count, allowed=allowed)
    inverse, own = problem.factors() if correct is None else correct, problem.own[:, None]

    def corrected(columns: Array) -> Array:
        return own * inverse(columns)

    basis = _lowest(problem, count, corrected, start)
    for _ in range(_MOST_REFINED):
        modes, basis, rest = problem.modes(basis)
        left = modes.residuals[modes.eigenvalues != 0.0].max(initial=0.0)
        if left < _LARGEST_RESIDUAL:
            return modes
        basis = basis - corrected(rest)
    raise _not_found(f"a residual of {left:.1e}", f"{_SEE}, and the preconditioner", _MOST_REFINED)


_SEE = "see that supports and masses are those of the body"


def _not_found(reason: str, remedy: str, iterations: int = 0) -> NotConverged:
    what = "the natural modes"
    return NotConverged(what, reason=reason, iterations=iterations, remedy=remedy)


class _Problem:
    """K and M, without what is held, and which unknowns are free, of all and of this rank's own."""

    def __init__(self, stiffness: PETSc.Mat, mass: PETSc.Mat, free: PETSc.Vec) -> None:
        self.comm = free.comm.tompi4py()
        self.own = own = free.array_r > 0.0
        both = stiffness, mass
        if any(one.getSizes() != stiffness.getSizes() or not one.isAssembled() for one in both):
            raise InputError("stiffness and mass are not of one size, or not assembled")
        self.stiffness, self.mass = (one.convert("aij", PETSc.Mat()) for one in both)
        for one in (self.stiffness, self.mass):
            one.diagonalScale(free, free)
        diagonal, weight = self.stiffness.getDiagonal(), self.mass.getDiagonal().array_r[own]
        heavy = weight > 0.0
        ratios = diagonal.array_r[own][heavy] / weight[heavy]
        self.unknowns = self.comm.allreduce(int(heavy.sum()))
        self.largest = self._largest(ratios)
        if not self.largest > 0.0:
            raise InputError("the stiffness has no positive diagonal, or the mass has none")
        ratios = ratios[ratios > 0.0]
        self.least = 1.0 / self._largest(1.0 / ratios)
        # nodes that are nearly massless would shift the modes of all others
        size, logs = self.comm.allreduce(np.array([len(ratios), np.log(ratios).sum()]))
        self.usual = float(np.exp(logs / size))
        diagonal.array[~own] = self._largest(diagonal.array_r)  # what is held has no mass
        self.stiffness.setDiagonal(diagonal)
        self.diagonal = diagonal.array_r
        self.symmetric = _is_symmetric(self.stiffness)
        if not _is_symmetric(self.mass):
            raise InputError("the mass is not symmetric")

    def factors(self) -> Factors:
        """Return those of K + c M with a small c, as the stiffness of free bodies has none."""
        shifted = self.stiffness.copy()
        structure = PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN
        low, high = _ROUNDING * self.usual, _SHIFT * self.usual
        shifted.axpy(float(np.clip(_OF_LEAST * self.least, low, high)), self.mass, structure)
        return Factors(shifted, symmetric=self.symmetric)

    def modes(self, basis: Array) -> tuple[NaturalModes, Array, Array]:
        """Return the modes that real vectors span, this rank's rows (m, n), with their residuals.

        The small problem is solved anew: in a larger span eigenvalues have its rounding. Next come
        the vectors V, now orthonormal, and what they leave of K V = M V A with the best A.
        """
        add = self.comm.allreduce
        forces, momenta = (products(one, basis) for one in (self.stiffness, self.mass))
        scale = inv(cholesky(add(basis.T @ momenta)))  # with which vectors are orthonormal
        basis, forces, momenta = (one @ scale for one in (basis, forces, momenta))
        stiff = self.diagonal[:, None] * basis
        matrix, alone = (add(basis.T @ one) for one in (forces, stiff))
        none = _ROUNDING * alone + _ACCURATE**2 * self.largest * np.eye(len(alone))
        turn, same = _groups(matrix, none, symmetric=self.symmetric)
        shapes, forces_of, momenta_of, stiff = (
            one @ turn for one in (basis, forces, momenta, stiff)
        )
        among = np.where(same, add(shapes.conj().T @ forces_of), 0.0)
        squares = same @ among.diagonal() / same.sum(axis=1)
        zero = abs(squares) <= _along(none, turn)
        # λ² = −κ: of a merged pair one grows, and what is negative leaves without vibrating
        values = np.sqrt(-np.where(zero, 0.0, squares))
        values = np.where(values.imag < 0.0, -values, values) + 0.0
        order = np.lexsort((-values.real, values.imag))
        # rigid motions have no forces
        floor = _SHIFT * np.where(zero, self.largest * momenta_of, stiff)
        left, *usual = (
            np.sqrt(add((abs(one) ** 2).sum(axis=0)))
            for one in (forces_of - momenta_of @ among, forces_of, values**2 * momenta_of, floor)
        )
        found = NaturalModes(
            eigenvalues=values[order],
            shapes=shapes[:, order],
            momenta=momenta_of[:, order],
            residuals=(left / sum(usual))[order],
        )
        return found, basis, forces - momenta @ matrix

    def _largest(self, values: Array) -> float:
        return float(max(self.comm.allgather(float(values.max(initial=0.0)))))


class _Span:
    """Vectors V with Vᵀ M V = 1, this rank's rows, with M V and K V, and Vᵀ K V of all ranks.

    Vectors stand as rows here, behind one another in memory.

    Args:
        problem: K and M.
        most: Number of vectors that it has room for.
    """

    def __init__(self, problem: _Problem, most: int) -> None:
        self._problem, self._add = problem, problem.comm.allreduce
        self._room = np.empty((3, most, len(problem.own)))
        self._small = np.zeros((0, 0))

    def __len__(self) -> int:
        return len(self._small)

    @property
    def _parts(self) -> Array:
        return self._room[:, : len(self)]

    def combined(self, shares: Array) -> Array:
        """Return combinations of the vectors, shape (m, k)."""
        return np.asarray((shares.T @ self._parts[0]).T)

    def beside(self, columns: Array) -> tuple[Array, Array]:
        """Return columns less their part in the span, and by M, (2, k, m), and their sizes (k,).

        The size is zero where all that is left is rounding.
        """
        vectors, momenta, _ = self._parts
        rows = columns.T
        for last in (False, True):
            parts = self._add(rows @ momenta.T)
            rows = rows - parts @ vectors
            moved = products(self._problem.mass, rows.T).T
            squares = self._add(np.einsum("kn,kn->k", rows, moved))
            lost = (parts**2).sum(axis=1)
            if not last and (lost <= _MUCH * squares).all():
                return np.stack([rows, moved]), np.sqrt(squares)
        # what is left of one may be small
        sizes = np.where(squares > _NEW**2 * (squares + lost), np.sqrt(squares), 0.0)
        return np.stack([rows, moved]), sizes

    def extend(self, rows: Array, sizes: Array) -> None:
        """Take what `beside` returned, as far as it is neither rounding nor copies."""
        if not sizes.any():
            return
        rows, momenta = rows[:, sizes > 0.0] / sizes[sizes > 0.0, None]
        for _ in range(2):  # vectors that are nearly copies leave 1e-6 of one another at first
            weights, turned = np.linalg.eigh(self._add(rows @ momenta.T))
            apart = weights > _COPY * weights[-1]
            turned = (turned[:, apart] / np.sqrt(weights[apart])).T
            rows, momenta = turned @ rows, turned @ momenta
            if weights[0] > weights[-1] / _MUCH:
                break
        first, last = len(self), len(self) + len(rows)
        forces = products(self._problem.stiffness, rows.T).T
        self._room[:, first:last] = rows, momenta, forces
        vectors, _, all_forces = self._room[:, :last]
        right = self._add(vectors @ forces.T)
        symmetric = self._problem.symmetric
        below = right[:first].T if symmetric else self._add(rows @ all_forces[:first].T)
        self._small = np.block([[self._small, right[:first]], [below, right[first:]]])

    def restart(self, shares: Array, past: Array) -> Array:
        """Keep modes and those of the step before; return the shares of the modes in these."""
        past = np.pad(past, ((0, len(self) - len(past)), (0, 0)))
        both, triangle = np.linalg.qr(np.hstack([shares, past]))
        both = both[:, abs(np.diag(triangle)) > _COPY]
        for part in self._room:
            part[: both.shape[1]] = both.T @ part[: len(self)]
        self._small = both.T @ self._small @ both
        return np.asarray(both.T @ shares)

    def modes(self, count: int, most: int) -> tuple[Array, int]:
        """Return the shares of the vectors in modes by rising |κ|, and how many are wanted.

        They are orthonormal, the first k of them spanning k modes; of a complex pair both count.
        """
        small = self._small
        values, shares = (
            np.linalg.eigh(0.5 * (small + small.T))
            if self._problem.symmetric
            else np.linalg.eig(small)
        )
        order = np.argsort(abs(values), kind="stable")
        values, shares = values[order], shares[:, order]
        shares = np.where(values.imag < 0.0, shares.imag, shares.real)
        if not self._problem.symmetric:  # modes about to merge are nearly parallel
            shares, _ = np.linalg.qr(shares)
        wanted, kept = (min(size, len(values)) for size in (count, most))
        kept += int(values[kept - 1].imag > 0.0)
        floor = _ROUNDING * self._problem.usual
        apart = abs(np.diff(values)) > NEARLY * abs(values[1:]) + floor
        last = kept - int(kept < self._problem.unknowns)  # the next one tells that they converge
        while wanted < kept and (
            values[wanted - 1].imag > 0.0 or (wanted < last and not apart[wanted - 1])
        ):
            wanted += 1
        return shares[:, :kept], wanted

    def residuals(self, shares: Array, chosen: Indices) -> tuple[Array, Array]:
        """Return what modes leave of their equations, (m, k), and its relative size (k,).

        The size is zero where all that is left is rounding.

        Args:
            shares: Those of all modes, see `modes`.
            chosen: The modes that are asked for.
        """
        along = shares.T @ self._small @ shares[:, chosen]
        mine, (vectors, momenta, forces) = shares[:, chosen].T, self._parts
        left = mine @ forces - (shares @ along).T @ momenta
        sizes = left, (mine @ vectors) * self._problem.diagonal
        rest, most = (np.sqrt(self._add(np.einsum("kn,kn->k", one, one))) for one in sizes)
        return left.T, np.where(rest > _NOISE * most, rest, 0.0) / (most + np.finfo(float).tiny)


def _lowest(
    problem: _Problem, count: int, correct: Corrections, start: Array | None = None
) -> Array:
    """Return real vectors that span the modes next to zero, by Davidson's method in blocks.

    Modes are those of K and M in the span of some vectors. Preconditioned residuals of the modes
    that are not accurate extend it, and it restarts from the latest modes and those of the step
    before, as conjugate gradients do (Stathopoulos & Saad 1998, ETNA 7, 163-181). A
    residual costs one cycle of multigrid; a linear solve costs some twenty. Modes that are repeated
    are found as often as they are, as no single vector leads to them. The mode beyond the wanted
    ones is found roughly, too: one that the first vectors leave out is the lowest of all others.
    All vectors are real, also where K has complex pairs.

    Args:
        problem: K and M.
        count: Number of modes, see `natural_modes`.
        correct: The preconditioner.
        start: Vectors that come first, random ones beside them, shape (m, k); None: random ones.

    Returns:
        This rank's rows, shape (m, n).

    Raises:
        NotConverged: After 300 steps.

    Note:
        Collective.
    """
    block = count + _BESIDE
    span = _started(problem, block, correct, start)
    errors, settled, past = np.ones(0), np.zeros(0), np.zeros((0, 0))
    for _ in range(_MOST_STEPS):
        shares, wanted = span.modes(count, block)
        limits = np.where(np.arange(min(wanted + 1, shares.shape[1])) < wanted, _ACCURATE, _NEXT)
        known = len(errors) == len(limits) > wanted and (errors < limits).all()
        if known:  # modes may have changed places
            left = span.residuals(shares, np.arange(len(limits)))[1]
            known = (left <= _GROWN * settled).all()
        if known or len(span) == problem.unknowns:
            return span.combined(shares[:, :wanted])
        if len(errors) != len(limits) or (errors < limits).all():
            errors, settled = np.ones(len(limits)), np.zeros(len(limits))
        asked = np.flatnonzero(errors >= limits)
        if len(span) + len(asked) > _ROOM * block:  # first: corrections are beside what is kept
            shares = span.restart(shares, past)
        left, settled[asked] = span.residuals(shares, asked)
        rows, sizes = span.beside(correct(left))  # in the span modes are the best ones
        errors[asked] = np.where(settled[asked] > 0.0, sizes, 0.0)
        span.extend(rows, sizes)
        past = shares
    done = f"{int((errors[:count] < _ACCURATE).sum())} of {count} modes"
    raise _not_found(done, f"ask for fewer modes; {_SEE}", _MOST_STEPS)


def _started(problem: _Problem, block: int, correct: Corrections, start: Array | None) -> _Span:
    """Return the span of given vectors, and of corrected random ones.

    Rigid motions grow so much in a correction that they leave only rounding of others, which then
    come from random momenta without their part. What has no mass follows momenta.
    """
    own, draw = problem.own[:, None], np.random.default_rng(problem.comm.rank)
    first = np.zeros((len(own), 0)) if start is None else own * start
    width = max(_BESIDE, block - first.shape[1])
    span = _Span(problem, _ROOM * block + first.shape[1] + width)
    for turn in range(_MOST_STARTS):
        random = own * draw.standard_normal((len(own), width))
        random = correct(products(problem.mass, span.beside(random)[0][0].T))
        rows, sizes = span.beside(random if turn else np.hstack([first, random]))
        if not (turn or (sizes > 0.0).all()):
            reason = "the preconditioner returns zeros, or what is no number"
            raise _not_found(reason, "see that it is near the inverse of the stiffness")
        span.extend(rows, sizes)
        if len(span) >= min(block, problem.unknowns):
            break
    return span


def _groups(matrix: Array, none: Array, *, symmetric: bool) -> tuple[Array, Flags]:
    """Return the shapes of modes of a matrix in columns, and which are of one group, both (n, n).

    Shapes of a group are orthonormal. Of two modes that have just merged the shapes are parallel,
    and their distance is the root of an error of the matrix: what they span is accurate.

    Args:
        matrix: The stiffness of orthonormal vectors, shape (n, n).
        none: A form of the vectors below which squared frequencies are zero, shape (n, n).
        symmetric: Whether the matrix is symmetric.
    """
    if symmetric:
        values, turn = eigh(matrix)
        error = np.full(len(values), _REPEATED)
    else:
        values, other, turn = eig(matrix, left=True)
        parallel = abs((other.conj() * turn).sum(axis=0)) + np.finfo(float).tiny
        error = np.clip(_UNSURE / parallel, _REPEATED, np.sqrt(_UNSURE))
    told = np.where(abs(values) <= _along(none, turn), 0.0, values)
    error = error * abs(told)
    apart = abs(told[:, None] - told) > np.minimum(error[:, None], error)
    label = connected_components(~apart)[1]
    same = label[:, None] == label
    turn = turn + 0j
    for group in [] if symmetric else np.unique(same[same.sum(axis=1) > 1], axis=0):
        turn[:, group] = _space(matrix, values, group)
    return turn, same


def _space(matrix: Array, values: Array, group: Flags) -> Array:
    """Return orthonormal vectors that span the shapes of some eigenvalues of a matrix, (n, k)."""
    middle = values[group].mean()
    away = abs(values - middle)
    radius = 0.5 * (away[group].max() + away[~group].min(initial=np.inf))
    whole = schur(matrix, "complex", sort=lambda one: abs(one - middle) <= radius)[1]
    found = np.asarray(whole[:, : group.sum()])
    if abs(middle.imag) > away[group].max():
        return found
    # no or both members of complex pairs: a real space
    return np.asarray(np.linalg.svd(np.hstack([found.real, found.imag]))[0][:, : group.sum()])


def _along(form: Array, turn: Array) -> Array:
    """Return the values of a form (n, n) for vectors in columns, shape (k,)."""
    return np.asarray(np.einsum("ik,ij,jk->k", turn.conj(), form, turn).real)


def _is_symmetric(matrix: PETSc.Mat) -> bool:
    skew = matrix.transpose(PETSc.Mat())
    skew.axpy(-1.0, matrix, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    size = skew.norm()
    skew.destroy()
    return bool(size <= _ROUNDING * matrix.norm())
