"""Free rigid motions of the body that presses, and the loads that they are to meet.

A motion q moves the body nearer by Σ_i q_i ℓ_i(x, y): the approach by ℓ = 1, slopes by the distance
from the middle. Motions that are free add unknowns q and as many conditions Σ p ℓ_i = f_i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from micro.cells.reach import Box

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_MOST_STEPS = 60
_LONGEST = 1.5  # change of an exponent in one step
_FARTHEST = 60.0  # largest exponent: pressures do not come into balance on these cells
_ROUNDING = 1e-14


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motions:
    """The k free motions of a rigid body on nx × ny cells.

    Args:
        along_x: Factors of the levers ℓ_i = X_i(x) Y_i(y) along x, dimensionless, shape (k, nx).
        along_y: Their factors along y, shape (k, ny).
        loads: Loads f_i: sums of pressures / E* times lever over the cells, shape (k,).
    """

    along_x: Array
    along_y: Array
    loads: Array

    @classmethod
    def approach(cls, grid: tuple[int, ...], total: float) -> Self:
        """Return the approach alone, under a given sum of pressures / E*."""
        return cls(along_x=np.ones((1, grid[0])), along_y=np.ones((1, grid[1])), loads=_row(total))

    @classmethod
    def turning(cls, x: Array, y: Array, total: float | None) -> Self:
        """Return the tilts about the middle without moment, and the approach if a total is given.

        Args:
            x: Abscissae of the cells from the middle, over half the diagonal, shape (nx,).
            y: Ordinates, shape (ny,).
            total: Sum of pressures / E*; None where the approach is prescribed.
        """
        ones_x, ones_y = np.ones_like(x), np.ones_like(y)
        along_x, along_y, loads = [x, ones_x], [ones_y, y], [0.0, 0.0]
        if total is not None:
            along_x.insert(0, ones_x)
            along_y.insert(0, ones_y)
            loads.insert(0, total)
        return cls(along_x=np.array(along_x), along_y=np.array(along_y), loads=np.array(loads))

    @property
    def turns(self) -> bool:
        """Whether slopes are free."""
        return len(self.loads) > 1

    def nearer(self, motion: Array) -> Array:
        """Return how much nearer a motion brings the body, shape (nx, ny) [mm]."""
        return np.asarray((self.along_x * motion[:, None]).T @ self.along_y)

    def among(self, cells: Indices) -> Array:
        """Return the levers of some cells by their flat indices, shape (k, n)."""
        row, column = np.divmod(cells, self.along_y.shape[1])
        return np.asarray(self.along_x[:, row] * self.along_y[:, column])

    def best(self, pressure: Array, gap: Array) -> Array:
        """Return the motion that closes gaps best, weighted with the pressures, shape (k,) [mm]."""
        cells = np.flatnonzero(pressure)
        root = np.sqrt(pressure.ravel()[cells] / pressure.max())
        levers = self.among(cells) * root
        return np.asarray(np.linalg.lstsq(levers.T, gap.ravel()[cells] * root, rcond=1e-10)[0])

    def on(self, box: Box) -> Motions:
        """Return the motions on a part of the cells, which carries all loads."""
        return Motions(
            along_x=self.along_x[:, box.rows],
            along_y=self.along_y[:, box.columns],
            loads=self.loads,
        )

    def coarsened(self, factors: Sequence[int]) -> Motions:
        """Return the motions on blocks of cells; see `coarse_start.coarsened`."""
        return Motions(
            along_x=_blocks(self.along_x, factors[0]),
            along_y=_blocks(self.along_y, factors[1]),
            loads=self.loads / np.prod(factors),
        )

    def balanced(self, pressure: Array, upper: float = np.inf) -> Array | None:
        """Return pressures that meet the loads, p exp(Σ μ_i ℓ_i) and at most the upper bound.

        The multipliers μ minimise a convex function, by damped Newton steps.

        Args:
            pressure: Pressures / E* ≥ 0, shape (nx, ny).
            upper: Upper bound / E*.

        Returns:
            The pressures, zero where they were; None where no such pressures meet the loads.
        """
        if len(self.loads) == 1 and upper == np.inf:
            total = float(pressure.sum())
            return pressure * (self.loads[0] / total) if total > 0.0 else None
        cells = np.flatnonzero(pressure)
        if not cells.size:
            return None if self.loads.any() else pressure
        values = self._scaled(pressure.ravel()[cells], self.among(cells), upper)
        if values is None:
            return None
        found = np.zeros(pressure.shape)
        found.ravel()[cells] = values
        return found

    def _scaled(self, start: Array, levers: Array, upper: float) -> Array | None:
        values, exponents = np.minimum(start, upper), np.zeros(len(self.loads))
        best = np.inf
        for _ in range(_MOST_STEPS):
            off = levers @ values - self.loads
            scale = np.maximum(np.abs(levers) @ values, np.abs(self.loads))
            error = float(np.max(np.abs(off) / np.where(scale > 0.0, scale, 1.0)))
            if error <= _ROUNDING or (error <= 10.0 * _ROUNDING and error >= best):
                return values
            best = min(best, error)
            weights = np.where(values < upper, values, 0.0)
            curvature = (levers * weights) @ levers.T
            if not np.isfinite(curvature).all() or not curvature.any():
                return None
            step = -np.linalg.lstsq(curvature, off, rcond=1e-14)[0]
            change = float(np.abs(step @ levers).max())
            exponents = exponents + step * min(1.0, _LONGEST / change if change > 0.0 else 1.0)
            if np.abs(exponents).max() > _FARTHEST:
                return None
            values = np.minimum(start * np.exp(exponents @ levers), upper)
        return values if best <= 1e-12 else None


def _row(value: float) -> Array:
    return np.array([value], dtype=np.float64)


def _blocks(values: Array, factor: int) -> Array:
    spare = -values.shape[1] % factor
    full = np.pad(values, ((0, 0), (0, spare)), mode="edge")
    return np.asarray(full.reshape(len(values), -1, factor).mean(axis=2))
