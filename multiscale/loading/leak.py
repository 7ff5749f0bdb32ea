"""What leaks at one load step, along one way, and the columns of ``history.csv`` on it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from patchlaw.multiscale.loading.column import DerivedColumn

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
            heading = (
                f"{_HEADINGS[part]} {words if way != 'face' else ''}" if part in _HEADINGS else ""
            )
            error = names["error"] if part == "rate" else ""

            def read(step: Any, way: str = way, part: str = part) -> Any:
                leak = step.leak(way)
                return None if leak is None else getattr(leak, part)

            about = meaning.format(words), unit
            shown = {"error": error, "table": "more"}
            if part in _HEADINGS:
                shown["heading"] = heading.strip()
            yield name, DerivedColumn(read, *about, **shown)


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
