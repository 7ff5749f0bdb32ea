"""Adds rows to patch laws where they are needed most, until the error between rows is small enough.

Every row but the first and the last is left out in turn. The laws without it would give another
load step there: on the half-space, under a plane at the same approach. The difference is computed
to first order. It counts the errors of pressure and of closure alike, by their effect on a load
step. The intervals on both sides of the row are taken to err by as much, for a kink, where a
contact begins or two join, may lie in either. A row that halves an interval tells the same of its
halves.

Between smooth rows that is too much. The largest part of an expected error that turned up when an
interval was halved is therefore taken to be the part of all others that are left.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from patchlaw.multiscale.laws.interpolation import LawCurves, LawPoint
from patchlaw.multiscale.laws.law_table import PATCH_FACTOR
from patchlaw.multiscale.laws.rows import LawRows
from patchlaw.support import Array, Indices

Curves = Callable[[LawRows], LawCurves]
"""From columns of rows, shape (m, K), to the laws through each of them."""

MOST_ROWS = 97
"""Rows that are solved at most by default."""

_FIRST_ROWS = 9
_LARGEST_FALL, _LEAST_GAP = float(np.log(2.0)), 1e-4
"""Logarithm of the ratio of the mean gaps of two rows that is not exceeded, down to this part of
the gap at first touch, below which its errors count."""
_BATCH = 8  # rows that are solved together, each starting from those before it
LEAST_LOAD = 0.03  # of the mean pressure at the end: smaller loads count as this much
_LEAST_SLOPE = 0.1  # of the closure over the approach, in a stiffness
_UNSEEN = 1.5
"""Factor on errors for kinks that no row has met. Without it forces between rows erred by up to 2.3
times what tables stated, by more than 1.5 times on 4 of 26 random surfaces."""
_BESIDE = 3  # rows on each side that a monotone interpolant depends on where one is left out


class Refined(NamedTuple):
    """Rows of the laws of N patches, and the errors between them.

    Attributes:
        rows: The rows, columns of shape (m, N).
        force: Error of the force over the force.
        pressure: Errors of the patches' pressures, shape (N,), see `errors_at`.
        stiffness: Errors of their stiffnesses, shape (N,).
    """

    rows: LawRows
    force: float
    pressure: Array
    stiffness: Array

    def of_law(self, index: int) -> dict[str, Any]:
        """Return the errors of one law by their names in `PatchLaw`."""
        pressure, stiffness = float(self.pressure[index]), float(self.stiffness[index])
        return {"interpolation_error": pressure, "stiffness_error": stiffness}


class RowMaker(NamedTuple):
    """How the rows of N laws are made.

    Attributes:
        solve: Returns the rows at approaches of shape (m,), columns of shape (m, N).
        curves: Returns the laws through rows, in the order of the approaches.
        compliance: Mean displacement of patch i of the half-space by unit pressure on patch j,
            shape (N, N) [mm/MPa].
        initial_separation: Mean separations of the patches at zero approach, shape (N,) [mm]; NaN
            where gaps do not matter.
    """

    solve: Callable[[Array], LawRows]
    curves: Curves
    compliance: Array
    initial_separation: Array | float = np.nan


def errors_at(
    guess: LawPoint,
    stiffness: Array,
    rows: LawRows,
    compliance: Array,
    least: float,
    touched: Indices,
) -> Array:
    """Return the errors of the laws of N patches at n rows that they were made without.

    A load below 3 % of the load at the end of the table counts as 3 % of it, so that small loads
    near first touch do not take all rows.

    Args:
        guess: What the laws of touched patches give at the approaches of the rows, (n, L) each.
        stiffness: dp/dδ of the laws with the rows, shape (n, L) [MPa/mm].
        rows: The rows, columns of shape (n, N).
        compliance: Compliance of the patches of the half-space, shape (N, N) [mm/MPa].
        least: Least mean pressure that errors are relative to [MPa].
        touched: Indices of L patches, those that touch among them; the others do not err.

    Returns:
        Errors of the force over the force; of the N pressures over these, or over the mean pressure
        of all patches that carry load where that is more; and of the N dp/dδ under a plane at δ,
        over the largest of all patches there; shape (n, 1 + 2 N).
    """
    every, rows, compliance = len(compliance), rows[:, touched], _among(compliance, touched)
    # where a patch loses load to its neighbours, nothing may change with its approach
    lacking = _LEAST_SLOPE - guess.dclosure - np.diag(compliance) * guess.dpressure
    guess = guess._replace(dclosure=guess.dclosure + np.maximum(lacking, 0.0))
    wrong = guess.pressure - rows.pressure
    residual = guess.closure - rows.closure + wrong @ compliance.T
    for row, rates in enumerate(guess.dpressure):
        some = np.flatnonzero(rates)  # no other patch moves any but itself
        tangent = _among(compliance, some) * rates[some] + np.diag(guess.dclosure[row, some])
        wrong[row, some] -= rates[some] * np.linalg.solve(tangent, residual[row, some])
    pressure = rows.pressure
    load = np.maximum(pressure.sum(axis=1) / every, least)
    carrying = pressure.sum(axis=1) / np.maximum((pressure > 0.0).sum(axis=1), 1)
    scale = np.maximum(pressure, np.maximum(carrying, load)[:, None])
    change = np.abs(_stiffness(guess, compliance) - stiffness)
    largest = stiffness.max(axis=1, keepdims=True)
    errors = np.zeros((len(rows), 1 + 2 * every))
    errors[:, 0] = np.abs(wrong.sum(axis=1)) / every / load
    errors[:, 1 + touched] = np.abs(wrong) / scale
    errors[:, 1 + every + touched] = change / np.where(largest > 0.0, largest, 1.0)
    return errors


def _among(compliance: Array, patches: Indices) -> Array:
    """Return the compliance of some patches, by their indices."""
    return compliance[np.ix_(patches, patches)]


def _worst(errors: Array) -> Array:
    """Return what is compared to the tolerance of the force, shape (n,)."""
    patches = errors.shape[1] // 2
    return np.asarray(
        np.maximum(errors[:, 0], errors[:, 1 : 1 + patches].max(axis=1) / PATCH_FACTOR)
    )


def refined(
    make: RowMaker,
    start: float,
    end: float,
    tolerance: float,
    most_rows: int = MOST_ROWS,
    earlier: Array | None = None,
) -> Refined:
    """Solve rows, and halve the intervals of largest error until all errors are small enough.

    Intervals along which the mean gap of all patches falls by orders of magnitude, as towards full
    contact, are halved, too: interface stiffnesses are read off there.

    The first rows lie closer where the load is small: their distances grow linearly.

    Args:
        make: How rows are made.
        start: Approach of the first row [mm].
        end: Approach of the last row, or of the only one where it is not beyond the first [mm].
        tolerance: Error of the force; that of a patch's pressure may be twenty times as large, see
            `errors_at`.
        most_rows: Rows that may be solved, 9 at least. The errors then state what was reached.
        earlier: Approaches of the rows of laws that end before, from first touch on [mm]; they stay
            rows, however many there may be.
    """
    solve, curves, compliance, initial_separation = make
    approaches = start + (end - start) * np.linspace(0.0, 1.0, _FIRST_ROWS) ** 2
    if earlier is not None:
        approaches = np.append(earlier, approaches[approaches > earlier[-1]])
    rows = solve(approaches if end > start else approaches[-1:])
    patches = rows.pressure.shape[1]
    if end <= start or not rows.pressure[-1].any():
        return Refined(rows, 0.0, np.zeros(patches), np.zeros(patches))
    least = LEAST_LOAD * float(rows.pressure[-1].mean())
    laws, part, found = curves(rows), 0.0, np.zeros(0)
    halved = np.zeros((len(rows) - 1, 1 + 2 * patches))
    while True:
        left_out = _left_out(curves, laws, rows, compliance, least)
        # of intervals, by their halving and by the rows on both sides
        expected = np.maximum(halved, np.maximum(left_out[:-1], left_out[1:]))
        part = _UNSEEN * float(min(found.max(initial=0.0), 1.0) if len(found) else 1.0)
        falls = _falls(rows, initial_separation) / _LARGEST_FALL
        worst = np.maximum(part * _worst(expected), tolerance * falls)
        budget = max(min(_BATCH, most_rows - len(rows)), 0)
        order = np.argsort(-worst, kind="stable")
        split = np.sort(order[: min(budget, int(np.sum(worst > tolerance)))])
        if not len(split):
            break
        # micro models prefer rising approaches
        middle = 0.5 * (approaches[split] + approaches[split + 1])
        new = solve(middle)
        before, approaches = laws, np.insert(approaches, split + 1, middle)
        order = np.argsort(np.append(np.arange(len(rows)), split + 0.5))
        rows = rows.joined(new)[order]
        laws, place = curves(rows), split + 1 + np.arange(len(split))
        touched = np.flatnonzero(rows.pressure.any(axis=0))  # most stay open
        guess, point = (each.at(touched, new.approach[:, touched]) for each in (before, laws))
        stiffness = _stiffness(point, _among(compliance, touched))
        errors = errors_at(guess, stiffness, new, compliance, least, touched)
        wrong, awaited = _worst(errors), _worst(expected)[split]
        # where laws are exact, as in full contact, an interval is halved for its gap alone
        exact = (wrong > 0.0).astype(float)
        found = np.append(found, np.divide(wrong, awaited, out=exact, where=awaited > 0.0))
        halved = np.insert(halved, split + 1, errors, axis=0)
        halved[place - 1] = errors
    force, *each = (part * expected.max(axis=0)).tolist()
    pressure, stiffness = np.reshape(each, (2, -1))
    return Refined(rows, force, pressure, stiffness)


def _falls(rows: LawRows, initial_separation: Array | float) -> Array:
    """Return the logarithms of the ratios of mean gaps of all patches in intervals, 0 if unknown.

    Args:
        rows: The rows, columns of shape (m, N).
        initial_separation: See `RowMaker`.
    """
    gap = (initial_separation - rows.closure + rows.unresolved_displacement).mean(axis=1)
    return np.nan_to_num(-np.diff(np.log(np.maximum(gap, _LEAST_GAP * (abs(gap[0]) or 1.0)))))


def _left_out(
    curves: Curves, laws: LawCurves, rows: LawRows, compliance: Array, least: float
) -> Array:
    """Return the errors at rows of laws made without them; none at the first and the last row.

    Args:
        curves: Returns the laws through rows.
        laws: The laws through all rows.
        rows: The rows, columns of shape (m, N).
        compliance: Compliance of the patches of the half-space, shape (N, N) [mm/MPa].
        least: Least mean pressure that errors are relative to [MPa].
    """
    count = len(rows)
    inner, width = np.arange(1, count - 1), min(2 * _BESIDE + 1, count)
    first = np.clip(inner - _BESIDE, 0, count - width)
    window = first[:, None] + np.arange(width)
    window = window[window != inner[:, None]].reshape(len(inner), width - 1)
    touched, own = np.flatnonzero(rows.pressure.any(axis=0)), rows[inner]
    without = curves(
        rows[:, touched].mapped(lambda each: np.moveaxis(each[window], 1, 0).reshape(width - 1, -1))
    )
    approach, law = own.approach[:, touched], np.arange(len(inner) * len(touched))
    stiffness = _stiffness(laws.at(touched, approach), _among(compliance, touched))
    guess = without.at(law.reshape(-1, len(touched)), approach)
    errors = errors_at(guess, stiffness, own, compliance, least, touched)
    return np.pad(errors, ((1, 1), (0, 0)))


def _stiffness(point: LawPoint, compliance: Array) -> Array:
    """Return dp/dδ of every patch as if its neighbours' pressures stayed, shape (…, N)."""
    slope = point.dclosure + np.diag(compliance) * point.dpressure
    return np.asarray(point.dpressure / np.maximum(slope, _LEAST_SLOPE))
