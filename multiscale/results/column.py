"""The columns of ``history.csv``, each declared once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from multiscale.loading.load_step import LoadStep
from multiscale.readable import SCALED_UNITS, usual_unit, with_error


@dataclass(eq=False)
class Column:
    """A column of ``history.csv``, declared as an attribute of `History`.

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

    Attributes:
        name: Name of the column and of the attribute of `History`.
    """

    meaning: str
    unit: str = ""
    _: KW_ONLY
    heading: str = ""
    digits: int = 4
    error: str = ""
    table: str = "curve"
    name: str = field(init=False)

    def __post_init__(self) -> None:
        self.__doc__ = f"{self.meaning} [{self.unit}]." if self.unit else f"{self.meaning}."

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, history: None, owner: type) -> Column: ...

    @overload
    def __get__(self, history: object, owner: type) -> NDArray[Any]: ...

    def __get__(self, history: Any, owner: type) -> Column | NDArray[Any]:
        if history is None:
            return self
        values = [self.of(step) for step in history.steps]
        return np.array([np.nan if value is None else value for value in values])

    def of(self, step: LoadStep) -> Any:
        """Return the value of a load step, its attribute of this name; None if not measured."""
        return getattr(step, self.name)

    def error_of(self, step: LoadStep) -> float | None:
        """Return the error of the value of a load step; None if not known."""
        return getattr(step, self.error, None)

    def shown(self, steps: Sequence[LoadStep]) -> tuple[str, list[str]]:
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
