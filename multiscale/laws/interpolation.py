"""Cubic interpolants of patch laws over the local approach, for one law or for many at once.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.multiscale.laws.rows import LawRows, Untouched
from patchlaw.support import Array, Counts, Flags, Indices

LEAST_SLOPE = 1e-6
"""Slope of the closure over the approach that is treated as the end of its rise."""

_LEAST_GAP = 1e-6
"""Mean gap over that at first touch that counts as none: solutions know no smaller ones."""
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
        dseparation: Derivative of the separation over the local approach.
        contacts: Numbers of contacts in the last rows before.
    """

    closure: Array
    pressure: Array
    dclosure: Array
    dpressure: Array
    contact_area_fraction: Array
    separation: Array
    dseparation: Array
    contacts: Counts

    @property
    def stiffness(self) -> Array:
        """Derivative of the pressure over the closure [MPa/mm]."""
        return np.asarray(self.dpressure / np.maximum(self.dclosure, LEAST_SLOPE))

    @property
    def closing(self) -> Array:
        """Derivative of the mean gap over the closure, against its sign."""
        return np.asarray(-self.dseparation / np.maximum(self.dclosure, LEAST_SLOPE))


@dataclass(frozen=True, eq=False)
class LawCurves:
    """The interpolants of N laws: piecewise cubic functions of the local approach.

    They are closure, p^(2/3), area fraction, mean separation ū, −ln ū and number of contacts.
    Slopes of ū are those of −ln ū, as near full contact ū falls by orders of magnitude. The pieces
    of all laws stand one after another. Those before the first row of a law are straight, and the
    last one continues the tangents beyond the last row.

    Attributes:
        first: Index of the first piece of each law, and the number of all pieces, shape (N + 1,).
        starts: Approaches that the n pieces begin at, shape (n,) [mm]; −∞ for the first of a law.
        origins: Approaches that they count from, shape (n,) [mm].
        touched: Whether they begin at a row, shape (n,).
        widths: Their widths, shape (n,) [mm]; 0 for those that are straight.
        coefficients: Coefficients of the powers 3 … 0, shape (n, 4, 6).
        bearing: Largest mean pressures of the real contact, p over area fraction, at the ends of
            the pieces, which the interpolated area bears its load with, shape (n,) [MPa]. Under a
            hardness no row exceeds it.
        growth: What p^(2/3) grows by with −ln ū of the mean gap ū: at both ends of the pieces, and
            between, shape (n, 3) [MPa^(2/3)]. Interface stiffnesses are closer by it than by the
            quotient of the slopes of p and ū over the approach, whose errors add; and towards full
            contact ū falls by orders of magnitude while p hardly rises. NaN where the mean gap does
            not close.
    """

    first: Indices
    starts: Array
    origins: Array
    touched: Flags
    widths: Array
    coefficients: Array
    bearing: Array
    growth: Array

    @classmethod
    def through(
        cls,
        rows: LawRows,
        counts: ArrayLike,
        initial_separation: ArrayLike,
        untouched: Sequence[Untouched] = (),
    ) -> LawCurves:
        """Interpolate the rows of N laws monotonically (PCHIP).

        Args:
            rows: The rows of all laws, one law after another.
            counts: Number of rows of each, shape (N,); none of an open law.
            initial_separation: Mean separations at zero approach, shape (N,) [mm].
            untouched: What displaces the N patches before first touch; by default what displaces
                them there.

        Source:
            Fritsch & Butland 1984, doi 10.1137/0905021.
        """
        counts, starting = np.asarray(counts), np.asarray(initial_separation, dtype=float)
        law = np.repeat(np.arange(len(counts)), counts)
        end = np.cumsum(counts)
        some, begin = counts > 0, end - counts
        known = np.array([len(one) for one in untouched] or 0 * counts)
        leads = np.maximum(known, 1)
        place = np.arange(len(rows)) + np.cumsum(leads)[law]
        first = np.append(0, np.cumsum(leads + counts))
        pieces, touched = np.zeros((first[-1], 4, 6)), np.zeros(first[-1], bool)
        touched[place] = True
        pieces[~touched, 2, 0] = 1.0  # before first touch the closure grows as the approach
        gap = np.repeat(starting, counts) - rows.closure + rows.unresolved_displacement
        # the zero of closures may lie anywhere: over the gap at first touch
        least = _LEAST_GAP * np.repeat(np.abs(gap[begin[some]]), counts[some])
        power, moved = rows.pressure ** (2 / 3), rows.unresolved_displacement
        values = rows.closure, power, rows.contact_area_fraction, moved, _closed(gap, least)
        inner = np.flatnonzero(law[1:] == law[:-1])  # rows with another one behind them
        ends = begin[some], end[some] - 1
        pieces[place, :, :5] = _cubics(rows.approach, np.column_stack(values), inner, ends)
        pieces[place, 3, 5] = rows.contacts
        pieces[first[:-1][some], 3, :5] = pieces[place[begin[some]], 3, :5]
        starts, widths = np.full(len(pieces), -np.inf), np.zeros(len(pieces))
        starts[place], widths[place[inner]] = rows.approach, np.diff(rows.approach)[inner]
        origins = np.maximum(starts, 0.0)
        origins[place], origins[first[:-1][some]] = rows.approach, rows.approach[begin[some]]
        if known.any():
            ahead = np.zeros(len(counts))  # approach less closure, the same until first touch
            ahead[some] = (rows.approach - rows.closure)[begin[some]]
            lead = np.flatnonzero(~touched & np.repeat(known > 0, leads + counts))
            pieces[lead, 3, 0], pieces[lead, 3, 3], pieces[lead, 2, 3] = _lines_through(untouched)
            origins[lead] = pieces[lead, 3, 0] + np.repeat(ahead, known)
            later = lead[~np.isin(lead, first)]
            starts[later] = origins[later]
        pieces[..., 3] -= pieces[..., 0]  # from the unresolved displacement to the separation
        pieces[:, 3, 3] += np.repeat(starting, leads + counts)
        bearing = np.full(len(pieces), np.inf)
        bearing[place] = _bearing(rows, inner)
        growth = _growth(pieces, power, place, begin[some], end[some])
        return cls(first, starts, origins, touched, widths, pieces, bearing, growth)

    @cached_property
    def rising(self) -> LawCurves:
        """These curves up to where closure stops rising, with their tangents beyond."""
        closure, widths = self.coefficients[:, 3, 0].copy(), self.widths.copy()
        falls = np.flatnonzero((widths[:-1] > 0.0) & (np.diff(closure) <= 0.0))
        if not len(falls):
            return self
        behind = np.searchsorted(self.first, falls, side="right")  # the next law
        pieces, (laws, places) = self.coefficients.copy(), np.unique(behind, return_index=True)
        for last, end in zip(falls[places], self.first[laws], strict=True):
            pieces[last, :2], widths[last] = 0.0, 0.0
            pieces[last + 1 : end, 3, 0] = np.inf  # no closure lies there
        return replace(self, coefficients=pieces, widths=widths)

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

        All closures are inverted together: a finite element mesh asks for thousands at once.

        Args:
            law: Index of the law of every closure, or the law of all.
            closures: Closures, of any shape [mm].
        """
        rows = np.where(np.isinf(self.starts), -np.inf, self.coefficients[:, 3, 0])
        piece = self._pieces(rows, law, closures)
        a, b, c, d = np.moveaxis(self.coefficients[piece, :, 0], -1, 0)
        return self._within(piece, root_within((a, b, c, d - closures), self.widths[piece]))

    def interface_stiffness(self, law: Indices | int, point: LawPoint) -> Array:
        """Return the derivatives −dp/dū of the pressures over the mean gaps ū [MPa/mm].

        Args:
            law: Index of the law of every point, or the law of all.
            point: What the laws give there.
        """
        closed = np.where(self.touched, self.coefficients[:, 3, 4], -np.inf)
        here = _closed(point.separation, 0.0)
        piece = self._pieces(closed, law, here)
        later = np.minimum(piece + 1, len(closed) - 1)
        behind, ahead = closed[piece], closed[later]
        within = np.isfinite(behind) & np.isfinite(ahead) & (ahead > behind)
        width = np.subtract(ahead, behind, out=np.ones(within.shape), where=within)
        # at both ends the growth is constant
        share = np.where(within, (here - np.where(within, behind, 0.0)) / width, 0.0)
        one, other, secant = np.moveaxis(self.growth[piece], -1, 0)
        growth = one + share * (6.0 * secant - 4.0 * one - 2.0 * other)
        growth += share**2 * (3.0 * (one + other) - 6.0 * secant)
        quotient = point.dpressure / np.maximum(-point.dseparation, LEAST_SLOPE)
        known = (growth > 0.0) & np.isfinite(growth) & (point.separation > 0.0)
        by_gap = 1.5 * np.cbrt(point.pressure) * growth / np.where(known, point.separation, 1.0)
        return np.where(known, by_gap, quotient)

    def _pieces(self, begin: Array, law: Indices | int, values: Array) -> Indices:
        """Return the last pieces of laws that begin at values or below, in their shape."""
        if len(self.first) == 2:
            return np.searchsorted(begin, values, side="right") - 1
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
        pressure, bearing = root * power, self.bearing[piece]
        least = np.divide(pressure, bearing, out=np.zeros_like(pressure), where=bearing > 0.0)
        touched, ends = self.touched[piece], self.widths[piece] == 0.0
        closing = slopes[4] * np.exp(-np.where(ends, powers[3, 4], values[4]))
        return LawPoint(
            closure=values[0],
            pressure=pressure,
            dclosure=slopes[0],
            dpressure=1.5 * root * slopes[1],
            contact_area_fraction=np.clip(np.maximum(values[2], least), 0.0, 1.0),
            separation=values[3],
            dseparation=np.where(touched, -closing, slopes[3]),
            contacts=values[5].astype(np.int64),
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


def curves_from_touch(rows: LawRows) -> LawCurves:
    """Return the laws of K patches through rows of the whole surface, columns of shape (m, K)."""
    used, counts = rows.from_first_touch()
    return LawCurves.through(used, counts, np.zeros(len(counts)))


def rising_curves(rows: LawRows) -> LawCurves:
    """Return the laws of K patches alone through their rows, columns of shape (m, K)."""
    laws = rows.pressure.shape[1]
    if all((np.diff(part, axis=0) > 0.0).all() for part in (rows.pressure, rows.closure)):
        used, counts = rows.mapped(lambda part: part.T.ravel()), [len(rows)] * laws
    else:
        each = [rows[:, law].rising()[0] for law in range(laws)]
        used, counts = each[0].joined(*each[1:]), [len(one) for one in each]
    return LawCurves.through(used, counts, np.zeros(laws))


def _lines_through(untouched: Sequence[Untouched]) -> Array:
    """Return the lines before first touch, of all laws in turn, a constant before each law's first.

    Args:
        untouched: The rows that they pass through.

    Returns:
        Closures that the lines count from, displacements there [mm], and their slopes, (3, n).
    """
    at = np.concatenate([one.closure for one in untouched])
    displaced = np.concatenate([one.unresolved_displacement for one in untouched])
    counts = np.array([len(one) for one in untouched])
    later = np.ones(len(at), bool)
    later[(np.cumsum(counts) - counts)[counts > 0]] = False
    slopes = np.zeros(len(at))
    np.divide(np.diff(displaced), np.diff(at), out=slopes[1:], where=later[1:])
    begins = np.arange(len(at)) - later
    return np.array([at[begins], displaced[begins], slopes])


def _cubics(approach: Array, values: Array, inner: Indices, ends: tuple[Indices, Indices]) -> Array:
    """Return coefficients of the pieces that begin at rows, powers 3 … 0, shape (m, 4, k).

    Those that begin at the last row of a law are its tangent.

    Args:
        approach: Approaches of the rows of all laws, shape (m,) [mm].
        values: What is interpolated there, shape (m, k).
        inner: Rows with another one of their law behind them.
        ends: First and last rows of the laws.
    """
    width, secant = np.diff(approach)[inner, None], np.zeros_like(values)
    secant[inner] = np.diff(values, axis=0)[inner] / width
    slope = _pchip_slopes(approach, secant, *ends)
    found = np.zeros((len(values), 4, values.shape[1]))
    found[:, 3], found[:, 2] = values, slope
    bend = (slope[inner] + slope[inner + 1] - 2.0 * secant[inner]) / width
    found[inner, 0] = bend / width
    found[inner, 1] = (secant[inner] - slope[inner]) / width - bend
    return found


def _bearing(rows: LawRows, inner: Indices) -> Array:
    """Return `LawCurves.bearing` of the pieces that begin at rows, shape (m,) [MPa].

    Args:
        rows: The rows of all laws.
        inner: Rows with another one of their law behind them.
    """
    area = rows.contact_area_fraction
    each = np.divide(rows.pressure, area, out=np.full(len(rows), np.inf), where=area > 0.0)
    each[rows.pressure == 0.0] = 0.0
    found = each.copy()
    found[inner] = np.maximum(each[inner], each[inner + 1])
    return found


def _growth(pieces: Array, power: Array, place: Indices, first: Indices, end: Indices) -> Array:
    """Return `LawCurves.growth` of the pieces.

    Args:
        pieces: Coefficients of the pieces.
        power: Pressures of the rows to the power 2/3, shape (m,) [MPa^(2/3)].
        place: Pieces that begin at the rows, shape (m,).
        first: Indices of the first rows of the laws.
        end: Those behind their last ones.
    """
    growth, closed = np.zeros((len(pieces), 3)), pieces[place, 3, 4]
    inner = np.setdiff1d(np.arange(len(power)), end - 1)
    width = closed[inner + 1] - closed[inner]
    secant = np.zeros((len(power), 1))
    secant[inner, 0] = (power[inner + 1] - power[inner]) / np.where(width > 0.0, width, np.nan)
    slope = _pchip_slopes(closed, secant, first, end - 1)[:, 0]
    growth[place] = slope[:, None]
    growth[place[inner]] = np.column_stack([slope[inner], slope[inner + 1], secant[inner, 0]])
    return growth


def _closed(gap: Array, least: Array | float) -> Array:
    """Return −ln ū of mean gaps ū, which rises as they close; least gaps stand for smaller ones."""
    return np.asarray(-np.log(np.maximum(gap, np.maximum(least, np.finfo(float).tiny))))


def _pchip_slopes(approach: Array, secant: Array, first: Indices, last: Indices) -> Array:
    """Return the slopes of monotone interpolants at the rows of all laws, shape (n, 4).

    Args:
        approach: Approaches, shape (n,).
        secant: Slopes of the secants to the next row of the law, shape (n, 4).
        first: Indices of the first rows of the laws.
        last: Indices of their last ones.
    """
    width = np.append(np.diff(approach), 1.0)[:, None]
    slope = np.zeros_like(secant)
    within = np.ones(len(approach), bool)
    within[first] = within[last] = False
    here = np.flatnonzero(within)
    behind, ahead = secant[here - 1], secant[here]
    near, far = 2.0 * width[here] + width[here - 1], width[here] + 2.0 * width[here - 1]
    monotone = behind * ahead > 0.0
    mean = np.divide(near, behind, out=np.ones_like(behind), where=monotone)
    mean += np.divide(far, ahead, out=np.zeros_like(ahead), where=monotone)
    slope[here] = np.where(monotone, (near + far) / mean, 0.0)
    two = first[last == first + 1]
    slope[two] = slope[two + 1] = secant[two]
    many = last > first + 1
    head, tail = first[many], last[many]
    for at, one, other in ((head, head, head + 1), (tail, tail - 1, tail - 2)):
        slope[at] = _end_slopes(width[one], width[other], secant[one], secant[other])
    # towards full contact closures stop little by little: a slope of 0 would be a rigid end
    one, other = secant[tail - 1], secant[tail - 2]
    decays = (one > 0.0) & (other > one)
    least = np.divide(one**2, other, out=np.zeros_like(one), where=decays)
    slope[tail] = np.where(decays, np.maximum(slope[tail], least), slope[tail])
    return slope


def _end_slopes(width: Array, next_width: Array, secant: Array, next_secant: Array) -> Array:
    """Return slopes at the ends of interpolants from three rows each, without overshoot."""
    slope = ((2.0 * width + next_width) * secant - width * next_secant) / (width + next_width)
    slope = np.where(slope * secant > 0.0, slope, 0.0)
    steep = (secant * next_secant < 0.0) & (np.abs(slope) > 3.0 * np.abs(secant))
    return np.asarray(np.where(steep, 3.0 * secant, slope))


def root_within(powers: Sequence[Array], widths: Array | float) -> Array:
    """Return the roots of cubics that rise, in their shape, each between 0 and a width.

    Newton's steps, halved where they would leave the bracket, end at rounding. Of a straight piece
    without an end the width is 0.

    Args:
        powers: Coefficients of the powers 3 … 0.
        widths: The widths.
    """
    a, b, c, d = powers
    found = -d / np.maximum((a * widths + b) * widths + c, LEAST_SLOPE)
    low = np.where(np.equal(widths, 0.0), found, 0.0)
    high = low + widths
    for _ in range(_MOST_STEPS):
        residual, slope = _horner(powers, found)
        low = np.where(residual < 0.0, found, low)
        high = np.where(residual > 0.0, found, high)
        newton = found - residual / np.maximum(slope, LEAST_SLOPE)
        inside = (newton >= low) & (newton <= high)
        before, found = found, np.where(inside, newton, 0.5 * (low + high))
        if np.all(np.abs(found - before) <= _ROUNDING * np.abs(found)):
            break
    return found


def _horner(powers: Iterable[Array], t: Array) -> tuple[Array, Array]:
    a, b, c, d = powers
    return ((a * t + b) * t + c) * t + d, (3.0 * a * t + 2.0 * b) * t + c
