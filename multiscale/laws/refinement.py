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
from dataclasses import dataclass, fields
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from patchlaw.multiscale.laws.interpolation import LawCurves, LawPoint, Tangent
from patchlaw.multiscale.laws.law_table import PATCH_FACTOR
from patchlaw.multiscale.laws.rows import LawRows as SolvedRows
from patchlaw.support.arrays import Array, Indices

Curves = Callable[[SolvedRows], LawCurves]
"""From columns of rows, shape (m, K), to the laws through each of them."""

MOST_ROWS = 97
"""Rows that are solved at most by default."""

ROW_ERROR = 5e-4
"""Error of a force at a row over that between rows. With a tolerance of 2e-3 it was up to 3e-6 on
three surfaces; with rows solved to rounding they take a third longer."""

_FIRST_ROWS = 9
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
        pressure: Errors of the patches' pressures, shape (N,), see `Errors`.
        stiffness: Errors of their stiffnesses, shape (N,).
    """

    rows: SolvedRows
    force: float
    pressure: Array
    stiffness: Array

    def of_law(self, index: int) -> dict[str, float]:
        """Return the errors of one law by their names in `PatchLaw`."""
        pressure, stiffness = float(self.pressure[index]), float(self.stiffness[index])
        return {"interpolation_error": pressure, "stiffness_error": stiffness}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Errors:
    """Errors of the laws of N patches at n rows that the laws were made without.

    A load below 3 % of the load at the end of the table counts as 3 % of it, so that small loads
    near first touch do not take all rows.

    Attributes:
        force: Errors of the force over the force, shape (n,).
        pressure: Errors of the patches' pressures over these, or over the mean pressure of all
            patches that carry load where that is more, shape (n, N).
        stiffness: Errors of the patches' dp/dδ under a plane at δ, over the largest of all patches
            there, shape (n, N).
    """

    force: Array
    pressure: Array
    stiffness: Array

    @classmethod
    def of(
        cls, guess: LawPoint, stiffness: Array, rows: SolvedRows, compliance: Array, least: float
    ) -> Self:
        """Return the errors of laws at rows.

        Args:
            guess: What the laws give at the approaches of the rows, fields of shape (n, N).
            stiffness: dp/dδ of the laws with the rows, shape (n, N) [MPa/mm].
            rows: The rows, columns of shape (n, N).
            compliance: Compliance of the patches of the half-space, shape (N, N) [mm/MPa].
            least: Least mean pressure that errors are relative to [MPa].
        """
        # where a patch loses load to its neighbours, nothing may change with its approach
        lacking = _LEAST_SLOPE - guess.dclosure - np.diag(compliance) * guess.dpressure
        guess = guess._replace(dclosure=guess.dclosure + np.maximum(lacking, 0.0))
        wrong = guess.pressure - rows.pressure
        residual = guess.closure - rows.closure + wrong @ compliance.T
        for row in range(len(rows)):
            point = LawPoint(*(field[row] for field in guess))
            moved = Tangent.of(point, compliance).solve(residual[row])
            wrong[row] -= point.dpressure * moved
        pressure = rows.pressure
        load = np.maximum(pressure.mean(axis=1), least)
        carrying = pressure.sum(axis=1) / np.maximum((pressure > 0.0).sum(axis=1), 1)
        scale = np.maximum(pressure, np.maximum(carrying, load)[:, None])
        change = np.abs(_stiffness(guess, compliance) - stiffness)
        largest = stiffness.max(axis=1, keepdims=True)
        return cls(
            force=np.abs(wrong.mean(axis=1)) / load,
            pressure=np.abs(wrong) / scale,
            stiffness=change / np.where(largest > 0.0, largest, 1.0),
        )

    def mapped(self, function: Callable[..., Array], *others: Errors) -> Errors:
        """Return errors whose arrays are a function of those of these and of others."""
        every = (self, *others)
        return Errors(
            **{
                each.name: function(*(getattr(one, each.name) for one in every))
                for each in fields(self)
            }
        )

    def with_rows(self, behind: Indices, others: Errors) -> Errors:
        """Return these errors with others, each behind the one of an index, (n,) of them."""
        return self.mapped(lambda old, new: np.insert(old, behind + 1, new, axis=0), others)

    def put(self, where: Indices, others: Errors) -> Errors:
        """Return these errors with others in some places, (n,) of them."""
        return self.mapped(lambda old, new: _put(old, where, new), others)

    @property
    def worst(self) -> Array:
        """The errors that are compared to the tolerance of the force, shape (n,)."""
        return np.maximum(self.force, self.pressure.max(axis=1) / PATCH_FACTOR)


def refined(
    solve: Callable[[Array], SolvedRows],
    curves: Curves,
    start: float,
    end: float,
    *,
    compliance: Array,
    tolerance: float,
    most_rows: int = MOST_ROWS,
) -> Refined:
    """Solve rows, and halve the intervals of largest error until all errors are small enough.

    The first rows lie closer where the load is small: their distances grow linearly.

    Args:
        solve: Returns the rows of N patches at approaches of shape (m,), columns of shape (m, N).
        curves: Returns the laws through rows, in the order of the approaches.
        start: Approach of the first row [mm].
        end: Approach of the last row, or of the only one where it is not beyond the first [mm].
        compliance: Mean displacement of patch i of the half-space by unit pressure on patch j,
            shape (N, N) [mm/MPa].
        tolerance: Error of the force; that of a patch's pressure may be twenty times as large, see
            `Errors`.
        most_rows: Rows that may be solved, 9 at least. The errors then state what was reached.
    """
    approaches = start + (end - start) * np.linspace(0.0, 1.0, _FIRST_ROWS) ** 2
    rows = solve(approaches if end > start else approaches[-1:])
    patches = np.arange(rows.pressure.shape[1])
    if end <= start or not rows.pressure[-1].any():
        return Refined(rows, 0.0, np.zeros(len(patches)), np.zeros(len(patches)))
    least = LEAST_LOAD * float(rows.pressure[-1].mean())
    laws, part, found = curves(rows), 0.0, np.zeros(0)
    left_out = _left_out(curves, laws, rows, np.arange(len(rows)), compliance, least)
    halved = left_out.mapped(lambda errors: np.zeros_like(errors[1:]))
    while True:
        expected = halved.mapped(_largest, left_out)
        part = _UNSEEN * float(min(found.max(initial=0.0), 1.0) if len(found) else 1.0)
        worst = part * expected.worst
        budget = max(min(_BATCH, most_rows - len(rows)), 0)
        order = np.argsort(-worst, kind="stable")
        split = np.sort(order[: min(budget, int(np.sum(worst > tolerance)))])
        if not len(split):
            break
        # micro models prefer rising approaches
        middle = 0.5 * (approaches[split] + approaches[split + 1])
        new = solve(middle)
        guess = laws.at(patches, new.approach)
        approaches = np.insert(approaches, split + 1, middle)
        order = np.argsort(np.append(np.arange(len(rows)), split + 0.5))
        rows = rows.joined(new)[order]
        laws, place = curves(rows), split + 1 + np.arange(len(split))
        stiffness = _stiffness(laws.at(patches, new.approach), compliance)
        errors = Errors.of(guess, stiffness, new, compliance, least)
        found = np.append(found, errors.worst / expected.worst[split])
        halved = halved.with_rows(split, errors).put(place - 1, errors)
        near = np.abs(np.arange(len(rows))[:, None] - place).min(axis=1) <= _BESIDE
        again = _left_out(curves, laws, rows, np.flatnonzero(near), compliance, least)
        left_out = left_out.with_rows(split, errors).put(np.flatnonzero(near), again)
    stated = expected.mapped(lambda errors: part * errors.max(axis=0))
    return Refined(rows, float(stated.force), stated.pressure, stated.stiffness)


def _left_out(
    curves: Curves,
    laws: LawCurves,
    rows: SolvedRows,
    which: Indices,
    compliance: Array,
    least: float,
) -> Errors:
    """Return the errors at rows of laws made without them; none at the first and the last row.

    Args:
        curves: Returns the laws through rows.
        laws: The laws through all rows.
        rows: The rows, columns of shape (m, N).
        which: Indices of the rows, shape (n,).
        compliance: Compliance of the patches of the half-space, shape (N, N) [mm/MPa].
        least: Least mean pressure that errors are relative to [MPa].
    """
    count, patches = rows.pressure.shape
    inner = which[(which > 0) & (which < count - 1)]
    width = min(2 * _BESIDE + 1, count)
    first = np.clip(inner - _BESIDE, 0, count - width)
    window = first[:, None] + np.arange(width)
    window = window[window != inner[:, None]].reshape(len(inner), width - 1)

    def side_by_side(column: NDArray[np.generic]) -> NDArray[np.generic]:
        return np.moveaxis(column[window], 1, 0).reshape(width - 1, -1)

    own = rows[inner]
    without = curves(rows.mapped(side_by_side))
    laws_without = np.arange(len(inner) * patches).reshape(-1, patches)
    guess = without.at(laws_without, own.approach)
    stiffness = _stiffness(laws.at(np.arange(patches), own.approach), compliance)
    errors = Errors.of(guess, stiffness, own, compliance, least)
    none = errors.mapped(lambda values: np.zeros((len(which), *values.shape[1:])))
    return none.put(np.flatnonzero(np.isin(which, inner)), errors)


def _largest(halved: Array, left_out: Array) -> Array:
    """Return what is expected of intervals, by their halving and by the rows on both sides."""
    return np.asarray(np.maximum(halved, np.maximum(left_out[:-1], left_out[1:])))


def _put(array: Array, where: Indices, values: Array) -> Array:
    """Return a copy of an array with other values at some places of its first axis."""
    array = array.copy()
    array[where] = values
    return array


def _stiffness(point: LawPoint, compliance: Array) -> Array:
    """Return dp/dδ of every patch as if its neighbours' pressures stayed, shape (…, N)."""
    slope = point.dclosure + np.diag(compliance) * point.dpressure
    return np.asarray(point.dpressure / np.maximum(slope, _LEAST_SLOPE))
