"""Sets the results of two runs beside each other: ratios at equal loads, with both errors.

Only the first rise of the load is compared, up to where it first falls. Both runs are read at the
loads that both have or, without any, at all loads of either that lie within the range of both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from patchlaw.multiscale.results.history import History
from patchlaw.multiscale.results.run_curves import (
    APPROACH,
    LOADS,
    OTHERS,
    PRESSURE,
    SAME,
    SLID,
    Curves,
    Quantity,
    StudiedRun,
    common_loads,
    first_rise,
    from_one_zero,
    nominal_area,
    over_pressure,
    slides,
    zone_quantities,
)
from patchlaw.multiscale.runs import AT
from patchlaw.multiscale.scene.schema import flat, scene_keys
from patchlaw.support import Array, InputError, check_fields, checked
from patchlaw.support.packages import by_matplotlib
from patchlaw.support.readable import (
    SCALED_UNITS,
    Displayed,
    Table,
    column,
    data_frame,
    number,
    of_columns,
    percent,
    quantity,
    shown_unit,
    spread,
    usual,
    with_error,
)

_MOST_CHANGES = 40
"""Keys of the scenes that are listed at most."""


class Ratio(NamedTuple):
    """A quantity of both runs at n equal loads; what is not known is NaN.

    Attributes:
        name: Name of the quantity, which ends in its unit.
        text: Its name in words.
        unit: Its unit.
        values: Values of the first and of the second run, shape (2, n).
        errors: Their errors, those of interpolation included, shape (2, n).
    """

    name: str
    text: str
    unit: str
    values: Array
    errors: Array

    @property
    def ratio(self) -> Array:
        """Second over first, shape (n,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.values[0] != 0.0, self.values[1] / self.values[0], np.nan)

    @property
    def error(self) -> Array:
        """Error of the ratio, the sum of both relative errors times the ratio, shape (n,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.abs(self.ratio) * np.abs(self.errors / self.values).sum(axis=0)

    def ratio_text(self, index: int) -> str:
        """Return the ratio at a load, with its error where that is known.

        Args:
            index: Which of the loads.
        """
        return with_error(float(self.ratio[index]), _known(self.error[index]), 4)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Difference(Displayed):
    """Two runs beside each other.

    Attributes:
        names: Names of the first and of the second run.
        histories: Their load steps.
        at: What they have in common: ``"pressure"``, the mean pressure, ``"approach"``, or
            ``"slid"``, the distance slid.
        loads: Where they are compared, rising, shape (n,) [MPa or mm].
        ratios: Every quantity that both have; that which the load does not prescribe first.
        changes: Keys of the scenes that differ, with both values; empty where not known.
        notes: What a reader should know.
    """

    names: tuple[str, str]
    histories: tuple[History, History]
    at: str
    loads: Array
    ratios: tuple[Ratio, ...]
    changes: tuple[tuple[str, str, str], ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, finite=False)

    @checked
    def of(self, name: str) -> Ratio:
        """Return a quantity of both runs.

        Args:
            name: Its name, such as ``"approach_mm"``.

        Raises:
            InputError: When one of the runs does not have it.
        """
        for ratio in self.ratios:
            if ratio.name == name:
                return ratio
        known = ", ".join(ratio.name for ratio in self.ratios)
        raise InputError("is not known of both runs", key="name", value=name, allowed=known)

    @property
    def load(self) -> Quantity:
        """What they have in common."""
        return LOADS[self.at]

    def load_text(self, index: int = -1) -> str:
        """Return a load with its unit, as text.

        Args:
            index: Which of the loads; the largest by default.
        """
        return f"{self.load.text} {usual(float(self.loads[index]), self.load.unit)}"

    def records(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of ``diff.csv``: every quantity at every load, as a dictionary."""
        for index, value in enumerate(self.loads.tolist()):
            for one in self.ratios:
                numbers = {
                    "first": one.values[0],
                    "first_error": one.errors[0],
                    "second": one.values[1],
                    "second_error": one.errors[1],
                    "ratio": one.ratio,
                    "ratio_error": one.error,
                }
                at = {f"at_{self.load.name}": value, "quantity": one.name}
                yield at | {name: float(values[index]) for name, values in numbers.items()}

    def to_dataframe(self) -> Any:
        """Return the rows of ``diff.csv`` as a pandas data frame.

        Raises:
            ImportError: When pandas, which patchlaw does not require, is not installed.
        """
        return data_frame(list(self.records()))

    def table(self, index: int = -1) -> Table:
        """Return headings and rows: every quantity of both runs, and their ratio, at one load.

        Args:
            index: Which of the loads; the largest by default.
        """
        first, second = self.names
        rows = []
        for one in self.ratios:
            name, size = shown_unit(one.values[:, index].tolist(), one.unit)
            both = [
                with_error(value / size, _known(error / size))
                for value, error in zip(one.values[:, index], one.errors[:, index], strict=True)
            ]
            rows.append((f"{one.text} [{name}]", *both, one.ratio_text(index)))
        return ("at " + self.load_text(index), first, second, f"{second} / {first}"), rows

    def load_table(self, most: int = 40) -> Table:
        """Return headings and rows: the ratios of all quantities at all loads.

        Args:
            most: Largest number of loads shown; of more, so many at equal distances.
        """
        chosen = spread(len(self.loads), most)
        loads = column(self.load.text, self.loads[chosen], self.load.unit)
        ratios = ([one.text, *(one.ratio_text(k) for k in chosen)] for one in self.ratios)
        return of_columns(loads, *ratios)

    @property
    def over_pressure(self) -> Difference | None:
        """The difference at equal pressures, where both runs rise through several of them."""
        if not all(map(over_pressure, self.histories)):
            return None
        if self.at == "pressure":
            return self
        try:
            return difference(*self.histories, names=self.names, at="pressure")
        except InputError:
            return None

    def power_table(self) -> Table:
        """Return headings and rows: the power of the mean pressure p that quantities follow."""
        first, second = (
            {one.quantity.text: one.text for one in over_pressure(each) if one.laws}
            for each in self.histories
        )
        rows = [(text, law, second[text]) for text, law in first.items() if text in second]
        return ("power of the mean pressure p", *self.names), rows

    def plot(self) -> Any:
        """Draw the curves of both runs over each other, and the ratios.

        Returns:
            A matplotlib figure; a notebook shows it.
        """
        return by_matplotlib("multiscale.results.figures.studies.difference_figure", self)

    def displayed(self) -> tuple[str, Table]:
        """Return what is compared in a line, and the table of the last load."""
        return f"Difference of {self.names[1]} from {self.names[0]}", self.table()


@checked
def difference(
    first: History | str | Path,
    second: History | str | Path,
    *,
    names: Sequence[str] | None = None,
    at: str | None = None,
) -> Difference:
    """Set two runs beside each other: every quantity of the second over that of the first.

    Quantities do not grow with the face: pressures instead of forces, stiffness and conductance per
    nominal area. Leaks alone are those of the whole face, or map. Errors are those that the runs
    measured, and of what is interpolated.

    Args:
        first: A history, or the folder that ``patchlaw run`` wrote.
        second: The other one.
        names: What to call them; by default their folders' names.
        at: What is to be equal where they are compared, ``"pressure"``, ``"approach"`` or
            ``"slid"``; by default the distance slid where both wear over a common range of it, the
            approach where both runs prescribe it, and else the mean pressure.

    Raises:
        InputError: When a folder holds no run, or the runs have no load in common.
    """
    if at not in (*AT, None):
        raise InputError("is nothing to compare at", key="at", value=at, allowed=", ".join(AT))
    if names is not None and len(names) != 2:
        raise InputError("are not the names of two runs", key="names", value=names)
    runs = [StudiedRun.of(one) for one in (first, second)]
    chosen = tuple(names or _names((first, second)))
    whole = (runs[0].history, runs[1].history)
    risen = [first_rise(run.history, name) for run, name in zip(runs, chosen, strict=True)]
    risen, zero_notes, has_approach = from_one_zero(runs, risen)
    at = _in_common(at, runs, risen, chosen, has_approach=has_approach)
    load = LOADS[at]
    responses = [one for one in (APPROACH, PRESSURE) if one is not load]
    responses = responses if has_approach else responses[1:]
    curves = [Curves(history, load) for history in risen]
    loads = common_loads(curves, chosen, load)
    zones = [getattr(history.patches, "names", ()) for history in whole]
    named = [name for name in zones[0] if name in zones[1] and max(map(len, zones)) > 1]
    wanted = (*responses, *OTHERS, *zone_quantities(named))
    ratios = [_ratio(quantity, curves, loads) for quantity in wanted]
    known = [one for one in ratios if np.nan_to_num(one.values).any()]
    return Difference(
        names=(chosen[0], chosen[1]),
        histories=whole,
        at=at,
        loads=loads,
        ratios=tuple(known),
        changes=tuple(_changes(runs)),
        notes=(*zero_notes, *_notes(whole, risen, chosen, curves)),
    )


def _in_common(
    at: str | None,
    runs: Sequence[StudiedRun],
    risen: Sequence[History],
    names: Sequence[str],
    *,
    has_approach: bool,
) -> str:
    """Return what is equal where two runs are compared; refuse what one of them does not have."""
    slid = [history.slid_mm[slides(history)] for history in risen]
    if at is None:
        if slid[0].size and slid[1].size:
            least, most = max(slid[0][0], slid[1][0]), min(slid[0][-1], slid[1][-1])
            if least <= (1.0 + SAME) * most:
                return "slid"
        prescribed = [(run.history.approach_error_mm == 0.0).any() for run in runs]
        return "approach" if all(prescribed) and has_approach else "pressure"
    if at == "approach" and not has_approach:
        problem = "approaches count from the mean of a periodic surface in one run alone"
        raise InputError(problem, key="at", value=at, allowed="pressure")
    if at == "slid" and not (slid[0].size and slid[1].size):
        name = names[bool(slid[0].size)]
        raise InputError("has no load step that slides", key=name, allowed="pressure, approach")
    return at


def _names(given: Sequence[History | str | Path]) -> tuple[str, str]:
    """Return names of two runs: of folders as much of their paths as tells them apart."""
    if any(isinstance(one, History) for one in given):
        return "first", "second"
    parts = [Path(str(one)).resolve().parts for one in given]
    for count in range(1, max(map(len, parts)) + 1):
        first, second = ("/".join(one[-count:]) for one in parts)
        if first != second:
            return first, second
    return f"{first} (1)", f"{second} (2)"


def _ratio(quantity: Quantity, curves: Sequence[Curves], loads: Array) -> Ratio:
    values, errors = np.swapaxes([curve.at(quantity, loads) for curve in curves], 0, 1)
    return Ratio(quantity.name, quantity.text, quantity.unit, values, errors)


def _known(error: float) -> float | None:
    return float(error) if np.isfinite(error) else None


def _changes(runs: Sequence[StudiedRun]) -> Iterator[tuple[str, str, str]]:
    """Yield keys of the scenes that differ, with both values; heights last."""
    scenes = [run.scene for run in runs]
    if scenes[0] is None or scenes[1] is None:
        return
    first, second = (dict(flat(scene)) for scene in scenes if scene is not None)
    keys = [key for key in (first | second) if not key.startswith("output.")]
    differing = [key for key in keys if first.get(key) != second.get(key)]
    known = scene_keys()
    for key in differing[:_MOST_CHANGES]:
        unit = known[key].unit if key in known else ""
        yield key, _said(first.get(key), unit), _said(second.get(key), unit)
    if len(differing) > _MOST_CHANGES:
        yield "…", f"{len(differing) - _MOST_CHANGES} more", ""
    if runs[0].heights != runs[1].heights:
        yield "heights, SHA-256", runs[0].heights[:12] + "…", runs[1].heights[:12] + "…"


def _said(value: Any, unit: str = "") -> str:
    """Return a value as a cell shows it, a number with its unit."""
    if isinstance(value, float) and unit in SCALED_UNITS:
        return quantity(value, unit, 6)
    text = "–" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:59]}…"


def _notes(
    whole: Sequence[History],
    risen: Sequence[History],
    names: Sequence[str],
    curves: Sequence[Curves],
) -> Iterator[str]:
    """Yield what a reader of the ratios should know."""
    areas = [nominal_area(history) for history in whole]
    if abs(areas[1] - areas[0]) > SAME * areas[0]:
        yield (
            f"nominal areas differ: {number(areas[0])} and {number(areas[1])} mm²; forces do by "
            f"{percent(areas[1] / areas[0] - 1.0, 3)} at equal mean pressures"
        )
    for history, rise, name in zip(whole, risen, names, strict=True):
        if left := len(history) - len(rise):
            yield f"{name}: {left} load steps without a force or after the first rise are left out"
    for curve, name in zip(curves, names, strict=True):
        if curve.slid:
            yield f"{name}: {curve.slid} load steps that slid to no larger load are left out"
        if curve.over is not SLID and slides(curve.history)[1:].any():
            yield f"{name}: the surfaces wear between load steps that are compared"
        if np.isnan(curve.load_error).all() and np.isnan(curve.history.approach_error_mm).all():
            yield f"{name} measured no error in its first rise; its values have none here"
    ends = [curve.load[-1] for curve in curves]
    if abs(ends[1] - ends[0]) > SAME * abs(ends[0]):
        yield "the runs end at different loads; errors that one measured at its end may lie beyond"
