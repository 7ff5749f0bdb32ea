"""Free rigid motions of the body that presses, and the loads that they are to meet.

A motion q moves the body nearer by Σ_i q_i ℓ_i(x, y): the approach by ℓ = 1, slopes by the distance
from the middle. Motions that are free add unknowns q and as many conditions Σ p ℓ_i = f_i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from micro.compliance.cells import Box

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

_MOST_STEPS = 100
_LONGEST = 1.5  # change of an exponent in one step
_FARTHEST = 60.0  # largest exponent: pressures do not come into balance on these cells
_MOST_HALVINGS = 8
_AT_BOUND = 1e-13  # of the bound: pressures no further below it are taken for it
_BEYOND = 0.9  # part of its first slope that the function may have beyond its lowest point
_ROUNDING, _ENOUGH = 1e-14, 1e-12
"""What pressures may miss of the loads, of what they could do on the longest lever; the second
where steps gain no more."""


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
        levers, left = self.among(cells), gap.ravel()[cells]
        found = np.zeros(len(self.loads))
        for _ in range(2 if self.turns else 1):  # again for what rounding leaves of light cells
            change = np.linalg.lstsq((levers * root).T, left * root, rcond=1e-10)[0]
            found, left = found + change, left - change @ levers
        return found

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

    def balanced(
        self, pressure: Array, upper: float = np.inf, fixed: Flags | None = None
    ) -> Array | None:
        """Return pressures that meet the loads, p exp(Σ μ_i ℓ_i) and at most the upper bound.

        The multipliers μ minimise a convex function, by Newton steps.

        Args:
            pressure: Pressures / E* ≥ 0, shape (nx, ny).
            upper: Upper bound / E*.
            fixed: Cells whose pressures stay as they are, shape (nx, ny).

        Returns:
            The pressures, zero where they were; None where no such pressures meet the loads.
        """
        if len(self.loads) == 1 and upper == np.inf:
            total = float(pressure.sum())
            return pressure * (self.loads[0] / total) if total > 0.0 else None
        cells, loads, acting = np.flatnonzero(pressure), self.loads, 0.0
        if fixed is not None:
            cells = np.flatnonzero(np.where(fixed, 0.0, pressure))
            stay = np.flatnonzero(fixed)
            loads = loads - self.among(stay) @ pressure.ravel()[stay]
            acting = float(pressure.ravel()[stay].sum())
        if not cells.size and loads.any():
            return None
        longest = np.abs(self.along_x).max(axis=1) * np.abs(self.along_y).max(axis=1)
        scaled = _Scaled(
            np.minimum(pressure.ravel()[cells], upper), self.among(cells), loads, upper
        )
        values = scaled.solution(longest, acting)
        if values is None:
            return None
        found = np.zeros(pressure.shape) if fixed is None else np.where(fixed, pressure, 0.0)
        found.ravel()[cells] = values
        return found


class _Scaled(NamedTuple):
    """Pressures p_i = min(p_i⁰ exp(μ · ℓ_i), upper) that meet loads f.

    They minimise Σ ψ_i − f · μ, where ψ_i is the integral of p_i in μ · ℓ_i.
    """

    start: Array
    levers: Array
    loads: Array
    upper: float

    def solution(self, longest: Array, acting: float) -> Array | None:
        """Return the pressures; None where there are none.

        Args:
            longest: Longest lever of each motion, shape (k,).
            acting: Sum of pressures that act beside these.
        """
        exponents, values = np.zeros(len(self.loads)), self.start
        for _ in range(_MOST_STEPS):
            off = self.levers @ values - self.loads
            scale = np.maximum(longest * (acting + values.sum()), np.abs(self.loads))
            error = float(np.max(np.abs(off) / np.where(scale > 0.0, scale, 1.0)))
            if error <= _ROUNDING:
                return values
            # cells at the bound do not resist, unless they are to leave it
            found = self._step(exponents, off, np.where(values < self.upper, values, 0.0))
            found = self._step(exponents, off, values) if found is None else found
            if found is None or np.abs(found).max() > _FARTHEST:
                break
            exponents, values = found, self.at(found)
        return values if error <= _ENOUGH else None

    def at(self, exponents: Array) -> Array:
        """Return the pressures for multipliers μ."""
        found = self.start * np.exp(exponents @ self.levers)
        return np.where(found < (1.0 - _AT_BOUND) * self.upper, found, self.upper)

    def _step(self, exponents: Array, off: Array, weights: Array) -> Array | None:
        """Return the multipliers after a Newton step, shortened where it goes too far."""
        curvature = (self.levers * weights) @ self.levers.T
        if not np.isfinite(curvature).all() or not curvature.any():
            return None
        step = -np.linalg.lstsq(curvature, off, rcond=1e-14)[0]
        change = float(np.abs(step @ self.levers).max())
        step *= min(1.0, _LONGEST / change) if change > 0.0 else 1.0
        for _ in range(_MOST_HALVINGS):
            left = self.levers @ self.at(exponents + step) - self.loads
            if float(left @ step) <= -_BEYOND * float(off @ step):
                return exponents + step
            step = 0.5 * step
        return None


def _row(value: float) -> Array:
    return np.array([value], dtype=np.float64)


def _blocks(values: Array, factor: int) -> Array:
    spare = -values.shape[1] % factor
    full = np.pad(values, ((0, 0), (0, spare)), mode="edge")
    return np.asarray(full.reshape(len(values), -1, factor).mean(axis=2))
