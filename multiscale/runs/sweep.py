"""A sweep: a scene for all combinations of values of its keys, and what comes of it.

Every rank holds the results of all cases, in the order of their numbers, so that the number of
ranks does not change a bit of what is computed from them.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from patchlaw.multiscale.console import case_progress
from patchlaw.multiscale.loading.load_step import COLUMNS
from patchlaw.multiscale.runs.cases import CaseResult, Journal, run_case, run_cases
from patchlaw.multiscale.scene.scene import CONTENT, Scene, content_digest, identity, parsed
from patchlaw.support import Array, Comm, Counts, InputError, checked, on_root, place_in, together
from patchlaw.support.files import plain
from patchlaw.support.packages import by_matplotlib
from patchlaw.support.readable import (
    Caution,
    Displayed,
    Table,
    column,
    data_frame,
    of_columns,
    spread,
)

MOST_CASES = 100_000
"""Most cases of a sweep: every rank holds the rows of all, some 10 kB for 8 load steps of each."""
_RANGE = re.compile(r"(-?\d+)\.\.(-?\d+)")
_NUMBERS = re.compile(r"[\d.]+")
_FILE_KEYS = ("file", "mesh")  # last parts of their names; sections may hold them too


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One case of a sweep.

    Attributes:
        number: Position in the sweep, from 0.
        values: The values of the varied keys, by dotted key.
        base: The scene that all cases start from.
    """

    number: int
    values: dict[str, Any]
    base: Scene

    @property
    def scene(self) -> Scene:
        """The scene with these values, made anew at every access.

        Raises:
            InputError: When the scene is wrong.
        """
        return self.base.with_(self.values)

    @property
    def name(self) -> str:
        """The values as a text."""
        return _text(self.values)

    @property
    def key(self) -> str:
        """The values, and what stands for the content of files that they may name, as a text."""
        named = any(
            key.rpartition(".")[2] in _FILE_KEYS or isinstance(value, dict | list)
            for key, value in self.values.items()
        )
        paths = self.scene.files() if named else {}
        return _text(self.values | {CONTENT + key: _digest(path) for key, path in paths.items()})


def sweep_cases(scene: Scene, vary: Mapping[str, Iterable[Any]]) -> list[Case]:
    """Return every combination of the varied values; the last key varies fastest.

    Args:
        scene: The scene that all cases start from.
        vary: Values by dotted key.

    Raises:
        InputError: When nothing is varied, a key has no values or one twice, or there are too many
            cases. Scenes are not made.
    """
    allowed = '{"section.key": [value, …]}'
    for key, values in vary.items():
        if isinstance(values, str | bytes | Mapping) or not isinstance(values, Iterable):
            raise InputError("is no list of values", key=key, value=values, allowed=allowed)
    lists = {key: [plain(value) for value in values] for key, values in vary.items()}
    if not lists:
        raise InputError("varies nothing", key="--vary", allowed="KEY=VALUES, at least once")
    for key, values in lists.items():
        if not values or len({_text(value) for value in values}) < len(values):
            problem = "has no values" if not values else "takes a value twice"
            raise InputError(problem, key=key, value=values, allowed="different values")
    count = math.prod(map(len, lists.values()))
    if count > MOST_CASES:
        raise InputError(f"make {count} cases", key=" × ".join(lists), allowed=f"≤ {MOST_CASES}")
    _digest.cache_clear()  # files may have changed since the last sweep
    return [
        Case(number=number, values=dict(zip(lists, values, strict=True)), base=scene)
        for number, values in enumerate(product(*lists.values()))
    ]


@cache
def _digest(path: Path) -> str:
    return content_digest(path)


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True, default=str)


def values_from_text(text: str) -> tuple[str, list[Any]]:
    """Read a varied key from the command line.

    Args:
        text: ``KEY=VALUES``. The values are a range of whole numbers with both ends (``0..19``), a
            list in TOML (``["1 GPa", "4 GPa"]``), or texts and numbers between commas
            (``1 GPa, 4 GPa``).

    Returns:
        The dotted key, and its values.

    Raises:
        InputError: When the text is nothing of this kind.
    """
    key, equals, values = (part.strip() for part in text.partition("="))
    if not (equals and key and values):
        raise InputError("varies no key", key="--vary", value=text, allowed="KEY=VALUES")
    if ends := _RANGE.fullmatch(values):
        first, last = int(ends[1]), int(ends[2])
        if not 0 <= last - first < MOST_CASES:
            raise InputError(
                "is no range", key=f"--vary {key}", value=values,
                allowed=f"first..last, at most {MOST_CASES} numbers",
            )  # fmt: skip
        return key, list(range(first, last + 1))
    if values.startswith("["):
        return key, _array(values, text)
    return key, [_array(f"[{part}]", text, part)[0] for part in map(str.strip, values.split(","))]


def _array(array: str, text: str, plain: str | None = None) -> list[Any]:
    """Return a TOML array as a list; what is no TOML is a plain text, where that is allowed."""
    try:
        found = parsed(f"values = {array}")
        if found.keys() == {"values"} and found["values"]:
            return found["values"]
    except ValueError:
        if plain:
            return [plain]
    raise InputError("is no list of values", key="--vary", value=text, allowed="KEY=[…, …]")


NUMBERS = tuple(column.name for column in COLUMNS if column.name != "reason")
"""Columns of ``history.csv`` that are numbers."""
FIELDS = ("cases", "mean", "deviation", "smallest", "low", "median", "high", "largest")
"""Numbers of a column at a load step; the deviation is that of a sample, the band 5 to 95 %."""
QUANTILES = (0.05, 0.5, 0.95)
BINS = 20
"""Bins of a histogram, equally wide from the smallest to the largest value."""

_SHOWN = (
    ("approach_mm", "approach", "mm"),
    ("force_N", "force", "N"),
    ("mean_pressure_MPa", "pressure", "MPa"),
    ("contact_area_fraction", "area", "%"),
)
"""Columns of a sweep that is displayed, with headings and units."""
_COLUMNS = tuple(column.name for column in COLUMNS)
_DRAWN = ("surface.spectrum.seed", "counter_surface.spectrum.seed", "counter_surface.shift")
"""Keys over whose values statistics are taken: draws of one roughness. Files are compared."""


@checked
def sweep(
    scene: Scene,
    vary: Mapping[str, Iterable[Any]],
    comm: Comm | None = None,
    *,
    folder: str | Path | None = None,
    part: tuple[int, int] = (1, 1),
    observe: Callable[[Case, CaseResult], object] | None = None,
    progress: bool = False,
) -> SweepResults:
    """Run a scene for all combinations of values of its keys.

    A case that does not converge is recorded and does not end the sweep.

    Args:
        scene: The scene that all cases start from.
        vary: Values by dotted key, as ``{"surface.spectrum.seed": range(20)}``.
        comm: MPI communicator (mpi4py); None runs on this process alone.
        folder: Folder where cases that are done are stored, in one file for each rank, so that the
            next call goes on from them, on any number of ranks; None stores nothing.
        part: This call runs the k-th of n parts of the cases, as one job of many; from 1.
        observe: Called on its rank with every case that is done now.
        progress: Whether the cases that are done are shown, in the terminal or below a notebook's
            cell; instead of `observe`.

    Returns:
        The results of all cases that are done, those of other parts too, on every rank.

    Raises:
        InputError: When a case's scene is wrong, or the folder holds cases of another scene.

    Note:
        Collective.
    """
    which, parts = part
    if not 1 <= which <= parts:
        raise InputError(
            "is no part of a sweep", key="part", value=f"{which}/{parts}", allowed="1/n … n/n"
        )
    rank, size = place_in(comm)

    def checked_cases() -> list[Case]:
        """Return the cases; each rank makes the scenes of some, so that wrong ones are told."""
        cases = sweep_cases(scene, vary)
        for case in cases[rank::size]:
            _ = case.scene
        return cases

    cases = together(comm, checked_cases)
    journal = Journal(folder, on_root(comm, lambda: identity(scene)))
    shown = case_progress(comm, len(cases), parts) if progress else nullcontext(observe)
    with shown as tell:
        results = run_cases(
            cases, lambda case, progress: run_case(case.scene, progress=progress), journal, comm,
            part=part, observe=tell,
        )  # fmt: skip
    return SweepResults(cases, results)


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
    histograms: Counts

    def of(self, column: str, field: str) -> Array:
        """Return one of `FIELDS` of a column at all load steps, shape (steps,).

        Args:
            column: Name of the column.
            field: Name of the number, such as ``"median"``.
        """
        return np.asarray(self.values[:, NUMBERS.index(column), FIELDS.index(field)])


class SweepResults(Displayed):
    """The results of a sweep. A column of ``history.csv`` is an attribute of shape (cases, steps).

    NaN stands where a case has no such load step or no value.

    Args:
        cases: The cases.
        results: What those came to that are done, by their numbers.

    Attributes:
        cases: The cases.
        keys: The varied keys of the scene.
        failures: Why cases ended early, by name of the case, in the order of the cases.
        unfinished: Number of cases that are still to be run.
    """

    def __init__(self, cases: Sequence[Case], results: Mapping[int, CaseResult]) -> None:
        self.cases, self._all = cases, results
        self.keys = tuple(cases[0].values)
        self._results = [results.get(case.number) for case in cases]
        self.unfinished = self._results.count(None)
        known = zip(cases, self._results, strict=True)
        self.failures = {case.name: one.failure for case, one in known if one and one.failure}

    @property
    def warnings(self) -> list[str]:
        """What was warned of, and in how many cases; of what differs in its numbers one of them.

        What puts results into question is a `Caution`.
        """
        found: dict[tuple[type[str], str], list[tuple[str, str]]] = {}
        known = [(case, one) for case, one in zip(self.cases, self._results, strict=True) if one]
        for case, result in known:
            for kind, texts in ((Caution, result.cautions), (str, result.warnings)):
                for text in texts:
                    found.setdefault((kind, _NUMBERS.sub("", text)), []).append((text, case.name))
        said = []
        for (kind, _), those in found.items():
            (text, name), count = those[0], len(those)
            some = f"{count} of {len(self)} cases, as {name}: " if count < len(self) else ""
            said.append(kind(some + text))
        return said

    def __len__(self) -> int:
        return len(self.cases)

    def __getattr__(self, name: str) -> Array:
        if name not in NUMBERS:
            raise AttributeError(f"'{type(self).__name__}' has no attribute '{name}'")
        return self._columns([name], self._results)[..., 0]

    def __dir__(self) -> list[str]:
        return sorted([*super().__dir__(), *NUMBERS])

    def where(self, values: Mapping[str, Any]) -> SweepResults:
        """Return the part of a sweep whose keys have given values.

        Args:
            values: Values by dotted key, as they were varied.

        Raises:
            InputError: When no case has them.
        """
        chosen = [case for case in self.cases if values.items() <= case.values.items()]
        if not chosen:
            raise InputError("no case of the sweep has these values", value=dict(values))
        return SweepResults(chosen, self._all)

    def ensembles(self) -> list[tuple[dict[str, Any], SweepResults]]:
        """Return the parts of a sweep that differ in seed alone, and their other values.

        Where none is varied every case is a part of its own: a mean over other keys says little.
        """
        parts: dict[str, tuple[dict[str, Any], list[Case]]] = {}
        for case in self.cases:
            values = {key: value for key, value in case.values.items() if key not in _DRAWN}
            parts.setdefault(repr(values), (values, []))[1].append(case)
        return [(values, SweepResults(cases, self._all)) for values, cases in parts.values()]

    @cached_property
    def statistics(self) -> list[tuple[dict[str, Any], Statistics]]:
        """Values of each ensemble, and the statistics of its cases that ended well.

        Raises:
            InputError: When cases of an ensemble took different numbers of load steps, so that the
                same step is not the same load.
        """
        parts = self.ensembles()
        return [(values, column_statistics(part._ended(NUMBERS))) for values, part in parts]

    def mean(self, name: str) -> Array:
        """Return the mean of a column over the finished cases, shape (steps,).

        Args:
            name: Name of the column.

        Raises:
            InputError: When no case is finished, or they took different numbers of load steps.
        """
        return np.mean(self._finished(name), axis=0)

    def band(self, name: str, quantiles: Sequence[float] = (QUANTILES[0], QUANTILES[-1])) -> Array:
        """Return quantiles of a column over the finished cases, shape (quantiles, steps).

        Args:
            name: Name of the column.
            quantiles: Shares of the cases that lie below; by default 5 and 95 %.

        Raises:
            InputError: When no case is finished, or they took different numbers of load steps.
        """
        return np.quantile(self._finished(name), quantiles, axis=0)

    def records(self) -> Iterator[dict[str, Any]]:
        """Yield a record for every load step of every case, as ``history.csv`` has them."""
        for case, result in zip(self.cases, self._results, strict=True):
            for row in () if result is None else result.rows:
                yield {"case": case.number, **case.values,
                       **dict(zip(_COLUMNS, row, strict=True))}  # fmt: skip

    def case_records(self) -> Iterator[dict[str, Any]]:
        """Yield a record for every case: values, its last load step, and its failure."""
        for case, result in zip(self.cases, self._results, strict=True):
            last = result.rows[-1] if result is not None and result.rows else [None] * len(_COLUMNS)
            status = "to be run" if result is None else result.failure or "done"
            row = dict(zip(_COLUMNS, last, strict=True))
            yield {"case": case.number, **case.values, **row, "status": status}

    def statistics_records(self) -> list[dict[str, Any]]:
        """Return `FIELDS` and histogram of every column at every load step of each ensemble."""
        records = []
        for values, part in self.statistics:
            for step, place in np.argwhere(part.values[..., 0] > 0.0):
                described = dict(zip(FIELDS, part.values[step, place].tolist(), strict=True))
                described["cases"] = int(described["cases"])
                bins = " ".join(map(str, part.histograms[step, place].tolist()))
                of = {"step": int(step) + 1, "column": NUMBERS[place]}
                records.append({**values, **of, **described, "histogram": bins})
        return records

    def to_dataframe(self) -> Any:
        """Return `records` as a pandas data frame.

        Raises:
            ImportError: When pandas, which patchlaw does not require, is not installed.
        """
        return data_frame(list(self.records()))

    def displayed(self) -> tuple[str, Table]:
        """Return what was varied in a line, and a table of the cases at their last load steps."""
        records = list(self.case_records())
        shown = [records[place] for place in spread(len(records), 60)]
        columns = [["case", *(str(one["case"]) for one in shown)]]
        columns += [[key, *(str(one[key]) for one in shown)] for key in self.keys]
        for name, heading, unit in _SHOWN:
            values = (np.nan if one[name] is None else one[name] for one in shown)
            columns.append(column(heading, values, unit))
        if self.failures or self.unfinished:
            columns.append(["status", *(one["status"] for one in shown)])
        line = f"SweepResults of {len(self)} cases over {', '.join(self.keys)}"
        return f"{line}; the last load step of each", of_columns(*columns)

    def plot(self) -> Any:
        """Draw mean pressure over approach: cases, and mean and band of every ensemble.

        Returns:
            A matplotlib figure.

        Raises:
            InputError: When no case is finished, or they took different numbers of load steps.
        """
        if self.unfinished == len(self):
            raise InputError("no case is finished, so there is nothing to draw")
        return by_matplotlib("multiscale.results.figures.studies.sweep_figure", self)

    def _columns(self, names: Sequence[str], results: Sequence[CaseResult | None]) -> Array:
        """Return columns of some cases, shape (cases, steps, columns), NaN where nothing is."""
        places = [_COLUMNS.index(name) for name in names]
        rows = [() if one is None else one.rows for one in results]
        table = np.full((len(rows), max(map(len, rows), default=0), len(names)), np.nan)
        for lines, known in zip(table, rows, strict=True):
            for line, row in zip(lines, known, strict=False):
                line[:] = [np.nan if row[place] is None else row[place] for place in places]
        return table

    def _ended(self, names: Sequence[str]) -> Array:
        """Return columns of the cases that ended well, shape (cases, steps, columns)."""
        ended = [one for one in self._results if one is not None and not one.failure]
        if len({len(one.rows) for one in ended}) > 1:
            raise InputError(
                "cases took different numbers of load steps, so there is no mean",
                key="load.force_change",
                allowed="leave it out",
            )
        return self._columns(names, ended)

    def _finished(self, name: str) -> Array:
        """Return a column of the cases that ended well, shape (cases, steps)."""
        column = self._ended([name])[..., 0]
        if not len(column):
            raise InputError("no case is finished, so there is no mean", key=name)
        return column


def column_statistics(table: Array) -> Statistics:
    """Return the statistics of columns over the cases that have a value.

    Args:
        table: The columns, shape (cases, steps, columns); NaN where a case has no value.
    """
    shape = table.shape[1:]
    described, bins = np.full((*shape, len(FIELDS)), np.nan), np.zeros((*shape, BINS), np.int64)
    described[..., 0] = 0.0
    for place in np.ndindex(shape):
        values = table[:, place[0], place[1]]
        values = np.ascontiguousarray(values[~np.isnan(values)])
        if values.size:
            deviation = np.std(values, ddof=1) if values.size > 1 else np.nan
            low, median, high = np.quantile(values, QUANTILES)
            least, most = values.min(), values.max()
            described[place] = (
                values.size, values.mean(), deviation, least, low, median, high, most,
            )  # fmt: skip
            shares = (values - least) / ((most - least) or 1.0) * BINS
            places = np.minimum(shares.astype(np.int64), BINS - 1)
            bins[place] = np.bincount(places, minlength=BINS)
    return Statistics(values=described, histograms=bins)
