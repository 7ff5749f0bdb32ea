"""The interpolants of patch laws over the local approach: cubic pieces, for one law or many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]
Pieces = NDArray[np.intp]

FLATTEST = 1e-6
"""Slope of a closure that is as good as at the end of its rise."""

_ROUNDING = 1e-14
_MOST_STEPS = 80  # of an inversion; bisection alone takes 53


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """Piecewise cubic functions f of the local approach s, one row of them per law.

    A first piece goes on before the table, a last one along the tangents beyond it.

    Attributes:
        breaks: Approaches of the table's rows, padded by infinity, shape (N, n) [mm].
        left: Approaches that the pieces count from, shape (N, n + 1) [mm].
        coefficients: Of the powers 3 … 0, shape (N, n + 1, 4, f).
    """

    breaks: Array
    left: Array
    coefficients: Array

    @classmethod
    def through(cls, approach: Array, values: Sequence[Array], before: Sequence[float]) -> Curves:
        """Interpolate monotonically through rows (PCHIP).

        Args:
            approach: Increasing approaches, shape (n,) [mm]; none for a law without rows.
            values: For each function its values, shape (n,).
            before: For each function its slope before the first row.

        Source:
            Fritsch & Butland 1984, doi 10.1137/0905021.
        """
        rows = len(approach)
        left = np.concatenate((approach[:1], approach)) if rows else np.zeros(1)
        pieces = np.zeros((rows + 1, 4, len(values)))
        pieces[0, 2] = before
        if rows:
            columns = np.column_stack(values).astype(np.float64)
            cubic = PchipInterpolator(approach, columns)
            pieces[0, 3] = columns[0]
            pieces[1:-1] = np.moveaxis(cubic.c, 0, 1)
            pieces[-1, 2:] = cubic(approach[-1], 1), columns[-1]
        return cls(approach[None], left[None], pieces[None])

    @classmethod
    def packed(cls, curves: Sequence[Curves]) -> Curves:
        """Put the curves of many laws side by side."""
        rows = max(one.breaks.shape[1] for one in curves)
        breaks = np.full((len(curves), rows), np.inf)
        left = np.zeros((len(curves), rows + 1))
        pieces = np.zeros((len(curves), rows + 1, *curves[0].coefficients.shape[2:]))
        for law, one in enumerate(curves):
            own = one.breaks.shape[1]
            breaks[law, :own] = one.breaks[0]
            left[law, : own + 1] = one.left[0]
            pieces[law, : own + 1] = one.coefficients[0]
        return cls(breaks, left, pieces)

    def cut(self, rows: int) -> Curves:
        """Return a single law's curves through its first rows, with their tangents beyond."""
        if rows == self.breaks.shape[1]:
            return self
        pieces = self.coefficients[:, : rows + 1].copy()
        pieces[:, rows, :2] = 0.0
        return Curves(self.breaks[:, :rows], self.left[:, : rows + 1], pieces)

    def rows_passed(self, approach: Array) -> Pieces:
        """Return the number of rows at or before each law's approach, shape (N,)."""
        return np.asarray((self.breaks <= approach[:, None]).sum(axis=1))

    def at(self, approach: Array, functions: slice = slice(None)) -> tuple[Array, Array]:
        """Return values and derivatives of functions at one approach per law, shapes (f, N)."""
        law, piece = np.arange(len(approach)), self.rows_passed(approach)
        pieces = self.coefficients[..., functions][law, piece]
        return _cubic(pieces, approach - self.left[law, piece])

    def placed(self, approach: Array) -> tuple[Pieces, Array]:
        """Return the pieces of a single law that hold approaches, and how far into them, (m,)."""
        piece = np.searchsorted(self.breaks[0], approach, side="right")
        return piece, approach - self.left[0, piece]

    def of_one(self, piece: Pieces, into: Array) -> tuple[Array, Array]:
        """Return values and derivatives of a single law within its pieces, shapes (f, m)."""
        return _cubic(self.coefficients[0, piece], into)

    def inverted(self, function: int, values: Array, given: Array) -> tuple[Pieces, Array]:
        """Find where a function of a single law takes given values.

        Newton's steps, halved where they would leave the bracket, end at rounding.

        Args:
            function: Which function.
            values: Its values at the first rows, increasing, shape (k,).
            given: Values from the first to the last of those, shape (m,).

        Returns:
            Pieces, and how far into them [mm], shape (m,).
        """
        piece = np.clip(np.searchsorted(values, given, side="right"), 1, len(values) - 1)
        rows, rise = self.breaks[0], given - values[piece - 1]
        cubic = self.coefficients[0, piece, :, function].T.copy()
        cubic[3] = -rise
        low, high = np.zeros_like(given), rows[piece] - rows[piece - 1]
        into = rise / (values[piece] - values[piece - 1]) * high
        for _ in range(_MOST_STEPS):
            miss, slope = _horner(cubic, into)
            low, high = np.where(miss < 0.0, into, low), np.where(miss > 0.0, into, high)
            newton = into - miss / np.maximum(slope, FLATTEST)
            inside = (newton >= low) & (newton <= high)
            step = np.where(inside, newton, 0.5 * (low + high))
            done = np.all(np.abs(step - into) <= _ROUNDING * step)
            into = step
            if done:
                break
        return piece, into


def _cubic(pieces: Array, into: Array) -> tuple[Array, Array]:
    """Return values and derivatives of pieces (m, 4, f), shapes (f, m)."""
    return _horner(pieces.transpose(1, 2, 0), into)


def _horner(powers: Array, t: Array) -> tuple[Array, Array]:
    a, b, c, d = powers
    return ((a * t + b) * t + c) * t + d, (3.0 * a * t + 2.0 * b) * t + c
