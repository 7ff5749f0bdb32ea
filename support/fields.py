"""Units and limits of the fields of records, stated once, where a field is declared.

A record refuses what is beyond them by `support.arguments.check_fields`. Whatever reads records
from text, as scenes are read, finds them beside the types.
"""

from __future__ import annotations

import math
from dataclasses import MISSING, Field, dataclass, fields
from typing import Annotated, Any

KEY = "key"
"""Metadata of a dataclass's field: its name in scene files; None where it is no key of theirs."""


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit of a number, or of several.

    Args:
        name: The unit in pint's notation; empty for a ratio.
        several: Whether the field holds a tuple, for which users may write one number or a list.
        pairs: Whether it holds a tuple of pairs along x and y, for which users may write one pair.
    """

    name: str
    several: bool = False
    pairs: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of a number; those that are None are none.

    Args:
        gt: What it exceeds.
        ge: Its least value.
        lt: What it is less than.
        le: Its largest value.
    """

    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None

    def problem(self, value: float) -> str:
        """Return what is wrong with a number, in pydantic's words; empty for nothing."""
        if isinstance(value, float) and not math.isfinite(value):
            return "must be a finite number"
        tests = (
            (self.gt is None or value > self.gt, f"greater than {self.gt}"),
            (self.ge is None or value >= self.ge, f"greater than or equal to {self.ge}"),
            (self.lt is None or value < self.lt, f"less than {self.lt}"),
            (self.le is None or value <= self.le, f"less than or equal to {self.le}"),
        )
        return next((f"must be {words}" for kept, words in tests if not kept), "")


Positive = Limits(gt=0)
Length = Annotated[float, Unit("mm")]
PositiveLength = Annotated[float, Unit("mm"), Positive]
Pressure = Annotated[float, Unit("MPa")]
PositivePressure = Annotated[float, Unit("MPa"), Positive]
Slope = Annotated[float, Unit("")]
Count = Annotated[int, Limits(ge=1, le=1_000_000_000)]
Tag = str | Annotated[int, Limits(ge=0)]
"""Physical name or number of a face in a mesh."""
Heights = Annotated[int, Limits(ge=4, le=1_000_000_000)]
"""Number of heights along a side; fewer than four have no cubic interpolant."""


def part_of(record: Any, base: type) -> dict[str, Any]:
    """Return the fields that a record has from one of its bases, as arguments of that base.

    Args:
        record: The record.
        base: The base, a dataclass.
    """
    return {field.name: getattr(record, field.name) for field in fields(base)}


def changed_fields(record: Any) -> list[str]:
    """Return the names of a record's fields whose values are not their defaults.

    Args:
        record: The record.
    """
    names = []
    for one in fields(record):
        default = one.default if one.default_factory is MISSING else one.default_factory()
        if getattr(record, one.name) != default:
            names.append(one.name)
    return names


def key_of(field: Field[Any]) -> str | None:
    """Return the name of a record's field in scene files; None where it is no key of theirs.

    Args:
        field: The field of a dataclass.
    """
    key: str | None = field.metadata.get(KEY, field.name)
    return key
