"""Lowest eigenpairs of large matrices, by a preconditioner near the inverse of the stiffness.

Theory: section 17 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from petsc4py import PETSc

from patchlaw.macro import compat
from patchlaw.support.arrays import Array
from patchlaw.support.errors import NotConverged

_ACCURATE = 1e-10
"""Largest correction of a mode at which it is accurate, relative to the mode, in the norm of M."""
_ROUNDING = 1e-14
"""Residual over the forces of single nodes that is rounding: no correction makes it smaller."""
_BESIDE = 8
"""Modes beyond the wanted ones that are kept, so that the last of these do not converge slowly."""
_ROOM = 4
"""Vectors that are kept over those of a step; 3 took a fifth more steps than 5 on a cube."""
_MOST_STEPS = 300
_NEW, _COPY = 0.5, 1e-10
"""Part of a vector that a second orthogonalisation leaves: less is rounding. Share of one, squared,
among new ones that counts as a combination of the others."""


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
    result = np.empty_like(columns)
    for k, column in enumerate(columns.T):
        x.array[:] = column
        (function or matrix.mult)(x, y)
        result[:, k] = y.array_r
    return result


def lowest_eigenpairs(
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
    are found as often as they are, as no single vector leads to them. All vectors are real, also
    where K has complex pairs.

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
    add, block = free.comm.tompi4py().allreduce, count + _BESIDE
    own, unknowns = free.array_r[:, None] > 0.0, round(free.sum())

    def corrected(columns: Array) -> Array:
        with compat.errors_of_callbacks():
            return own * images(stiffness, columns, lambda x, y: preconditioner.apply(None, x, y))

    first = np.zeros((len(own), 0)) if start is None else own * start
    width = max(_BESIDE, block - first.shape[1])
    random = np.random.default_rng(free.comm.rank).standard_normal((len(own), width))
    new = np.hstack([first, corrected(own * random)])
    image, past, small = images(mass, new), np.zeros((0, 0)), np.zeros((0, 0))
    basis = moved = forced = np.zeros((len(own), 0))  # V with Vᵀ M V = 1, M V and K V
    errors, diagonal = np.ones(0), stiffness.getDiagonal().array_r[:, None]
    sizes = np.sqrt(add((new * image).sum(axis=0)))
    if not (sizes > 0.0).all():
        raise NotConverged(
            "the natural modes",
            reason="the preconditioner returns zeros, or what is no number",
            iterations=0,
            remedy="see that it is near the inverse of the stiffness",
        )
    for _ in range(_MOST_STEPS):
        new, image = new / sizes, image / sizes
        shared = add(moved.T @ new)  # once more: what is left of a vector may be small
        new, image = new - basis @ shared, image - moved @ shared
        apart = add((new * image).sum(axis=0)) > _NEW**2
        new, image = new[:, apart], image[:, apart]
        if new.shape[1]:
            weights, turned = np.linalg.eigh(add(new.T @ image))
            apart = weights > _COPY * weights[-1]
            turned = turned[:, apart] / np.sqrt(weights[apart])
            new, image = new @ turned, image @ turned
            force = images(stiffness, new)
            basis, moved = np.hstack([basis, new]), np.hstack([moved, image])
            right, below = add(basis.T @ force), add(new.T @ forced)
            forced = np.hstack([forced, force])
            small = np.hstack([np.vstack([small, below]), right])
        values, shares = (
            np.linalg.eigh(0.5 * (small + small.T)) if symmetric else np.linalg.eig(small)
        )
        order = np.argsort(abs(values), kind="stable")  # LAPACK's pairs stay together
        values, shares = values[order], shares[:, order]
        wanted, kept = (
            end + int(values[end - 1].imag > 0.0)
            for end in (min(size, len(values)) for size in (count, block))
        )
        # of a pair the real and the imaginary part of the first span what both do
        real = np.where(values.imag < 0.0, shares.imag, shares.real)[:, :kept]
        along = np.linalg.lstsq(real, small @ real, rcond=None)[0]
        if len(errors) != wanted:
            errors = np.ones(wanted)
        if (errors < _ACCURATE).all():
            errors[:] = 1.0  # all are looked at once more: modes may have changed places
        asked = np.flatnonzero(errors >= _ACCURATE)
        left = forced @ real[:, asked] - moved @ (real @ along[:, asked])
        new = corrected(left)
        new = new - basis @ add(moved.T @ new)  # in their span the modes are the best ones already
        image = images(mass, new)
        sizes = np.sqrt(add((new * image).sum(axis=0)))
        terms = diagonal * (basis @ real[:, asked])
        rest, largest = np.sqrt([add((one**2).sum(axis=0)) for one in (left, terms)])
        errors[asked] = np.where(rest > _ROUNDING * largest, sizes, 0.0)
        accurate = len(asked) == wanted and (errors < _ACCURATE).all()
        if accurate or basis.shape[1] == unknowns:
            shares = shares[:, :wanted]
            return values[:wanted] + 0j, basis @ shares.real + 1j * (basis @ shares.imag)
        more = errors[asked] >= _ACCURATE
        new, image, sizes = new[:, more], image[:, more], sizes[more]
        if basis.shape[1] + new.shape[1] > _ROOM * block:
            before = np.pad(past, ((0, len(real) - len(past)), (0, 0)))
            both, triangle = np.linalg.qr(np.hstack([real, before]))
            both = both[:, abs(np.diag(triangle)) > _COPY]
            basis, moved, forced = basis @ both, moved @ both, forced @ both
            small, real = both.T @ small @ both, both.T @ real
        past = real
    raise NotConverged(
        "the natural modes",
        reason=f"{int((errors < _ACCURATE).sum())} of {count} modes",
        iterations=_MOST_STEPS,
        remedy="ask for fewer modes; see that supports and masses are those of the body",
    )
