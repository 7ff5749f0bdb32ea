"""Rows of patch laws: their columns are declared here, once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class LawRows:
    """Rows of one patch law, or rows of the laws of N patches at the same load steps.

    Every column has the shape (m,) for one law, or (m, N) for N laws. Its metadata are the unit
    and, where it is another one, the name in law files.

    Attributes:
        approach: Local rigid approach [mm]. Where the plane was free to turn it is the approach at
            the middle of the interface.
        closure: Local rigid approach minus the displacement of the patch in the macro model [mm].
        pressure: Mean pressure of the patch [MPa].
        contact_area_fraction: Real over nominal contact area of the patch.
        contacts: Number of contacts in the patch.
        unresolved_displacement: Mean displacement of the patch in the contact problem, less its
            displacement in the macro model [mm].

    Raises:
        InputError: When the columns have different shapes, or a number is not finite.
    """

    approach: Array = field(metadata={"unit": "mm"})
    closure: Array = field(metadata={"unit": "mm"})
    pressure: Array = field(metadata={"unit": "MPa"})
    contact_area_fraction: Array = field(metadata={"unit": "1"})
    contacts: NDArray[np.int64] = field(metadata={"unit": "1", "kind": np.int64})
    unresolved_displacement: Array = field(metadata={"unit": "mm", "stored": "relief"})

    def __post_init__(self) -> None:
        for name, column in self.columns():
            if column.shape != self.closure.shape:
                raise InputError("a patch law needs columns of one length", value=name)
            if not np.all(np.isfinite(column)):
                raise InputError(f"a patch law needs a finite {name}")

    def __len__(self) -> int:
        return len(self.approach)

    def __getitem__(self, index: Any) -> Self:
        return self.mapped(lambda column: column[index])

    def columns(self) -> list[tuple[str, NDArray[Any]]]:
        """Return the names and values of all columns."""
        return [(one.name, getattr(self, one.name)) for one in fields(self)]

    def mapped(self, function: Callable[[NDArray[Any]], NDArray[Any]]) -> Self:
        """Return rows whose columns are a function of the columns of these."""
        return type(self)(**{name: function(column) for name, column in self.columns()})

    def joined(self, later: Self) -> Self:
        """Return these rows followed by others."""
        columns = zip(self.columns(), later.columns(), strict=True)
        return type(self)(**{name: np.concatenate((a, b)) for (name, a), (_, b) in columns})


@dataclass(frozen=True, kw_only=True, eq=False)
class SolvedRows(LawRows):
    """Rows as a micro model gave them.

    Attributes:
        outside_range: Whether the micro model warned that it is outside its range of validity.
    """

    outside_range: NDArray[np.bool_] = field(metadata={"kind": np.bool_})

    @classmethod
    def none(cls) -> Self:
        """Return the rows of a patch that stays open."""
        return cls(**{one.name: np.zeros(0, one.metadata.get("kind")) for one in fields(cls)})

    @property
    def warning_pressure(self) -> float:
        """Pressure of the first row of one law outside the range [MPa]; infinite without any."""
        return float(np.append(self.pressure[self.outside_range], np.inf)[0])
