"""Oracle of the contact problem on few cells: a dense quadratic programme, proved by duality."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from patchlaw.micro.boundary_elements.grid_compliance import GridCompliance


class Dense(NamedTuple):
    """Pressures (n,), free motions (k,) and gaps (n,) of a proved solution."""

    pressure: np.ndarray
    motion: np.ndarray
    gap: np.ndarray


def matrix_of(grid: GridCompliance, shape):
    """Return the compliance of all cells, column by column, shape (n, n)."""
    count = int(np.prod(shape))
    return np.array([grid.displacement(row.reshape(shape)).ravel() for row in np.eye(count)]).T


def dense_contact(matrix, required, *, modes=None, loads=(), upper=np.inf):
    """Minimise ½ pᵀ C p − pᵀ d over 0 ≤ p ≤ H with Σ p ℓ_i = f_i.

    Bounded least squares, the loads a heavy penalty, tell which cells lie at a bound. Linear
    equations give what is left; where the conditions of the minimum then fail, the cells that fail
    change sides. That they hold in the end is asserted: for a convex problem they are enough.
    """
    required = required.ravel()
    count = len(required)
    modes = np.zeros((0, count)) if modes is None else modes
    factor = np.linalg.cholesky(0.5 * (matrix + matrix.T))
    heavy = 1e3 * np.abs(factor).max() / max(np.abs(modes).max(initial=0.0), 1e-300)
    found = lsq_linear(
        np.vstack((factor.T, heavy * modes)),
        np.append(np.linalg.solve(factor, required), heavy * np.asarray(loads)),
        bounds=(0.0, upper),
        method="bvls",
        tol=1e-14,
    ).x
    peak = found.max()
    full = found >= upper * (1.0 - 1e-9)
    free = (found > 1e-7 * peak) & ~full
    for _ in range(50):
        dense = _on(matrix, required, modes, np.asarray(loads), free, full, upper)
        now_full = (free & (dense.pressure > upper)) | (full & (dense.gap <= 0.0))
        now_free = (
            (free & (dense.pressure > 0.0) & ~now_full)
            | (full & (dense.gap > 0.0))
            | (~free & ~full & (dense.gap < 0.0))
        )
        if np.array_equal(now_full, full) and np.array_equal(now_free, free):
            break
        free, full = now_free, now_full
    _prove(dense, modes, np.asarray(loads), upper)
    return dense


def _on(matrix, required, modes, loads, free, full, upper):
    k, n = len(modes), int(free.sum())
    pressure = np.where(full, upper if np.isfinite(upper) else 0.0, 0.0)
    system = np.zeros((n + k, n + k))
    system[:n, :n] = matrix[np.ix_(free, free)]
    system[:n, n:] = -modes[:, free].T
    system[n:, :n] = modes[:, free]
    right = np.append((required - matrix @ pressure)[free], loads - modes @ pressure)
    # motions that the cells do not resist stay where they are
    solved = np.linalg.lstsq(system, right, rcond=1e-15)[0]
    pressure[free] = solved[:n]
    motion = solved[n:]
    return Dense(pressure, motion, matrix @ pressure - required - motion @ modes)


def _prove(dense, modes, loads, upper):
    size = np.abs(dense.gap).max()
    assert dense.pressure.min() >= 0.0 and dense.pressure.max() <= upper
    assert dense.gap[dense.pressure < upper].min() >= -1e-11 * size
    assert dense.gap[dense.pressure > 0.0].max() <= 1e-11 * size
    acting = np.abs(modes) @ dense.pressure
    assert np.all(np.abs(modes @ dense.pressure - loads) <= 1e-11 * np.append(acting, 1.0).max())
