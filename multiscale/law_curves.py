"""The interpolants of patch laws over the local approach: cubic pieces, for one law or many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """Piecewise cubic functions f of the local approach s, one row of them per law.

    A first piece goes on before the table, a last one along the tangents beyond it.

    Attributes:
        breaks: Approaches of the table's rows, padded by infinity, shape (N, n) [mm].
        left: Approaches that the pieces count from, shape (N, n + 1) [mm].
        coefficients: Of the powers 3 … 0, shape (f, 4, N, n + 1).
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
        pieces = np.zeros((len(values), 4, 1, rows + 1))
        for piece, value, slope in zip(pieces[:, :, 0], values, before, strict=True):
            piece[2, 0] = slope
            if rows:
                cubic = PchipInterpolator(approach, value)
                piece[3, 0] = value[0]
                piece[:, 1:-1] = cubic.c
                piece[2:, -1] = cubic(approach[-1], 1), value[-1]
        return cls(approach[None], left[None], pieces)

    @classmethod
    def packed(cls, curves: Sequence[Curves]) -> Curves:
        """Put the curves of many laws side by side."""
        rows = max(one.breaks.shape[1] for one in curves)
        breaks = np.full((len(curves), rows), np.inf)
        left = np.zeros((len(curves), rows + 1))
        functions = curves[0].coefficients.shape[0]
        pieces = np.zeros((functions, 4, len(curves), rows + 1))
        for law, one in enumerate(curves):
            own = one.breaks.shape[1]
            breaks[law, :own] = one.breaks[0]
            left[law, : own + 1] = one.left[0]
            pieces[:, :, law, : own + 1] = one.coefficients[:, :, 0]
        return cls(breaks, left, pieces)

    def rows_passed(self, approach: Array) -> NDArray[np.intp]:
        """Return the number of rows at or before each law's approach, shape (N,)."""
        return np.asarray((self.breaks <= approach[:, None]).sum(axis=1))

    def at(self, approach: Array) -> tuple[Array, Array]:
        """Return values and derivatives at one approach per law, shapes (f, N)."""
        return self._pieces_at(np.arange(len(approach)), self.rows_passed(approach), approach)

    def of_one(self, approach: Array) -> tuple[Array, Array]:
        """Return values and derivatives of a single law at approaches (m,), shapes (f, m)."""
        piece = np.searchsorted(self.breaks[0], approach, side="right")
        return self._pieces_at(np.zeros_like(piece), piece, approach)

    def _pieces_at(
        self, law: NDArray[np.intp], piece: NDArray[np.intp], approach: Array
    ) -> tuple[Array, Array]:
        t = approach - self.left[law, piece]
        a, b, c, d = np.moveaxis(self.coefficients[:, :, law, piece], 1, 0)
        return ((a * t + b) * t + c) * t + d, (3.0 * a * t + 2.0 * b) * t + c
