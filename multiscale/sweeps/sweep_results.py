"""The results of a sweep: the rows of all cases, their statistics, and the figure of both.

On several ranks every rank holds the cases that it has run or read. What needs more than that is
collective: a column is gathered alone, tables go to rank 0 block by block, statistics are reduced.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from multiscale.results.history import COLUMNS, data_frame
from multiscale.sweeps.cases import SweepCases
from multiscale.sweeps.journal import CaseResult
from multiscale.sweeps.statistics import (
    FIELDS,
    NUMBERS,
    Statistics,
    column_statistics,
    numbers_of,
)
from support.errors import InputError
from support.packages import optional_packages

Array = NDArray[np.float64]

_COLUMNS = tuple(column.name for column in COLUMNS)
_BAND = (0.05, 0.95)  # quantiles
_DRAWN = ("surface.spectrum.seed", "counter_surface.spectrum.seed", "counter_surface.shift")
"""Keys over whose values statistics are taken: draws of one roughness. Files are compared."""
_BLOCK = 256
"""Cases whose rows rank 0 gathers at a time."""


class SweepResults:
    """The results of a sweep. A column of ``history.csv`` is an attribute of shape (cases, steps).

    NaN stands where a case has no such load step or no value.

    Args:
        cases: All cases of the sweep.
        mine: What the cases that this rank holds came to, by their numbers. No two ranks hold the
            same one.
        comm: MPI communicator (mpi4py) of these ranks; None for a process on its own.

    Attributes:
        cases: All cases of the sweep.
        failures: Why cases ended early, by name of the case, in the order of the cases.
        unfinished: Number of cases that are still to be run.

    Note:
        Construction and everything but `cases`, `failures`, `unfinished` and `keys` is collective.
    """

    def __init__(self, cases: SweepCases, mine: Mapping[int, CaseResult], comm: Any = None) -> None:
        self.cases, self._comm = cases, comm
        self._mine = {number: mine[number] for number in cases.numbers if number in mine}
        failed = {number: one.failure for number, one in self._mine.items() if one.failure}
        parts = self._gathered((len(self._mine), failed))
        self.unfinished = len(cases) - sum(count for count, _ in parts)
        self._failed = {number: why for _, part in parts for number, why in part.items()}

    def __len__(self) -> int:
        return len(self.cases)

    def __getattr__(self, name: str) -> Array:
        if name not in NUMBERS:
            raise AttributeError(f"'{type(self).__name__}' has no attribute '{name}'")
        return self._column(name, list(self.cases.numbers))

    def __dir__(self) -> list[str]:
        return sorted([*super().__dir__(), *NUMBERS])

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied keys of the scene."""
        return tuple(self.cases.values)

    @property
    def failures(self) -> dict[str, str]:
        """Why cases ended early, by name of the case."""
        numbers = {number: place for place, number in enumerate(self.cases.numbers)}
        return {self.cases[numbers[n]].name: self._failed[n] for n in sorted(self._failed)}

    def where(self, values: Mapping[str, Any]) -> SweepResults:
        """Return the part of a sweep whose keys have given values.

        Args:
            values: Values by dotted key, as they were varied.

        Raises:
            InputError: When no case has them.
        """
        chosen = self.cases.where(values)
        if not len(chosen):
            raise InputError("no case of the sweep has these values", value=dict(values))
        return SweepResults(chosen, self._mine, self._comm)

    def ensembles(self) -> list[tuple[dict[str, Any], SweepResults]]:
        """Return the parts of a sweep that differ in seed alone, and their other values.

        Where none is varied every case is a part of its own: a mean over other keys says little.
        """
        return [
            (values, SweepResults(SweepCases(self.cases.base, self.cases.values, numbers),
                                  self._mine, self._comm))
            for values, numbers in self._ensembles
        ]  # fmt: skip

    @cached_property
    def _ensembles(self) -> list[tuple[dict[str, Any], list[int]]]:
        """The values that the cases of each ensemble have in common, and their numbers."""
        others = [key for key in self.keys if key not in _DRAWN]
        found: dict[str, tuple[dict[str, Any], list[int]]] = {}
        for case in self.cases:
            values = {key: case.values[key] for key in others}
            found.setdefault(repr(values), (values, []))[1].append(case.number)
        return list(found.values())

    @cached_property
    def statistics(self) -> list[tuple[dict[str, Any], Statistics]]:
        """Values of each ensemble, and the statistics of its cases that ended well.

        They are reduced over the ranks, and the same on all of them.

        Raises:
            InputError: When cases of an ensemble took different numbers of load steps, so that the
                same step is not the same load.
        """
        well = {number: one.rows for number, one in self._mine.items() if not one.failure}
        counts = {n: c for part in self._gathered({n: len(r) for n, r in well.items()})
                  for n, c in part.items()}  # fmt: skip
        for _, numbers in self._ensembles:
            if len({counts[number] for number in numbers if number in counts}) > 1:
                raise InputError(
                    "cases took different numbers of load steps, so there is no mean",
                    key="load.force_change",
                    allowed="leave it out",
                )
        found = column_statistics(self._comm, well, [numbers for _, numbers in self._ensembles])
        return [(values, part) for (values, _), part in zip(self._ensembles, found, strict=True)]

    def mean(self, name: str) -> Array:
        """Return the mean of a column over the finished cases, shape (steps,).

        Args:
            name: Name of the column.

        Raises:
            InputError: When no case is finished, or they took different numbers of load steps.
        """
        return np.mean(self._finished(name), axis=0)

    def band(self, name: str, quantiles: Sequence[float] = _BAND) -> Array:
        """Return quantiles of a column over the finished cases, shape (quantiles, steps).

        Args:
            name: Name of the column.
            quantiles: Shares of the cases that lie below; by default 5 and 95 %.

        Raises:
            InputError: When no case is finished, or they took different numbers of load steps.
        """
        return np.quantile(self._finished(name), quantiles, axis=0)

    def blocks(self) -> Iterator[dict[int, CaseResult]]:
        """Yield the results of the cases on rank 0, some hundred cases at a time, by their numbers.

        Other ranks get empty ones. All ranks have to come to the end.
        """
        numbers = self.cases.numbers
        for first in range(0, len(numbers), _BLOCK):
            block = numbers[first : first + _BLOCK]
            parts = self._gathered({n: self._mine[n] for n in block if n in self._mine}, root=True)
            yield {number: result for part in parts for number, result in part.items()}

    def records(self) -> Iterator[dict[str, Any]]:
        """Yield the load steps of all cases on rank 0: varied values, then the row of the history.

        All ranks have to come to the end; others than rank 0 get none.
        """
        for first, block in zip(range(0, len(self), _BLOCK), self.blocks(), strict=True):
            for case in self.cases[first : first + _BLOCK]:
                for row in block[case.number].rows if case.number in block else ():
                    yield {"case": case.number, **case.values,
                           **dict(zip(_COLUMNS, row, strict=True))}  # fmt: skip

    def case_records(self) -> Iterator[dict[str, Any]]:
        """Yield a record for every case on rank 0: values, its last load step, and its failure.

        All ranks have to come to the end; others than rank 0 get none.
        """
        empty = dict.fromkeys(_COLUMNS)
        for first, block in zip(range(0, len(self), _BLOCK), self.blocks(), strict=True):
            for case in self.cases[first : first + _BLOCK] if self._is_root else ():
                result = block.get(case.number)
                last = result.rows[-1:] if result is not None else ()
                row = empty | next((dict(zip(_COLUMNS, row, strict=True)) for row in last), {})
                status = "to be run" if result is None else result.failure or "done"
                yield {"case": case.number, **case.values, **row, "status": status}

    def statistics_records(self) -> list[dict[str, Any]]:
        """Return `FIELDS` and histogram of every column at every load step of each ensemble."""
        records = []
        for values, part in self.statistics:
            for step, columns in enumerate(part.values, start=1):
                for name, numbers, bins in zip(
                    NUMBERS, columns, part.histograms[step - 1], strict=True
                ):
                    if numbers[0]:
                        described = dict(zip(FIELDS, numbers.tolist(), strict=True))
                        described |= {"cases": int(numbers[0])}
                        histogram = " ".join(map(str, bins.tolist()))
                        of = {"step": step, "column": name}
                        records.append({**values, **of, **described, "histogram": histogram})
        return records

    def to_dataframe(self) -> Any:
        """Return `records` as a pandas data frame; on several ranks it is whole on rank 0 alone.

        Raises:
            ImportError: When pandas, which patchlaw does not require, is not installed.
        """
        return data_frame(list(self.records()))

    def plot(self) -> Any:
        """Draw mean pressure over approach: cases, and mean and band of every ensemble.

        Returns:
            A matplotlib figure.

        Raises:
            InputError: When no case is finished, or they took different numbers of load steps.
        """
        with optional_packages():
            from multiscale.sweeps.figure import (  # loads matplotlib
                CURVES,
                MOST_CURVES,
                MOST_ENSEMBLES,
                Ensemble,
                sweep_figure,
            )

        if self.unfinished == len(self):
            raise InputError("no case is finished, so there is nothing to draw")
        shown = list(zip(self.statistics, self._ensembles, strict=True))[:MOST_ENSEMBLES]
        return sweep_figure(
            [
                Ensemble(_label(values), len(numbers), statistics, *(
                    self._column(name, numbers[: MOST_CURVES // len(shown)])
                    for name in CURVES
                ))
                for (values, statistics), (_, numbers) in shown
            ]
        )  # fmt: skip

    @property
    def _is_root(self) -> bool:
        return self._comm is None or self._comm.rank == 0

    def _gathered(self, part: Any, *, root: bool = False) -> list[Any]:
        """Return the parts of all ranks; on others than rank 0 none, where it alone needs them."""
        if self._comm is None:
            return [part]
        return (self._comm.gather(part, root=0) or []) if root else self._comm.allgather(part)

    def _column(self, name: str, numbers: Sequence[int]) -> Array:
        """Return a column of some cases, shape (cases, steps)."""
        own = {number: self._mine[number].rows for number in numbers if number in self._mine}
        steps = max(self._gathered(max(map(len, own.values()), default=0)))
        place = NUMBERS.index(name)
        mine = {number: numbers_of(rows, steps)[:, place] for number, rows in own.items()}
        found = np.full((len(numbers), steps), np.nan)
        where = {number: index for index, number in enumerate(numbers)}
        for part in self._gathered(mine):
            for number, values in part.items():
                found[where[number]] = values
        return found

    def _finished(self, name: str) -> Array:
        """Return a column of the cases that ended well, shape (cases, steps)."""
        numbers = [number for number in self.cases.numbers if number not in self._failed]
        steps, values = self._column("step", numbers), self._column(name, numbers)
        there = ~np.isnan(steps).all(axis=1)
        if not there.any():
            raise InputError("no case is finished, so there is no mean", key=name)
        if np.isnan(steps[there]).any():
            raise InputError(
                "cases took different numbers of load steps, so there is no mean",
                key="load.force_change",
                allowed="leave it out",
            )
        return values[there]


def _label(values: Mapping[str, Any]) -> str:
    """Return the values of keys as a legend shows them, without sections and folders."""
    names = {key: key.rpartition(".")[2].replace("_", " ") for key in values}
    return ", ".join(
        Path(value).name if names[key] in ("file", "mesh") else f"{names[key]} {value}"
        for key, value in values.items()
    )
