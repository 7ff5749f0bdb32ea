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

_MOST_STEPS = 100
_LONGEST = 1.5  # change of an exponent in one step
_FARTHEST = 60.0  # largest exponent: pressures do not come into balance on these cells
_MOST_HALVINGS = 8
_LEFT = 0.9  # part of the slope along a step by which it may rise beyond its end
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
        """Minimise Σ ψ(p_i) − f · μ over μ, where ψ' = p_i = min(p_i⁰ exp(μ · ℓ_i), upper)."""
        exponents = np.zeros(len(self.loads))
        values = start = np.minimum(start, upper)
        for _ in range(_MOST_STEPS):
            off, error = self._missed(levers, values)
            if error <= _ROUNDING:
                return values
            found = None
            # cells at the bound do not resist, unless they are to leave it
            for resisting in (values < upper, np.ones(len(values), bool)):
                found = self._step(start, levers, upper, exponents, off, values * resisting)
                if found is not None:
                    break
            if found is None or np.abs(found).max() > _FARTHEST:
                return values if error <= _ENOUGH else None
            exponents = found
            values = np.minimum(start * np.exp(exponents @ levers), upper)
        return values if self._missed(levers, values)[1] <= _ENOUGH else None

    def _missed(self, levers: Array, values: Array) -> tuple[Array, float]:
        """Return what pressures miss of the loads, and the largest part of what could act."""
        off = levers @ values - self.loads
        longest = np.abs(self.along_x).max(axis=1) * np.abs(self.along_y).max(axis=1)
        scale = np.maximum(longest * values.sum(), np.abs(self.loads))
        return off, float(np.max(np.abs(off) / np.where(scale > 0.0, scale, 1.0)))

    def _step(
        self,
        start: Array,
        levers: Array,
        upper: float,
        exponents: Array,
        off: Array,
        weights: Array,
    ) -> Array | None:
        """Return the exponents after a Newton step, shortened where it goes too far."""
        curvature = (levers * weights) @ levers.T
        if not np.isfinite(curvature).all() or not curvature.any():
            return None
        step = -np.linalg.lstsq(curvature, off, rcond=1e-14)[0]
        change = float(np.abs(step @ levers).max())
        step *= min(1.0, _LONGEST / change) if change > 0.0 else 1.0
        slope = float(off @ step)
        for _ in range(_MOST_HALVINGS):
            further = exponents + step
            values = np.minimum(start * np.exp(further @ levers), upper)
            left, error = self._missed(levers, values)
            if float(left @ step) < -_LEFT * slope or error <= _ROUNDING:
                return further
            step, slope = 0.5 * step, 0.5 * slope
        return None


def _row(value: float) -> Array:
    return np.array([value], dtype=np.float64)


def _blocks(values: Array, factor: int) -> Array:
    spare = -values.shape[1] % factor
    full = np.pad(values, ((0, 0), (0, spare)), mode="edge")
    return np.asarray(full.reshape(len(values), -1, factor).mean(axis=2))
