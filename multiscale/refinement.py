"""Adds rows to patch laws until what lies between them is known to a tolerance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from multiscale.laws import LawPoint, PatchLaw

Array = NDArray[np.float64]

STIFFNESS_FACTOR = 10.0
"""Tolerance of dp/dc over that of the pressure."""

_MOST_ROWS = 400  # solutions of the micro model
_LEAST_SCALE = (
    0.01  # of the largest pressure of any patch: an error below it counts as one of this much
)
_LEAST_SLOPE = 0.1  # dc/ds that dp/dc is judged with where the closure is about to turn


def refined(
    solve: Callable[[Array], Array],
    make: Callable[[Array], Sequence[PatchLaw]],
    approaches: Array,
    tolerance: float,
) -> list[PatchLaw]:
    """Make laws and halve the intervals between their rows until they meet the tolerance.

    The error of the pressure half-way between rows is that at the same closure, relative to the
    pressure there or, where that is more, to a hundredth of the largest pressure of any patch at
    the end. The error of the stiffness dp/dc is the change that the row half-way makes to it,
    relative to the largest of all laws; it may be ten times the tolerance. The errors recorded are
    the largest found where no further row was asked for, of the laws before the last rows: thus
    on the safe side. At most 400 rows are solved; the errors then say what was missed.

    Args:
        solve: Returns rows at approaches (m,) for N patches: approach, closure, pressure, area
            fraction, contacts, relief; shape (m, N, 6).
        make: Makes the N laws out of such rows, sorted by approach.
        approaches: Approaches to begin with, increasing, shape (n,) [mm].
        tolerance: Error of the pressure.

    Returns:
        The N laws, with their errors.
    """
    rows = solve(approaches)
    laws = make(rows)
    scale = _LEAST_SCALE * rows[-1, :, 2].max()
    kept = np.zeros((2, len(laws)))
    halfway = 0.5 * (approaches[:-1] + approaches[1:])
    missed = kept
    while halfway.size and len(rows) + halfway.size <= _MOST_ROWS:
        new = solve(halfway)
        rows = np.concatenate((rows, new))
        rows = rows[np.argsort(rows[:, 0, 0])]
        before, laws = laws, make(rows)
        errors = _errors(before, laws, new, scale)  # kind, row, patch
        allowed = np.array([tolerance, STIFFNESS_FACTOR * tolerance])[:, None, None]
        bad = np.any(errors > allowed, axis=(0, 2))
        kept = np.maximum(kept, errors[:, ~bad].max(axis=1, initial=0.0))
        missed = errors.max(axis=1)
        halfway = _around(rows[:, 0, 0], halfway[bad])
    errors_left = np.maximum(kept, missed) if halfway.size else kept
    return [
        replace(law, interpolation_error=float(error), stiffness_error=float(stiffness))
        for law, error, stiffness in zip(laws, *errors_left, strict=True)
    ]


def law_of(rows: Array, touch: float, reach: float) -> PatchLaw:
    """Return the law of rows, shape (n, 6), with the columns of `refined`."""
    return PatchLaw(
        approach=rows[:, 0],
        closure=rows[:, 1],
        pressure=rows[:, 2],
        contact_area_fraction=rows[:, 3],
        contacts=rows[:, 4].astype(np.int64),
        relief=rows[:, 5],
        touch=touch,
        reach=reach,
    )


def _errors(
    before: Sequence[PatchLaw], after: Sequence[PatchLaw], new: Array, scale: float
) -> Array:
    """Return the errors of pressure and stiffness of laws at new rows, shape (2, m, N)."""
    errors = np.zeros((2, *new.shape[:2]))
    closed = [law for law in after if not law.is_open]
    largest = max((_stiffness(law.along(law.approach)).max() for law in closed), default=1.0)
    for i, (old, law) in enumerate(zip(before, after, strict=True)):
        if law.is_open:
            continue
        approach, closure, pressure = new[:, i, :3].T
        guess = old.along(approach)
        slope = _stiffness(guess)
        off = guess.pressure - pressure - slope * (guess.closure - closure)
        errors[0, :, i] = np.abs(off) / np.maximum(pressure, scale)
        change = np.abs(slope - _stiffness(law.along(approach)))
        errors[1, :, i] = change / largest
    return errors


def _stiffness(point: LawPoint) -> Array:
    return np.asarray(point.dpressure / np.maximum(point.dclosure, _LEAST_SLOPE))


def _around(points: Array, centres: Array) -> Array:
    """Return the middles of the intervals on either side of some of the points."""
    index = np.searchsorted(points, centres)
    sides = np.concatenate((points[index - 1], points[index + 1]))
    return np.unique(0.5 * (sides + np.tile(points[index], 2)))
