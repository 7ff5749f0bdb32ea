"""Cubic interpolants of patch laws over the local approach, for one law or for many at once.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

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

    They are closure, p^(2/3), area fraction, mean separation and number of contacts. The pieces of
    all laws stand one after another. The first piece of a law holds before its first row. Its last
    one continues the tangents beyond the last row.

    Attributes:
        first: Index of the first piece of each law, and the number of all pieces, shape (N + 1,).
        starts: Approaches that the n pieces begin at, shape (n,) [mm]; −∞ for the first of a law.
        origins: Approaches that they count from, shape (n,) [mm].
        widths: Their widths, shape (n,) [mm]; 0 for the first and the last of a law, which are
            straight and have no end.
        coefficients: Coefficients of the powers 3 … 0, shape (n, 4, 5).
    """

    first: Indices
    starts: Array
    origins: Array
    widths: Array
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
            cubic = scipy.interpolate.PchipInterpolator(rows.approach, values)
            pieces[0, 3, :4] = values[0]
            pieces[1:-1, :, :4] = np.moveaxis(cubic.c, 0, 1)
            pieces[-1, 2:, :4] = cubic(rows.approach[-1], 1), values[-1]
            pieces[1:, 3, 4] = rows.contacts
        pieces[..., 3] -= pieces[..., 0]  # from the unresolved displacement to the separation
        pieces[:, 3, 3] += initial_separation
        widths = np.zeros(len(pieces))
        widths[1:-1] = np.diff(rows.approach)
        return cls(
            first=np.array([0, len(pieces)]),
            starts=np.append(-np.inf, rows.approach),
            origins=np.append(rows.approach[:1] if len(rows) else 0.0, rows.approach),
            widths=widths,
            coefficients=pieces,
        )

    @classmethod
    def packed(cls, curves: Sequence[LawCurves]) -> LawCurves:
        """Return the curves of many laws as one."""
        counts = [len(one.starts) for one in curves]
        whole = (
            np.concatenate([getattr(one, name) for one in curves])
            for name in ("starts", "origins", "widths", "coefficients")
        )
        return cls(np.concatenate([[0], np.cumsum(counts)]), *whole)

    def cut(self, rows: int) -> LawCurves:
        """Return the curves of a single law through its first rows, with their tangents beyond."""
        end = rows + 1
        pieces, widths = self.coefficients[:end].copy(), self.widths[:end].copy()
        pieces[rows, :2], widths[rows] = 0.0, 0.0
        return LawCurves(np.array([0, end]), self.starts[:end], self.origins[:end], widths, pieces)

    def at(self, law: Indices | int, approach: Array) -> LawPoint:
        """Return what laws give at local approaches, in their shape.

        Args:
            law: Index of the law of every approach, or the law of all.
            approach: Local approaches [mm].
        """
        piece = self._pieces(self.starts, law, approach)
        return self._within(piece, approach - self.origins[piece])

    def at_closure(self, law: Indices | int, closures: Array) -> LawPoint:
        """Return what laws, whose closures rise from row to row, give at closures.

        Newton's steps, halved where they would leave the bracket, end at rounding. All closures are
        inverted together: a finite element mesh asks for thousands at once.

        Args:
            law: Index of the law of every closure, or the law of all.
            closures: Closures, of any shape [mm].
        """
        rows = np.where(np.isinf(self.starts), -np.inf, self.coefficients[:, 3, 0])
        piece = self._pieces(rows, law, closures)
        a, b, c, d = np.moveaxis(self.coefficients[piece, :, 0], -1, 0)
        d, widths = d - closures, self.widths[piece]
        distance = -d / np.maximum((a * widths + b) * widths + c, _LEAST_SLOPE)
        low = np.where(widths == 0.0, distance, 0.0)
        high = low + widths
        for _ in range(_MOST_STEPS):
            residual, slope = _horner((a, b, c, d), distance)
            low = np.where(residual < 0.0, distance, low)
            high = np.where(residual > 0.0, distance, high)
            newton = distance - residual / np.maximum(slope, _LEAST_SLOPE)
            inside = (newton >= low) & (newton <= high)
            before, distance = distance, np.where(inside, newton, 0.5 * (low + high))
            if np.all(np.abs(distance - before) <= _ROUNDING * np.abs(distance)):
                break
        return self._within(piece, distance)

    def _pieces(self, begin: Array, law: Indices | int, values: Array) -> Indices:
        """Return the last pieces of laws that begin at values or below, in their shape."""
        low, high = (np.broadcast_to(self.first[law + i], values.shape) for i in (0, 1))
        while np.any(high - low > 1):
            middle = (low + high) // 2
            above = begin[middle] <= values
            low, high = np.where(above, middle, low), np.where(above, high, middle)
        return low

    def _within(self, piece: Indices, distance: Array) -> LawPoint:
        """Return what laws give at distances from the origins of pieces, in their shape [mm]."""
        powers = np.moveaxis(self.coefficients[piece], (-2, -1), (0, 1))
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


def _horner(powers: Iterable[Array], t: Array) -> tuple[Array, Array]:
    a, b, c, d = powers
    return ((a * t + b) * t + c) * t + d, (3.0 * a * t + 2.0 * b) * t + c
