"""Cubic interpolants of patch laws over the local approach, for one law or for many at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

LEAST_SLOPE = 1e-6
"""Slope of the closure over the approach that is treated as the end of its rise."""

_ROUNDING = 1e-14
_MOST_STEPS = 80
"""Steps of an inversion at most; bisection alone takes 53 to rounding."""


class LawPoint(NamedTuple):
    """Laws of N patches at local approaches, with their derivatives.

    Attributes:
        closure: Closures [mm].
        pressure: Mean pressures [MPa].
        dclosure: Derivative of the closure over the local approach.
        dpressure: Derivative of the pressure over the local approach [MPa/mm].
    """

    closure: Array
    pressure: Array
    dclosure: Array
    dpressure: Array

    @classmethod
    def of(cls, values: Array, slopes: Array) -> LawPoint:
        """Return the point of two interpolants, closure and p^(2/3).

        Args:
            values: The interpolants, closure and p^(2/3) first.
            slopes: Their derivatives over the local approach.
        """
        power = np.maximum(values[1], 0.0)
        root = np.sqrt(power)
        return cls(values[0], root * power, slopes[0], 1.5 * root * slopes[1])


@dataclass(frozen=True, slots=True, eq=False)
class Tangent:
    """Derivative of closure + C p over the local approaches of N patches, shape (N, N).

    The closure of a patch without load equals its approach, and its pressure moves no other patch:
    its column is that of the identity. The dense system is therefore solved for the loaded patches
    alone. Of 64 × 64 patches a rough surface loads some hundred, and a solution takes milliseconds
    instead of seconds.

    Attributes:
        loaded: Indices of the L patches whose columns are not those of the identity, ascending.
        columns: Their columns, shape (N, L).
    """

    loaded: Indices
    columns: Array

    @classmethod
    def of(cls, point: LawPoint, compliance: Array) -> Tangent:
        """Return the tangent of laws on a body.

        Args:
            point: The laws of N patches.
            compliance: C, mean displacement of patch i by unit pressure on patch j, shape (N, N)
                [mm/MPa].
        """
        identity = (point.pressure <= 0.0) & (point.dpressure == 0.0) & (point.dclosure == 1.0)
        loaded = np.flatnonzero(~identity)
        columns = compliance[:, loaded] * point.dpressure[loaded]
        columns[loaded, np.arange(len(loaded))] += point.dclosure[loaded]
        return cls(loaded, columns)

    @property
    def norm(self) -> float:
        """Largest sum of the magnitudes of a row."""
        sums = np.abs(self.columns).sum(axis=1)
        identity = np.ones(len(sums))
        identity[self.loaded] = 0.0
        return float((sums + identity).max())

    def solve(self, right: Array) -> Array:
        """Return the solution for right-hand sides of shape (N,) or (N, k).

        Raises:
            numpy.linalg.LinAlgError: When the tangent is singular.
        """
        found = np.linalg.solve(self.columns[self.loaded], right[self.loaded])
        result = right - self.columns @ found
        result[self.loaded] = found
        return np.asarray(result)


@dataclass(frozen=True, slots=True, eq=False)
class LawCurves:
    """Piecewise cubic functions of the local approach: the same f functions for each of N laws.

    The first piece holds before the first row of a law. The last one continues the tangents beyond
    the last row.

    Attributes:
        knots: Approaches of the rows, padded by infinity, shape (N, n) [mm].
        origins: Approaches that the pieces count from, shape (N, n + 1) [mm].
        coefficients: Coefficients of the powers 3 … 0, shape (N, n + 1, 4, f).
    """

    knots: Array
    origins: Array
    coefficients: Array

    @classmethod
    def through(
        cls, approach: Array, values: Sequence[Array], before: Sequence[float]
    ) -> LawCurves:
        """Interpolate the rows of one law monotonically (PCHIP).

        Args:
            approach: Increasing approaches, shape (n,) [mm]; none for a law without rows.
            values: For each function its values, shape (n,).
            before: For each function its slope before the first row.

        Source:
            Fritsch & Butland 1984, doi 10.1137/0905021.
        """
        rows = len(approach)
        origins = np.concatenate((approach[:1], approach)) if rows else np.zeros(1)
        pieces = np.zeros((rows + 1, 4, len(values)))
        pieces[0, 2] = before
        if rows:
            columns = np.column_stack(values).astype(np.float64)
            cubic = PchipInterpolator(approach, columns)
            pieces[0, 3] = columns[0]
            pieces[1:-1] = np.moveaxis(cubic.c, 0, 1)
            pieces[-1, 2:] = cubic(approach[-1], 1), columns[-1]
        return cls(approach[None], origins[None], pieces[None])

    @classmethod
    def packed(cls, curves: Sequence[LawCurves]) -> LawCurves:
        """Return the curves of many laws as one."""
        rows = max(one.knots.shape[1] for one in curves)
        knots = np.full((len(curves), rows), np.inf)
        origins = np.zeros((len(curves), rows + 1))
        pieces = np.zeros((len(curves), rows + 1, *curves[0].coefficients.shape[2:]))
        for law, one in enumerate(curves):
            own = one.knots.shape[1]
            knots[law, :own] = one.knots[0]
            origins[law, : own + 1] = one.origins[0]
            pieces[law, : own + 1] = one.coefficients[0]
        return cls(knots, origins, pieces)

    def cut(self, rows: int) -> LawCurves:
        """Return the curves of a single law through its first rows, with their tangents beyond."""
        if rows == self.knots.shape[1]:
            return self
        pieces = self.coefficients[:, : rows + 1].copy()
        pieces[:, rows, :2] = 0.0
        return LawCurves(self.knots[:, :rows], self.origins[:, : rows + 1], pieces)

    def rows_passed(self, law: Indices | int, approach: Array) -> Indices:
        """Return how many rows of laws lie at or before approaches, shape (m,).

        Args:
            law: Index of the law of every approach, or the law of all.
            approach: Local approaches, shape (m,) [mm].
        """
        return np.asarray((self.knots[law] <= approach[:, None]).sum(axis=1))

    def at(
        self, law: Indices | int, approach: Array, functions: slice = slice(None)
    ) -> tuple[Array, Array]:
        """Return values and derivatives of functions at approaches, shapes (f, m)."""
        piece = self.rows_passed(law, approach)
        return self.within(law, piece, approach - self.origins[law, piece], functions)

    def within(
        self, law: Indices | int, piece: Indices, distance: Array, functions: slice = slice(None)
    ) -> tuple[Array, Array]:
        """Return values and derivatives at distances from the origins of pieces, (f, m)."""
        pieces = self.coefficients[..., functions][law, piece]
        return _horner(pieces.transpose(1, 2, 0), distance)

    def inverted(self, function: int, values: Array, targets: Array) -> tuple[Indices, Array]:
        """Find where a function of a single law takes given values.

        Newton's steps, halved where they would leave the bracket, end at rounding. All targets are
        found together: a finite element mesh asks for thousands at once.

        Args:
            function: Which function.
            values: Its values at the first rows, increasing, shape (k,).
            targets: Values from the first to the last of those, shape (m,).

        Returns:
            Pieces, and distances from their origins [mm], shape (m,).
        """
        piece = np.clip(np.searchsorted(values, targets, side="right"), 1, len(values) - 1)
        rows, rise = self.knots[0], targets - values[piece - 1]
        cubic = self.coefficients[0, piece, :, function].T.copy()
        cubic[3] = -rise
        low, high = np.zeros_like(targets), rows[piece] - rows[piece - 1]
        distance = rise / (values[piece] - values[piece - 1]) * high
        for _ in range(_MOST_STEPS):
            residual, slope = _horner(cubic, distance)
            low = np.where(residual < 0.0, distance, low)
            high = np.where(residual > 0.0, distance, high)
            newton = distance - residual / np.maximum(slope, LEAST_SLOPE)
            inside = (newton >= low) & (newton <= high)
            step = np.where(inside, newton, 0.5 * (low + high))
            converged = np.all(np.abs(step - distance) <= _ROUNDING * step)
            distance = step
            if converged:
                break
        return piece, distance


def _horner(powers: Array, t: Array) -> tuple[Array, Array]:
    a, b, c, d = powers
    return ((a * t + b) * t + c) * t + d, (3.0 * a * t + 2.0 * b) * t + c
