"""What a column of ``history.csv`` is; the records of leaks and natural modes that some show.

Each column is declared once, at the attribute of the load step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, MISSING, dataclass, field, fields, replace
from functools import partial
from itertools import count
from types import MappingProxyType
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from patchlaw.support.readable import SCALED_UNITS, usual_unit, with_error, with_most

REQUIRED: Any = MISSING
"""Default of columns that every load step has."""

_COLUMN = "column"
"""Key of a column in the metadata of a field."""
_places = count()


@dataclass(eq=False)
class Column:
    """A column of ``history.csv``, which is an attribute of load steps and of histories.

    Of a history it is the array of the values at all load steps; what was not measured is NaN.

    Args:
        meaning: What the column holds; with the unit it is the column's documentation.
        unit: Unit of the values; empty for plain numbers.
        heading: Heading in the tables of reports, terminals and notebooks; empty for a column
            that stands in the file alone.
        digits: Significant digits in those tables.
        error: Name of the load step's attribute that holds the error of the value; shown beside
            it. Empty for none.
        signed: Whether the sign is known whatever the error, which then states the most.
        table: The table that the column stands in: ``"more"`` for what some runs alone know,
            ``"curve"``, ``"solver"``.
        in_report: What reports call the value of the last load step, where they list it.

    Attributes:
        name: Name of the column and of the attribute.
        place: Place among all columns, in the order in which they are declared.
    """

    meaning: str
    unit: str = ""
    _: KW_ONLY
    heading: str = ""
    digits: int = 4
    error: str = ""
    signed: bool = False
    table: str = "more"
    in_report: str = ""
    name: str = field(default="", init=False)
    place: int = field(default_factory=_places.__next__, init=False)

    def __post_init__(self) -> None:
        self.__doc__ = f"{self.meaning} [{self.unit}]." if self.unit else f"{self.meaning}."

    @overload
    def __get__(self, history: None, owner: type) -> Column: ...

    @overload
    def __get__(self, history: object, owner: type) -> NDArray[Any]: ...

    def __get__(self, history: Any, owner: type) -> Column | NDArray[Any]:
        if history is None:
            return self
        values = [self.of(step) for step in history.steps]
        return np.array([np.nan if value is None else value for value in values])

    def of(self, step: Any) -> Any:
        """Return the value of a load step, its attribute of this name; None if not measured."""
        return getattr(step, self.name)

    def error_of(self, step: Any) -> float | None:
        """Return the error of the value of a load step; None if not known."""
        return getattr(step, self.error, None)

    def shown(self, steps: Sequence[Any]) -> tuple[str, list[str]]:
        """Return the heading with the unit that suits all load steps, and the value of each.

        Shares are shown in per cent, and values with their errors.

        Args:
            steps: The load steps.
        """
        values = [self.of(step) for step in steps]
        errors = [self.error_of(step) or 0.0 for step in steps]
        known = [value for value in values if value is not None]
        name, size = self.unit, 1.0
        if self.name.endswith("_fraction"):
            name, size = "%", 0.01
        elif self.unit in SCALED_UNITS:
            name, size = usual_unit(known, self.unit)
        text = with_most if self.signed else with_error
        texts = [
            "–"
            if value is None
            else text(value / size, error / size, self.digits)
            if isinstance(value, float)
            else str(value)
            for value, error in zip(values, errors, strict=True)
        ]
        return f"{self.heading} [{name}]" if name else self.heading, texts


class DerivedColumn(property):
    """A property of load steps that is a column.

    Args:
        read: Returns the value of a load step; None if not known.
        *about: What the column holds, and its unit, as of `Column`.
        **shown: How it is shown, likewise.
    """

    def __init__(self, read: Callable[[Any], Any], *about: str, **shown: Any) -> None:
        self.column = Column(*about, **shown)
        super().__init__(read, doc=self.column.__doc__)


def column(*about: str, default: Any = None, **shown: Any) -> Any:
    """Return a field of load steps that is a column.

    Args:
        *about: What the column holds, and its unit, as of `Column`.
        default: Value where it is not given; `REQUIRED` where there is none.
        **shown: How it is shown, as of `Column`.
    """
    return field(default=default, metadata={_COLUMN: Column(*about, **shown)})


def columns_of(record: Any) -> tuple[Column, ...]:
    """Return the columns of a class of load steps, in the order in which they are declared.

    Args:
        record: The class, a dataclass.
    """
    found = {one.name: one.metadata[_COLUMN] for one in fields(record) if one.metadata}
    derived = {n: one for n, one in vars(record).items() if isinstance(one, DerivedColumn)}
    found |= {name: one.column for name, one in derived.items()}
    for name, one in found.items():
        one.name = name
    return tuple(sorted(found.values(), key=lambda one: one.place))


RENAMED = {
    "stiffness_N_per_mm": "approach_stiffness_N_per_mm",
    "stiffness_error_N_per_mm": "approach_stiffness_error_N_per_mm",
}
"""Columns of versions before 2.0, and what they are called now."""


def unknown_column(record: Any, name: str) -> AttributeError:
    """Return the error of an attribute that a load step, or a history, does not have.

    Args:
        record: The load step or history.
        name: Name of the attribute.
    """
    text = f"{type(record).__name__!r} object has no attribute {name!r}"
    if name in RENAMED:
        text += (
            f": it is called {RENAMED[name]!r}, and contains the bodies; the stiffness of the "
            f"interface alone is {RENAMED[name].replace('approach', 'interface')!r}"
        )
    return AttributeError(text)


WAYS: Mapping[str, str] = MappingProxyType(
    {"x": "along x", "y": "along y", "face": "over the contact face"}
)
"""Where a fluid may flow."""

_PARTS = {
    "rate": ("leak{}_mm3_per_s", "Flow rate of the leak {}, 0 where the gap is closed", "mm³/s"),
    "error": ("leak_error{}_mm3_per_s", "Error of this flow rate", "mm³/s"),
    "transmissivity": ("transmissivity{}_mm3", "Transmissivity T of the gap {}", "mm³"),
    "hydraulic_gap": ("hydraulic_gap{}_mm", "Hydraulic gap {}, T^(1/3)", "mm"),
    "flow_factor": ("flow_factor{}", "Flow factor {}, T over the cube of the mean separation", ""),
    "constriction": (
        "constriction{}_fraction",
        "Part of the leak {} through the channel of the narrowest constriction",
        "",
    ),
    "percolates": (
        "percolates{}", "1 where an open path leads {}, 0 where the gap is closed", ""
    ),
}  # fmt: skip
"""Attributes of a leak, with name, meaning and unit of their columns."""
_HEADINGS = {"rate": "leak", "hydraulic_gap": "hydraulic gap", "flow_factor": "flow factor",
             "constriction": "narrowest channel"}  # fmt: skip
_OVER_FACE = ("rate", "error")
"""What is known of a leak over a face."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Leak:
    """The leak along one way.

    Attributes:
        way: A key of `WAYS`.
        rate: Flow rate from the first side, or the inlet, to the opposite one, or the outlet; 0
            where the gap is closed [mm³/s].
        error: Error of the flow rate; None where it was not measured [mm³/s].
        causes: Causes of the error, and how much each may change the flow rate [mm³/s]; empty where
            they were not measured, and where the leak was read back.
        transmissivity: T = 12 η Q L/(W ΔP) of the gap; None over a contact face [mm³].
        flow_factor: T/ḡ³ of the mean separation ḡ; None over a contact face, and without a gap.
        constriction: Part of the flow through the channel of the narrowest constriction; None where
            nothing flows, and where gaps of cells are not known.
    """

    way: str
    rate: float
    error: float | None = None
    causes: tuple[tuple[str, float], ...] = ()
    transmissivity: float | None = None
    flow_factor: float | None = None
    constriction: float | None = None

    @property
    def hydraulic_gap(self) -> float | None:
        """Gap between parallel plates that lets as much through, T^(1/3) [mm]."""
        return None if self.transmissivity is None else float(np.cbrt(self.transmissivity))

    @property
    def percolates(self) -> int:
        """1 where an open path leads through the gap, 0 where it is closed."""
        return int(self.rate != 0.0)

    def with_errors(self, causes: Mapping[str, float]) -> Leak:
        """Return the leak with its error, the sum of its causes.

        Args:
            causes: How much each may change the flow rate [mm³/s].
        """
        return replace(self, error=sum(causes.values()), causes=tuple(causes.items()))


def _columns(way: str) -> Iterator[tuple[str, str]]:
    """Yield the parts of a leak that have columns, and the names of these."""
    ending = "" if way == "face" else f"_{way}"
    for part, (name, *_) in _PARTS.items():
        if way != "face" or part in _OVER_FACE:
            yield part, name.format(ending)


def leak_columns() -> Iterator[tuple[str, DerivedColumn]]:
    """Yield the columns of all ways, with their names."""
    for way, words in WAYS.items():
        names = dict(_columns(way))
        for part, name in names.items():
            _, meaning, unit = _PARTS[part]
            rate = part == "rate"
            shown: dict[str, Any] = {"signed": rate, "error": names["error"] if rate else ""}
            if part in _HEADINGS:
                shown["heading"] = f"{_HEADINGS[part]} {words if way != 'face' else ''}".strip()
            read = partial(_of_leak, way, part)
            yield name, DerivedColumn(read, meaning.format(words), unit, **shown)


def _of_leak(way: str, part: str, step: Any) -> Any:
    return getattr(step.leak(way), part, None)


def leak_rates() -> Iterator[tuple[str, str]]:
    """Yield the names of the columns of flow rates, and where the fluid flows, in words."""
    for way, words in WAYS.items():
        yield dict(_columns(way))["rate"], words


def leaks_of(values: Mapping[str, Any]) -> tuple[Leak, ...]:
    """Return the leaks that the columns of a load step hold, without their causes.

    Args:
        values: Values by column; None for what is not known.
    """
    derived = ("hydraulic_gap", "percolates")
    known: dict[str, dict[str, Any]] = {
        way: {part: values.get(name) for part, name in _columns(way) if part not in derived}
        for way in WAYS
    }
    return tuple(Leak(way=way, **one) for way, one in known.items() if one["rate"] is not None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """A natural mode, a row of ``modes.csv``.

    Attributes:
        mode: Number of the mode, from 1 by rising frequency.
        frequency_Hz: Frequency [Hz]; 0 of a motion that does not vibrate.
        frequency_error_Hz: Sum of its errors by elements, load and laws, and residual; None where
            they were not measured [Hz].
        damping_per_s: Rate at which the vibration decays, below zero where it grows [1/s].
        contact_share: Share of the contact in the squared frequency.
        participation_x: Mass that moves along x in this mode, over the whole mass; likewise y, z.
        residual: Residual of the mode in the full problem, relative to its forces.
        element_error_Hz: Error by the elements; None where it was not measured [Hz].
    """

    mode: int
    frequency_Hz: float
    frequency_error_Hz: float | None = None
    damping_per_s: float
    contact_share: float
    participation_x: float
    participation_y: float
    participation_z: float
    residual: float
    element_error_Hz: float | None = None


MODE_COLUMNS = tuple(one.name for one in fields(Mode))
"""The columns of ``modes.csv`` after the number of the load step."""


def mode_rows(steps: Iterable[Any]) -> Iterator[list[Any]]:
    """Yield the rows of ``modes.csv``, those of all load steps."""
    for step in steps:
        yield from (
            [step.step, *(getattr(one, name) for name in MODE_COLUMNS)] for one in step.modes
        )


def modes_by_step(rows: Iterable[Mapping[str, str]]) -> dict[int, tuple[Mode, ...]]:
    """Return the modes of all load steps from the rows of ``modes.csv``."""
    found: dict[int, tuple[Mode, ...]] = {}
    for row in rows:
        known: dict[str, Any] = {name: float(row[name]) for name in MODE_COLUMNS if row[name]}
        one = Mode(**known | {"mode": int(row["mode"])})
        found[int(row["step"])] = (*found.get(int(row["step"]), ()), one)
    return found


def merged(modes: Iterable[Mode]) -> Iterator[tuple[Mode, Mode]]:
    """Yield pairs of modes that have merged: of one frequency, of which one grows."""
    before: Mode | None = None
    for one in modes:
        if before and before.damping_per_s < 0.0 < one.damping_per_s and one.frequency_Hz:
            yield before, one
        before = one
