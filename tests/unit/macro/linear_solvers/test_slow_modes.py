"""Slow modes of a preconditioned matrix, against dense eigenvalues, and the balanced inverse."""

import numpy as np
import pytest
from petsc4py import PETSc

from patchlaw.macro.linear_solvers.solvers import Balanced, slow_modes

SIZE = 300


class Scaled:
    """A preconditioner that is a diagonal."""

    def __init__(self, diagonal):
        self.diagonal, self.applied = diagonal, 0

    def apply(self, x, y):
        self.applied += 1
        y.array[:] = self.diagonal * x.array_r


def dense(matrix):
    """Return a matrix of PETSc with given entries."""
    return PETSc.Mat().createDense(matrix.shape, array=np.asfortranarray(matrix)).convert("aij")


@pytest.fixture(scope="module")
def stiff():
    """A matrix with 6 small eigenvalues from 2e-3 up, the rest between 0.4 and 1."""
    rng = np.random.default_rng(5)
    vectors = np.linalg.qr(rng.standard_normal((SIZE, SIZE)))[0]
    values = np.concatenate([np.geomspace(2.13e-3, 0.11, 6), rng.uniform(0.4, 1.0, SIZE - 6)])
    scale = rng.uniform(0.3, 3.0, SIZE)
    matrix = (scale[:, None] * vectors * values) @ (scale[:, None] * vectors).T
    return 0.5 * (matrix + matrix.T), scale**-2.0


def test_modes_span_those_of_the_smallest_eigenvalues(stiff):
    matrix, diagonal = stiff
    modes = slow_modes(dense(matrix), Scaled(diagonal))
    root = np.sqrt(diagonal)
    vectors = np.linalg.eigh(root[:, None] * matrix * root)[1][:, :6]
    wanted = root[:, None] * vectors
    left = wanted - modes @ np.linalg.lstsq(modes, wanted, rcond=None)[0]
    assert np.linalg.norm(left, axis=0).max() <= 1e-3 * np.linalg.norm(wanted, axis=0).min()


def test_energies_that_rounding_makes_negative_end_the_search(stiff):
    """On a few cells the residual, preconditioned, is rounding of any sign before it is small."""
    matrix, diagonal = stiff

    class Turned(Scaled):
        def apply(self, x, y):
            super().apply(x, y)
            y.array[:] *= 1.0 if self.applied < 13 else -1.0

    modes = slow_modes(dense(matrix), Turned(diagonal))
    assert modes.shape[0] == SIZE and np.isfinite(modes).all() and modes.dtype == np.float64


def test_a_good_preconditioner_has_no_slow_modes():
    spread = np.diag(np.linspace(1.0, 2.3, SIZE))
    good = Scaled(np.ones(SIZE))
    assert slow_modes(dense(spread), good).shape == (SIZE, 0)
    assert good.applied == 9  # its first Ritz values say so


def test_the_search_goes_on_where_a_single_slow_mode_is_left():
    """The first Ritz values do not show it, the residual does."""
    values = np.linspace(0.5, 1.0, SIZE)
    values[17] = 3.1e-3
    hidden = Scaled(np.ones(SIZE))
    slow_modes(dense(np.diag(values)), hidden)
    assert hidden.applied > 9


def test_balanced_is_the_formula_and_exact_on_the_modes(stiff):
    matrix, diagonal = stiff
    modes = np.random.default_rng(2).standard_normal((SIZE, 7))
    modes = np.column_stack([modes, modes[:, 0] * (1.0 + 1e-13)])  # a copy adds nothing
    apply = Balanced(dense(matrix), Scaled(diagonal), modes).apply
    found = np.empty((SIZE, SIZE))
    x, y = dense(matrix).createVecs()
    for k in range(SIZE):
        x.array[:] = np.eye(SIZE)[k]
        apply(None, x, y)
        found[:, k] = y.array_r
    own = modes[:, :7]
    exact = own @ np.linalg.solve(own.T @ matrix @ own, own.T)
    beside = np.eye(SIZE) - exact @ matrix
    np.testing.assert_allclose(found, exact + beside * diagonal @ beside.T, atol=1e-8)
    np.testing.assert_allclose(found @ (matrix @ own), own, atol=1e-7)
    assert np.linalg.eigvalsh(0.5 * (found + found.T)).min() > 0.0
