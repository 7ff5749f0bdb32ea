"""A scene computed at many levels, time against error, as records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np

from geometry.errors import InputError
from geometry.patches import PatchGrid
from multiscale.comparison.causes import Causes
from multiscale.comparison.measures import Curves, Measures


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One level: a row of ``compare.csv``, where `errors` and `causes` take a column each part.

    Attributes:
        name: What tells the level from the others.
        kind: Its coupling.
        model: Its micro model; empty for an explicit reference.
        heights: Heights of its surface.
        patches: Its patches.
        cells: Elements of its block; empty where it has none, or as many as it needs.
        finite_slopes: Whether it sees that slopes are finite.
        status: How it ended.
        is_measure: Whether the others are compared against it.
        unknowns: Degrees of freedom of a block that was pressed on its mesh.
        ranks: Processes.
        seconds: Wall time [s] without `seconds_start`.
        seconds_setup: Of it, surface, micro model and block.
        seconds_laws: Of it, patch laws.
        seconds_steps: Of it, load steps.
        seconds_start: Wall time of interpreter, imports and compiled forms [s].
        seconds_cpu: Processor time of all ranks together, without that of `seconds_start` [s].
        peak_MB: Largest memory, of all ranks together [MB].
        steps: Load steps accepted.
        approach_mm: Approach at the last of them [mm].
        force_N: Force there [N].
        contact_area_fraction: Contact area there.
        mean_separation_mm: Mean separation there [mm].
        errors: Against the measure; the measure's own row holds its uncertainty.
        causes: Shares of the error at the last step.
        exit_code: That of its process.
        message: The error's text.
    """

    name: str
    kind: str
    model: str
    heights: str
    patches: str
    cells: str
    status: str
    finite_slopes: bool = False
    is_measure: bool = False
    unknowns: int | None = None
    ranks: int = 1
    seconds: float = float("nan")
    seconds_setup: float = float("nan")
    seconds_laws: float = float("nan")
    seconds_steps: float = float("nan")
    seconds_start: float = float("nan")
    seconds_cpu: float = float("nan")
    peak_MB: float = float("nan")
    steps: int = 0
    approach_mm: float = float("nan")
    force_N: float = float("nan")
    contact_area_fraction: float = float("nan")
    mean_separation_mm: float = float("nan")
    errors: Measures = field(default_factory=Measures)
    causes: Causes = field(default_factory=Causes)
    exit_code: int | None = None
    message: str = ""

    def record(self) -> dict[str, Any]:
        """Return the row by column: plain values, None where unknown."""
        told: dict[str, Any] = {}
        for column in fields(self):
            value = getattr(self, column.name)
            if column.name == "errors":
                told |= {f"error_{name}": part for name, part in asdict(value).items()}
            elif column.name == "causes":
                told |= {f"share_{name}": part for name, part in asdict(value).items()}
            else:
                told[column.name] = value
        return {name: None if value != value else value for name, value in told.items()}


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """The levels of a scene against the best of them.

    Attributes:
        scene: Name of the scene.
        rows: One per level, cheapest first by predicted cost.
        quantity: What the load prescribes, ``"approach"`` or ``"force"``.
        steps: Load steps of the programme.
        grid: Patches that pressures are compared on.
        measure: Name of the level that the others are compared against; None when none was
            reached.
        against: What kind of level that is, as ``--against`` names it.
        uncertainty: The measure's own; NaN where unknown.
        curves: What was found, by name of the level.
        warnings: What a reader should know.
    """

    scene: str
    rows: tuple[Row, ...]
    quantity: str
    steps: int
    grid: PatchGrid
    measure: str | None = None
    against: str | None = None
    uncertainty: Measures = field(default_factory=Measures)
    curves: Mapping[str, Curves] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, name: str) -> Row:
        """Return the row of a level."""
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(name)

    @property
    def response(self) -> str:
        """What the load does not prescribe: ``"force"`` under an approach, and the reverse."""
        return "force" if self.quantity == "approach" else "approach"

    def records(self) -> list[dict[str, Any]]:
        """Return the rows of ``compare.csv`` by column, as data frames take them."""
        return [row.record() for row in self.rows]

    def to_dict(self) -> dict[str, list[Any]]:
        """Return the columns of ``compare.csv``, as data frames take them."""
        records = self.records()
        return {name: [record[name] for record in records] for name in records[0]}

    def error(self, row: Row, error: str | None = None) -> float:
        """Return the size of a row's error, but no less than the measure's uncertainty.

        An error that is not known stays so (NaN).

        Args:
            row: The row.
            error: A field of `Measures`; by default the largest of the response over the curve.

        Raises:
            InputError: When there is no such measure.
        """
        name = error or f"{self.response}_max"
        if name not in Measures.__slots__:
            allowed = ", ".join(Measures.__slots__)
            raise InputError("is no error measure", value=name, allowed=allowed)
        size, bar = abs(getattr(row.errors, name)), getattr(self.uncertainty, name)
        return float(max(size, bar)) if np.isfinite((size, bar)).all() else float(size)

    def frontier(self, error: str | None = None) -> tuple[Row, ...]:
        """Return the levels that no other beats in both time and error, fastest first.

        Errors below the measure's uncertainty count as equal: a level within it is as good as the
        measure. Levels that did not come to the end of the load take no part.

        Args:
            error: A field of `Measures`; by default the largest of the response over the curve.
        """
        known = [
            (row.seconds, self.error(row, error), row) for row in self.rows if row.status == "done"
        ]
        finite = [one for one in known if np.isfinite(one[:2]).all()]
        best: list[Row] = []
        least = np.inf
        for seconds, size, row in sorted(finite, key=lambda one: one[:2]):
            if size < least or (best and (seconds, size) == (best[-1].seconds, least)):
                best.append(row)
                least = size
        return tuple(best)
