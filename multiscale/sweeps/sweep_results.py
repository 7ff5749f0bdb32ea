"""The results of a sweep: the rows of all cases, their mean, and bands about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.packages import optional_packages
from multiscale.results.history import COLUMNS, data_frame
from multiscale.sweeps.cases import Case
from multiscale.sweeps.journal import CaseResult

Array = NDArray[np.float64]

_COLUMNS = {column.name: index for index, column in enumerate(COLUMNS)}
_NUMBERS = [name for name in _COLUMNS if name != "reason"]
_BAND = (0.05, 0.95)  # quantiles
_AVERAGED = ("approach_mm", "force_N", "mean_pressure_MPa", "contact_area_fraction")
_DRAWN = ("surface.spectrum.seed", "surface.file")  # keys over whose values means are taken


@dataclass(frozen=True, kw_only=True)
class SweepResults:
    """The results of a sweep. A column of ``history.csv`` is an attribute of shape (cases, steps).

    NaN stands where a case has no such load step or no value.

    Attributes:
        cases: All cases of the sweep.
        results: What each came to, in the same order; None for those that are still to be run.
    """

    cases: Sequence[Case]
    results: Sequence[CaseResult | None]

    def __len__(self) -> int:
        return len(self.cases)

    def __getattr__(self, name: str) -> Array:
        if name not in _NUMBERS:
            raise AttributeError(f"'{type(self).__name__}' has no attribute '{name}'")
        index, rows = _COLUMNS[name], [[] if one is None else one.rows for one in self.results]
        values = np.full((len(rows), max(map(len, rows), default=0)), np.nan)
        for line, found in zip(values, rows, strict=True):
            line[: len(found)] = [np.nan if row[index] is None else row[index] for row in found]
        return values

    def __dir__(self) -> list[str]:
        return sorted([*super().__dir__(), *_NUMBERS])

    @property
    def keys(self) -> tuple[str, ...]:
        """The varied keys of the scene."""
        return tuple(self.cases[0].values)

    @property
    def unfinished(self) -> int:
        """Number of cases that are still to be run."""
        return sum(result is None for result in self.results)

    @property
    def failures(self) -> dict[str, str]:
        """Why cases ended early, by name of the case."""
        return {one.case: one.failure for one in self.results if one is not None and one.failure}

    def where(self, values: Mapping[str, Any]) -> SweepResults:
        """Return the part of a sweep whose keys have given values.

        Args:
            values: Values by dotted key, as they were varied.

        Raises:
            InputError: When no case has them.
        """
        chosen = [values.items() <= case.values.items() for case in self.cases]
        if not any(chosen):
            raise InputError("no case of the sweep has these values", value=dict(values))
        return SweepResults(
            cases=list(compress(self.cases, chosen)), results=list(compress(self.results, chosen))
        )

    def ensembles(self) -> list[tuple[dict[str, Any], SweepResults]]:
        """Return the parts of a sweep that differ in seed or file alone, and their other values.

        Where neither is varied every case is a part of its own: a mean over other keys says little.
        """
        others = [key for key in self.keys if key not in _DRAWN]
        chosen = [{key: case.values[key] for key in others} for case in self.cases]
        different = [values for index, values in enumerate(chosen) if values not in chosen[:index]]
        return [(values, self.where(values)) for values in different]

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

    def _finished(self, name: str) -> Array:
        """Return a column of the cases that ended well, shape (cases, steps)."""
        whole = [one is not None and not one.failure for one in self.results]
        values = getattr(self, name)[whole]
        if not any(whole):
            raise InputError("no case is finished, so there is no mean", key=name)
        if np.isnan(self.step[whole]).any():
            raise InputError(
                "cases took different numbers of load steps, so there is no mean",
                key="load.force_change",
                allowed="leave it out",
            )
        return values

    def records(self) -> list[dict[str, Any]]:
        """Return the load steps of all cases: varied values, then the row of ``history.csv``."""
        return [
            {"case": case.number, **case.values, **dict(zip(_COLUMNS, row, strict=True))}
            for case, result in zip(self.cases, self.results, strict=True)
            for row in (result.rows if result is not None else ())
        ]

    def case_records(self) -> list[dict[str, Any]]:
        """Return a record for every case: varied values, its last load step, and its failure."""
        last = {record["case"]: record for record in self.records()}
        empty = dict.fromkeys(_COLUMNS)
        return [
            {"case": case.number, **case.values, **empty, **last.get(case.number, {})}
            | {"status": "to be run" if result is None else result.failure or "done"}
            for case, result in zip(self.cases, self.results, strict=True)
        ]

    def ensemble_records(self) -> list[dict[str, Any]]:
        """Return mean and band of force, approach and area at every load step of each ensemble."""
        records = []
        for values, part in self.ensembles():
            table: dict[str, Array] = {"step": part.mean("step").astype(int)}
            for name in _AVERAGED:
                table[name] = part.mean(name)
                table[f"{name}_low"], table[f"{name}_high"] = part.band(name)
            rows = zip(*(column.tolist() for column in table.values()), strict=True)
            records += [{**values, **dict(zip(table, row, strict=True))} for row in rows]
        return records

    def to_dataframe(self) -> Any:
        """Return `records` as a pandas data frame.

        Raises:
            ImportError: When pandas, which patchlaw does not require, is not installed.
        """
        return data_frame(self.records())

    def plot(self) -> Any:
        """Draw mean pressure over approach: every case, and mean and band of every ensemble.

        Returns:
            A matplotlib figure.

        Raises:
            InputError: When no case is finished, or they took different numbers of load steps.
        """
        with optional_packages():
            from multiscale.sweeps.figure import Ensemble, sweep_figure  # loads matplotlib

        names = ("approach_mm", "mean_pressure_MPa", "contact_area_fraction")
        return sweep_figure(
            [
                Ensemble(_label(values), *(part._finished(name) for name in names))
                for values, part in self.ensembles()
            ]
        )


def _label(values: Mapping[str, Any]) -> str:
    """Return the values of keys as a legend shows them, without the sections of the keys."""
    return ", ".join(
        f"{key.rpartition('.')[2].replace('_', ' ')} {value}" for key, value in values.items()
    )
