"""The columns of ``history.csv`` on the leak: the same for every way that a fluid may flow."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from multiscale.loading.leak import WAYS, Leak
from multiscale.loading.load_step import LoadStep
from multiscale.results.column import Column


@dataclass(eq=False)
class LeakColumn(Column):
    """A column that holds a part of the leak along one way.

    Args:
        way: A key of `multiscale.loading.leak.WAYS`.
        part: Name of the attribute of `Leak`.
    """

    way: str = ""
    part: str = ""

    def of(self, step: LoadStep) -> Any:
        """Return the value of a load step; None where it is not known."""
        leak = step.leak(self.way)
        return None if leak is None else getattr(leak, self.part)

    def error_of(self, step: LoadStep) -> float | None:
        """Return the error of the flow rate, which alone has one."""
        leak = step.leak(self.way)
        return None if leak is None or self.part != "rate" else leak.error


def leak_columns() -> Iterator[LeakColumn]:
    """Yield the columns of all ways, with their names."""
    for way, words in WAYS.items():
        over_face = way == "face"
        ending = "" if over_face else f"_{way}"
        heading = "" if over_face else f" {words}"

        def column(
            name: str, part: str, meaning: str, unit: str = "", shown: str = "", way: str = way
        ) -> LeakColumn:
            made = LeakColumn(meaning, unit, heading=shown, table="more", way=way, part=part)
            made.name = name
            return made

        yield column(
            f"leak{ending}_mm3_per_s", "rate",
            f"Flow rate of the leak {words}, 0 where the gap is closed", "mm³/s", f"leak{heading}",
        )  # fmt: skip
        yield column(f"leak_error{ending}_mm3_per_s", "error", "Error of this flow rate", "mm³/s")
        if over_face:
            continue
        yield column(
            f"transmissivity{ending}_mm3", "transmissivity",
            f"Transmissivity T of the gap {words}", "mm³",
        )  # fmt: skip
        yield column(
            f"hydraulic_gap{ending}_mm", "hydraulic_gap",
            f"Hydraulic gap {words}, T^(1/3)", "mm", f"hydraulic gap{heading}",
        )  # fmt: skip
        yield column(
            f"flow_factor{ending}", "flow_factor",
            f"Flow factor {words}, T over the cube of the mean separation",
            shown=f"flow factor{heading}",
        )  # fmt: skip
        yield column(
            f"constriction{ending}_fraction", "constriction",
            f"Part of the leak {words} through the channel of the narrowest constriction",
            shown=f"narrowest channel{heading}",
        )  # fmt: skip
        yield column(
            f"percolates{ending}", "percolates",
            f"1 where an open path leads {words}, 0 where the gap is closed",
        )  # fmt: skip


def leaks_of(values: Mapping[str, Any]) -> tuple[Leak, ...]:
    """Return the leaks that the columns of a load step hold, without their causes.

    Args:
        values: Values by column; None for what is not known.
    """
    parts: dict[str, dict[str, Any]] = {}
    for column in leak_columns():
        if column.part not in ("hydraulic_gap", "percolates"):
            parts.setdefault(column.way, {})[column.part] = values.get(column.name)
    return tuple(
        Leak(way=way, **known) for way, known in parts.items() if known["rate"] is not None
    )
