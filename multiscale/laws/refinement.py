"""Adds rows to patch laws, where they are needed most, until what lies between them is known."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from multiscale.laws.files import LawTable
from multiscale.laws.packed import PatchLaws
from multiscale.laws.patch_law import LawPoint, PatchLaw
from multiscale.laws.tangent import Tangent

Array = NDArray[np.float64]

PATCH_FACTOR = 20.0
"""Tolerance of a patch's pressure over that of the force."""

MOST_ROWS = 97
"""Rows that are solved at most, unless told otherwise."""

_FIRST_ROWS = 17
_BATCH = 8  # rows that are solved together, each starting from those before it
_LEAST_LOAD = 0.03  # of the mean pressure at the end: loads below count as this much
_LEAST_SLOPE = 0.1  # of what the plane's way is shared by, where neighbours take nearly all
_OF_HALVES = 0.5  # of an interval's error that is left in its halves


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """Errors of laws between their rows, as a half-space would see them.

    The whole surface was solved at the approach of a row that was then put half-way between two
    others. The laws without it, pressed on the half-space by a plane at that approach, miss the
    solution by what is computed here to the first order: errors of pressure and of closure both
    count, by what a load step makes of them. Halving an interval leaves less than half of its
    error, also at a kink, where a contact begins or two join; half of it is what is recorded.
    Elsewhere between rows it may be more: on random surfaces of 256² cells, in 1 to 256 patches,
    the force erred by up to 1.7 times and a patch's pressure by up to 3 times the largest recorded.

    Attributes:
        force: Error of the force over the force, shape (m,). Forces less than three hundredths of
            that at the end of the table count as this much, here and below.
        pressure: Error of a patch's pressure over that pressure, or over the mean pressure of all
            patches where that is more, shape (m, N).
        stiffness: Change, by the new row, of a patch's dp/dδ under a plane at δ, over the largest
            of all patches there, shape (m, N).
    """

    force: Array
    pressure: Array
    stiffness: Array

    @classmethod
    def unknown(cls, intervals: int, patches: int) -> Errors:
        """Return what is known before any row is put between others."""
        all_patches = np.full((intervals, patches), np.inf)
        return cls(np.full(intervals, np.inf), all_patches, all_patches)

    @classmethod
    def of(
        cls,
        before: Sequence[PatchLaw],
        after: Sequence[PatchLaw],
        new: Array,
        compliance: Array,
        least: float,
    ) -> Errors:
        """Return what the laws before lacked at new rows (m, N, 7) that the laws after have."""
        old, laws = PatchLaws(before), PatchLaws(after)
        found = []
        for row in new:
            local, closure, pressure = row[:, :3].T
            guess = old.along(local)
            off = guess.closure - closure + compliance @ (guess.pressure - pressure)
            wrong = guess.pressure - pressure - guess.dpressure * _shift(guess, compliance, off)
            load = max(float(pressure.mean()), least)
            true = _stiffness(laws.along(local), compliance)
            change = _stiffness(guess, compliance) - true
            found.append(
                (
                    abs(wrong.mean()) / load,
                    np.abs(wrong) / np.maximum(pressure, load),
                    np.abs(change) / (float(true.max()) or 1.0),
                )
            )
        return cls(*(_OF_HALVES * np.array(part) for part in zip(*found, strict=True)))

    def __add__(self, other: Errors) -> Errors:
        return Errors(
            np.concatenate((self.force, other.force)),
            np.concatenate((self.pressure, other.pressure)),
            np.concatenate((self.stiffness, other.stiffness)),
        )

    def __getitem__(self, rows: NDArray[np.intp]) -> Errors:
        return Errors(self.force[rows], self.pressure[rows], self.stiffness[rows])

    @property
    def worst(self) -> Array:
        """What is compared to the tolerance of the force, shape (m,)."""
        return np.maximum(self.force, self.pressure.max(axis=1, initial=0.0) / PATCH_FACTOR)


def refined(
    solve: Callable[[Array], Array],
    make: Callable[[Array], Sequence[PatchLaw]],
    start: float,
    end: float,
    *,
    compliance: Array,
    tolerance: float,
    most_rows: int = MOST_ROWS,
) -> tuple[list[PatchLaw], float]:
    """Make laws, and halve the worst of the intervals between their rows until they will do.

    The first rows lie closer where the load is small: as squares of equal steps.

    Args:
        solve: Returns rows at approaches (m,) for N patches: approach, closure, pressure, area
            fraction, contacts, relief, and 1 where the micro model warns that it is outside its
            range of validity; shape (m, N, 7).
        make: Makes the N laws out of such rows, in the order of the approaches asked for.
        start: Approach of the first row [mm].
        end: Approach of the last row [mm].
        compliance: Mean displacement of patch i of the half-space by unit pressure on patch j,
            shape (N, N) [mm/MPa].
        tolerance: Error of the force; that of a patch's pressure may be twenty times as large, see
            `Errors`.
        most_rows: Rows that may be solved, 33 at least. The errors then say what was reached.

    Returns:
        The N laws, with their errors, and the error of the force.
    """
    first = start + (end - start) * np.linspace(0.0, 1.0, _FIRST_ROWS) ** 2
    asked, rows = first, solve(first)
    laws = make(rows)
    if not rows[-1, :, 2].any():
        return list(laws), 0.0
    most_rows = max(most_rows, 2 * _FIRST_ROWS - 1)  # each interval is measured once
    least = _LEAST_LOAD * float(rows[-1, :, 2].mean())
    intervals = np.column_stack((first[:-1], first[1:]))
    errors = Errors.unknown(len(intervals), len(laws))
    while (room := min(_BATCH, most_rows - len(rows))) > 0 and np.any(errors.worst > tolerance):
        order = np.argsort(-errors.worst, kind="stable")
        split = order[: min(room, int(np.sum(errors.worst > tolerance)))]
        split = split[np.argsort(intervals[split, 0])]  # rising, as the micro models like it
        middle = intervals[split].mean(axis=1)
        new = solve(middle)
        asked, rows = np.append(asked, middle), np.concatenate((rows, new))
        order = np.argsort(asked)
        asked, rows = asked[order], rows[order]
        before, laws = laws, make(rows)
        found = Errors.of(before, laws, new, compliance, least)
        halves = np.column_stack((intervals[split, 0], middle, middle, intervals[split, 1]))
        intervals = np.concatenate((np.delete(intervals, split, 0), halves.reshape(-1, 2)))
        kept = np.delete(np.arange(len(errors.force)), split)
        errors = errors[kept] + found[np.repeat(np.arange(len(new)), 2)]
    largest = errors.pressure.max(axis=0), errors.stiffness.max(axis=0)
    return [
        replace(law, interpolation_error=float(error), stiffness_error=float(stiffness))
        for law, error, stiffness in zip(laws, *largest, strict=True)
    ], float(errors.force.max())


def missed_notes(table: LawTable, tolerance: float) -> Iterator[str]:
    """Yield a note where the most rows that are solved leave a larger error than was asked for.

    Args:
        table: The laws.
        tolerance: Error of the force that was asked for.
    """
    largest = max(law.interpolation_error for law in table.laws)
    reached = max(table.force_error, largest / PATCH_FACTOR)
    if reached > tolerance:
        yield (
            f"the laws miss coupling.table_tolerance = {tolerance:g} with all the rows that are "
            f"solved at most; what they reach is a tolerance of {reached:.1e}"
        )


def law_of(rows: Array, touch: float, reach: float) -> PatchLaw:
    """Return the law of rows, shape (n, 7), with the columns of `refined`."""
    warned = np.flatnonzero(rows[:, 6])
    return PatchLaw(
        approach=rows[:, 0],
        closure=rows[:, 1],
        pressure=rows[:, 2],
        contact_area_fraction=rows[:, 3],
        contacts=rows[:, 4].astype(np.int64),
        relief=rows[:, 5],
        warned_from=float(rows[warned[0], 2]) if warned.size else np.inf,
        touch=touch,
        reach=reach,
    )


def _shift(point: LawPoint, compliance: Array, off: Array) -> Array:
    """Return how far local approaches are off by a lack of closure, shape (N,) [mm]."""
    return Tangent.of(point, lambda of: compliance[:, of] * point.dpressure[of]).solve(off)


def _stiffness(point: LawPoint, compliance: Array) -> Array:
    """Return dp/dδ of every patch as if its neighbours' pressures stayed, shape (N,)."""
    way = point.dclosure + np.diag(compliance) * point.dpressure
    return np.asarray(point.dpressure / np.maximum(way, _LEAST_SLOPE))
