"""Cubic interpolants of patch laws over the local approach, for one law or for many at once.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from multiscale.laws.rows import LawRows

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_LEAST_SLOPE = 1e-6
"""Slope of the closure over the approach that is treated as the end of its rise."""

_ROUNDING = 1e-14
_MOST_STEPS = 80
"""Steps of an inversion at most; bisection alone takes 53 to rounding."""


class LawPoint(NamedTuple):
    """What patch laws give at local approaches or closures; every field has the same shape.

    Attributes:
        closure: Closures [mm].
        pressure: Mean pressures of the patches [MPa].
        dclosure: Derivative of the closure over the local approach.
        dpressure: Derivative of the pressure over the local approach [MPa/mm].
        contact_area_fraction: Real over nominal contact areas.
        separation: Mean gaps between the plane and the displaced surface [mm].
        contacts: Numbers of contacts in the last rows before.
    """

    closure: Array
    pressure: Array
    dclosure: Array
    dpressure: Array
    contact_area_fraction: Array
    separation: Array
    contacts: NDArray[np.int64]

    @property
    def stiffness(self) -> Array:
        """Derivative of the pressure over the closure [MPa/mm]."""
        return np.asarray(self.dpressure / np.maximum(self.dclosure, _LEAST_SLOPE))


@dataclass(frozen=True, slots=True, eq=False)
class LawCurves:
    """The interpolants of N laws: piecewise cubic functions of the local approach.

    They are closure, p^(2/3), area fraction, mean separation and number of contacts. The first
    piece holds before the first row of a law. The last one continues the tangents beyond the last
    row.

    Attributes:
        knots: Approaches of the rows, padded by infinity, shape (N, n) [mm].
        origins: Approaches that the pieces count from, shape (N, n + 1) [mm].
        coefficients: Coefficients of the powers 3 … 0, shape (N, n + 1, 4, 5).
    """

    knots: Array
    origins: Array
    coefficients: Array

    @classmethod
    def through(cls, rows: LawRows, initial_separation: float) -> LawCurves:
        """Interpolate the rows of one law monotonically (PCHIP).

        Args:
            rows: The rows; none for an open law.
            initial_separation: Mean separation at zero approach [mm].

        Source:
            Fritsch & Butland 1984, doi 10.1137/0905021.
        """
        pieces = np.zeros((len(rows) + 1, 4, 5))
        pieces[0, 2, 0] = 1.0  # before first touch the closure grows as the approach
        if len(rows):
            power = rows.pressure ** (2 / 3)
            smooth = rows.closure, power, rows.contact_area_fraction, rows.unresolved_displacement
            values = np.column_stack(smooth).astype(np.float64)
            cubic = PchipInterpolator(rows.approach, values)
            pieces[0, 3, :4] = values[0]
            pieces[1:-1, :, :4] = np.moveaxis(cubic.c, 0, 1)
            pieces[-1, 2:, :4] = cubic(rows.approach[-1], 1), values[-1]
            pieces[1:, 3, 4] = rows.contacts
        pieces[..., 3] -= pieces[..., 0]  # from the unresolved displacement to the separation
        pieces[:, 3, 3] += initial_separation
        origins = np.append(rows.approach[:1] if len(rows) else 0.0, rows.approach)
        return cls(rows.approach[None], origins[None], pieces[None])

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
        pieces = self.coefficients[:, : rows + 1].copy()
        pieces[:, rows, :2] = 0.0
        return LawCurves(self.knots[:, :rows], self.origins[:, : rows + 1], pieces)

    def at(self, law: Indices | int, approach: Array) -> LawPoint:
        """Return what laws give at local approaches, in their shape.

        Args:
            law: Index of the law of every approach, or the law of all.
            approach: Local approaches [mm].
        """
        piece = (self.knots[law] <= approach[..., None]).sum(axis=-1)
        return self.within(law, piece, approach - self.origins[law, piece])

    def within(self, law: Indices | int, piece: Indices, distance: Array) -> LawPoint:
        """Return what laws give at distances from the origins of pieces, in their shape [mm]."""
        powers = np.moveaxis(self.coefficients[law, piece], (-2, -1), (0, 1))
        values, slopes = _horner(powers, distance)
        power = np.maximum(values[1], 0.0)
        root = np.sqrt(power)
        return LawPoint(
            closure=values[0],
            pressure=root * power,
            dclosure=slopes[0],
            dpressure=1.5 * root * slopes[1],
            contact_area_fraction=np.clip(values[2], 0.0, 1.0),
            separation=values[3],
            contacts=values[4].astype(np.int64),
        )

    def at_closure(self, closures: Array) -> LawPoint:
        """Return what a single law, whose closure rises from row to row, gives at closures.

        Newton's steps, halved where they would leave the bracket, end at rounding. All closures are
        inverted together: a finite element mesh asks for thousands at once.

        Args:
            closures: Closures, of any shape [mm].
        """
        rows = self.coefficients[0, 1:, 3, 0]
        piece = np.searchsorted(rows, closures, side="right")
        cubic = np.moveaxis(self.coefficients[0, piece, :, 0], -1, 0).copy()
        cubic[3] -= closures
        widths = np.concatenate(([0.0], np.diff(self.knots[0]), [0.0]))[piece]
        rises = np.concatenate(([1.0], np.diff(rows), [1.0]))[piece]
        straight = (piece == 0) | (piece == len(rows))
        slopes = np.where(straight, np.maximum(cubic[2], _LEAST_SLOPE), 1.0)
        low = np.where(straight, -cubic[3] / slopes, 0.0)
        high = low + widths
        distance = low - cubic[3] / rises * widths
        for _ in range(_MOST_STEPS):
            residual, slope = _horner(cubic, distance)
            low = np.where(residual < 0.0, distance, low)
            high = np.where(residual > 0.0, distance, high)
            newton = distance - residual / np.maximum(slope, _LEAST_SLOPE)
            inside = (newton >= low) & (newton <= high)
            before, distance = distance, np.where(inside, newton, 0.5 * (low + high))
            if np.all(np.abs(distance - before) <= _ROUNDING * np.abs(distance)):
                break
        return self.within(0, piece, distance)


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


def _horner(powers: Array, t: Array) -> tuple[Array, Array]:
    a, b, c, d = powers
    return ((a * t + b) * t + c) * t + d, (3.0 * a * t + 2.0 * b) * t + c
