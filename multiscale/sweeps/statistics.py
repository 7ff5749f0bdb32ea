"""Statistics of the columns of a sweep, reduced in the memory of all ranks.

Every rank has some cases with all their columns. It hands them on, so that every rank then has some
columns of all cases: mean, median, bands and histograms follow exactly, and no rank ever holds more
than its part of the numbers. The cases of a column stand in the order of their numbers, so that the
number of ranks does not change a bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiscale.results.history import COLUMNS

Array = NDArray[np.float64]

NUMBERS = tuple(column.name for column in COLUMNS if column.name != "reason")
"""Columns of ``history.csv`` that are numbers."""
QUANTILES = (0.05, 0.5, 0.95)
BINS = 20
"""Bins of a histogram, equally wide from the smallest to the largest value."""
FIELDS = ("cases", "mean", "deviation", "smallest", "low", "median", "high", "largest")
"""Numbers of a column at a load step; the deviation is that of a sample, the band 5 to 95 %."""
_PLACES = {column.name: index for index, column in enumerate(COLUMNS)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Statistics:
    """Statistics of the cases of an ensemble that ended well, at every load step.

    Attributes:
        values: `FIELDS` of each column of `NUMBERS`, shape (steps, columns, fields); NaN where no
            case has a value. Cases are those with a value.
        histograms: Cases in each of the `BINS` between the smallest and the largest value, shape
            (steps, columns, bins).
    """

    values: Array
    histograms: NDArray[np.int64]

    def of(self, column: str, field: str) -> Array:
        """Return one of `FIELDS` of a column at all load steps, shape (steps,).

        Args:
            column: Name of the column.
            field: Name of the number, such as ``"median"``.
        """
        return np.asarray(self.values[:, NUMBERS.index(column), FIELDS.index(field)])

    def histogram(self, column: str, step: int) -> tuple[NDArray[np.int64], Array]:
        """Return cases and borders of the bins of a column, as numpy's histogram does.

        Args:
            column: Name of the column.
            step: Number of the load step, from 1.
        """
        index = NUMBERS.index(column)
        low, high = (self.of(column, end)[step - 1] for end in ("smallest", "largest"))
        return self.histograms[step - 1, index], bin_borders(low, high)


def numbers_of(rows: Sequence[Sequence[Any]], steps: int) -> Array:
    """Return the numbers in rows of ``history.csv``, shape (steps, columns), NaN where none is."""
    found = np.full((steps, len(NUMBERS)), np.nan)
    for line, row in zip(found, rows, strict=False):
        line[:] = [np.nan if (value := row[_PLACES[name]]) is None else value for name in NUMBERS]
    return found


def column_statistics(
    comm: Any, mine: Mapping[int, Sequence[Sequence[Any]]], ensembles: Iterable[Sequence[int]]
) -> list[Statistics]:
    """Return the statistics of ensembles of cases, the same on every rank.

    Args:
        comm: MPI communicator (mpi4py); None for a process on its own.
        mine: Rows of ``history.csv`` of the cases that this rank holds, by their numbers.
        ensembles: Numbers of the cases of each ensemble.

    Note:
        Collective. A rank sends and gets 8 bytes for each of its numbers.
    """
    size = 1 if comm is None else comm.size
    steps = max((len(rows) for rows in mine.values()), default=0)
    steps = steps if size == 1 else max(comm.allgather(steps))
    count = steps * len(NUMBERS)
    held = np.array(sorted(mine), np.int64)
    table = np.empty((len(held), count))
    for line, number in zip(table, held, strict=True):
        line[:] = numbers_of(mine[int(number)], steps).ravel()
    cases, columns = held, table.T
    if size > 1:
        cases = np.concatenate(comm.allgather(held))
        parts = comm.alltoall([np.ascontiguousarray(table[:, to::size].T) for to in range(size)])
        columns = np.concatenate(parts, axis=1)
    order = np.argsort(cases)
    cases, columns = cases[order], np.ascontiguousarray(columns[:, order])
    found = []
    for numbers in ensembles:
        chosen = np.isin(cases, np.asarray(numbers, np.int64))
        own = [_described(values[chosen]) for values in columns]
        values = np.full((count, len(FIELDS)), np.nan)
        bins = np.zeros((count, BINS), np.int64)
        parts = [own] if size == 1 else comm.allgather(own)
        for first, part in enumerate(parts):
            for place, (numbers_found, histogram) in enumerate(part):
                values[first + place * size] = numbers_found
                bins[first + place * size] = histogram
        shape = steps, len(NUMBERS)
        values, bins = values.reshape(*shape, len(FIELDS)), bins.reshape(*shape, BINS)
        found.append(Statistics(values=values, histograms=bins))
    return found


def bin_borders(low: float, high: float) -> Array:
    """Return the borders of the bins from a smallest to a largest value, shape (bins + 1,)."""
    return np.linspace(low, high, BINS + 1)


def _described(values: Array) -> tuple[list[float], NDArray[np.int64]]:
    """Return `FIELDS` and histogram of one column at one load step, without its NaN."""
    values = values[~np.isnan(values)]
    if not values.size:
        return [0.0, *(len(FIELDS) - 1) * [np.nan]], np.zeros(BINS, np.int64)
    smallest, largest = float(values.min()), float(values.max())
    deviation = float(np.std(values, ddof=1)) if len(values) > 1 else np.nan
    low, median, high = np.quantile(values, QUANTILES)
    place = (values - smallest) / ((largest - smallest) or 1.0) * BINS
    histogram = np.bincount(np.minimum(place.astype(np.int64), BINS - 1), minlength=BINS)
    mean = float(np.mean(values))
    return [len(values), mean, deviation, smallest, low, median, high, largest], histogram
