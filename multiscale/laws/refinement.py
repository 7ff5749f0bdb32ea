"""Adds rows to patch laws where they are needed most, until the error between rows is small enough.

The contact problem is solved at the middle of an interval between two rows, which gives a new row.
The laws made without it would give another load step there: on the half-space, under a plane at the
same approach. The difference is computed to first order. It counts the errors of pressure and of
closure alike, by their effect on a load step.

Halving an interval leaves less than half of its error, also at a kink where a contact begins or two
join, and half of it is recorded. Elsewhere between rows it may be more: on random surfaces of 256²
cells, in 1 to 256 patches, the force erred by up to 1.7 times and a patch's pressure by up to 3
times the largest recorded.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from multiscale.laws.interpolation import LawPoint, Tangent
from multiscale.laws.law_table import PATCH_FACTOR
from multiscale.laws.patch_law import PatchLaw, PatchLaws
from multiscale.laws.rows import SolvedRows

Array = NDArray[np.float64]

MOST_ROWS = 97
"""Rows that are solved at most by default."""

_FIRST_ROWS = 17
_BATCH = 8  # rows that are solved together, each starting from those before it
LEAST_LOAD = 0.03  # of the mean pressure at the end: smaller loads count as this much
_LEAST_SLOPE = 0.1  # of the closure over the approach, in a stiffness
_ERROR_OF_HALVES = 0.5  # of an interval's error


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Errors:
    """Errors of the laws of N patches in an interval between two rows; infinite when unknown.

    A load below 3 % of the load at the end of the table counts as 3 % of it, so that small loads
    near first touch do not take all rows.

    Attributes:
        force: Error of the force over the force.
        pressure: Error of a patch's pressure over that pressure, or over the mean pressure of all
            patches where that is more, shape (N,).
        stiffness: Change, by the new row, of a patch's dp/dδ under a plane at δ, over the largest
            of all patches there, shape (N,).
    """

    force: float = np.inf
    pressure: Array = field(default_factory=lambda: np.full(1, np.inf))
    stiffness: Array = field(default_factory=lambda: np.full(1, np.inf))

    @classmethod
    def of(
        cls, before: PatchLaws, after: PatchLaws, row: SolvedRows, compliance: Array, least: float
    ) -> Errors:
        """Return the errors at a row, columns of shape (N,), of the laws made without it.

        Args:
            before: The laws without the row.
            after: The laws with it.
            row: The row of all patches.
            compliance: Compliance of the patches of the half-space, shape (N, N) [mm/MPa].
            least: Least mean pressure that errors are relative to [MPa].
        """
        guess = before.along(row.approach)
        wrong = guess.pressure - row.pressure
        residual = guess.closure - row.closure + compliance @ wrong
        wrong = wrong - guess.dpressure * Tangent.of(guess, compliance).solve(residual)
        load = max(float(row.pressure.mean()), least)
        stiffness = _stiffness(after.along(row.approach), compliance)
        change = _stiffness(guess, compliance) - stiffness
        return cls(
            force=_ERROR_OF_HALVES * (abs(wrong.mean()) / load),
            pressure=_ERROR_OF_HALVES * (np.abs(wrong) / np.maximum(row.pressure, load)),
            stiffness=_ERROR_OF_HALVES * (np.abs(change) / (float(stiffness.max()) or 1.0)),
        )

    @property
    def worst(self) -> float:
        """The error that is compared to the tolerance of the force."""
        return max(self.force, float(self.pressure.max()) / PATCH_FACTOR)


def refined(
    solve: Callable[[Array], SolvedRows],
    make: Callable[[SolvedRows], Sequence[PatchLaw]],
    start: float,
    end: float,
    *,
    compliance: Array,
    tolerance: float,
    most_rows: int = MOST_ROWS,
) -> tuple[list[PatchLaw], float]:
    """Make laws, and halve the intervals of largest error until all errors are small enough.

    The first rows lie closer where the load is small: their distances grow linearly.

    Args:
        solve: Returns the rows of N patches at approaches of shape (m,), columns of shape (m, N).
        make: Makes the N laws out of such rows, in the order of the approaches.
        start: Approach of the first row [mm].
        end: Approach of the last row, or of the only one where it is not beyond the first [mm].
        compliance: Mean displacement of patch i of the half-space by unit pressure on patch j,
            shape (N, N) [mm/MPa].
        tolerance: Error of the force; that of a patch's pressure may be twenty times as large, see
            `Errors`.
        most_rows: Rows that may be solved, 33 at least. The errors then state what was reached.

    Returns:
        The N laws, with their errors, and the error of the force.
    """
    approaches = start + (end - start) * np.linspace(0.0, 1.0, _FIRST_ROWS) ** 2
    rows = solve(approaches if end > start else approaches[-1:])
    laws = make(rows)
    if end <= start or not rows.pressure[-1].any():
        return list(laws), 0.0
    most_rows = max(most_rows, 2 * _FIRST_ROWS - 1)  # each first interval is measured once
    least = LEAST_LOAD * float(rows.pressure[-1].mean())
    intervals = [(low, high, Errors()) for low, high in pairwise(approaches)]
    while (budget := min(_BATCH, most_rows - len(rows))) > 0:
        worst = np.array([errors.worst for _, _, errors in intervals])
        order = np.argsort(-worst, kind="stable")
        split = order[: min(budget, int(np.sum(worst > tolerance)))]
        if not len(split):
            break
        # micro models prefer rising approaches
        halved = sorted(intervals[index] for index in split)
        middle = np.array([0.5 * (low + high) for low, high, _ in halved])
        new = solve(middle)
        approaches, rows = np.append(approaches, middle), rows.joined(new)
        order = np.argsort(approaches)
        approaches, rows = approaches[order], rows[order]
        before, laws = PatchLaws(laws), make(rows)
        after = PatchLaws(laws)
        intervals = [one for index, one in enumerate(intervals) if index not in set(split)]
        for row, (low, high, _) in enumerate(halved):
            errors = Errors.of(before, after, new[row], compliance, least)
            intervals += [(low, middle[row], errors), (middle[row], high, errors)]
    largest = (
        np.max([getattr(errors, name) for _, _, errors in intervals], axis=0)
        for name in ("pressure", "stiffness")
    )
    return [
        replace(law, interpolation_error=float(pressure), stiffness_error=float(stiffness))
        for law, pressure, stiffness in zip(laws, *largest, strict=True)
    ], float(max(errors.force for _, _, errors in intervals))


def _stiffness(point: LawPoint, compliance: Array) -> Array:
    """Return dp/dδ of every patch as if its neighbours' pressures stayed, shape (N,)."""
    slope = point.dclosure + np.diag(compliance) * point.dpressure
    return np.asarray(point.dpressure / np.maximum(slope, _LEAST_SLOPE))
