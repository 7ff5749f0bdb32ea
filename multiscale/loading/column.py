"""The columns of ``history.csv``: each is declared once, at the attribute of the load step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, MISSING, dataclass, field, fields
from itertools import count
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from patchlaw.multiscale.readable import SCALED_UNITS, usual_unit, with_error

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
        table: The table that the column stands in: ``"curve"``, ``"more"`` for what some runs
            alone know, ``"solver"``.
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
    table: str = "curve"
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
        texts = [
            "–"
            if value is None
            else with_error(value / size, error / size, self.digits)
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
