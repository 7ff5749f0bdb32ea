"""The comparison of a scene's configurations as records: error against wall time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from geometry.errors import InputError
from geometry.patches import PatchGrid
from multiscale.comparison.error_breakdown import ErrorBreakdown
from multiscale.comparison.error_measures import Curves, ErrorMeasures

_UNKNOWN = float("nan")


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One configuration: a row of ``compare.csv``.

    The attributes are its columns; `errors` and `shares` have a column for each of their parts.

    Attributes:
        name: Unique name of the configuration.
        kind: Its coupling.
        model: Its micro model; empty for an explicit reference.
        heights: Grid of its surface.
        patches: Its patches.
        cells: Elements of its block; empty where it has none, or as many as it needs.
        status: How its run ended.
        finite_slopes: Whether it accounts for finite slopes.
        is_measure: Whether the others are compared against it.
        unknowns: Degrees of freedom of a block that was pressed on its mesh.
        ranks: Number of processes.
        seconds: Wall time [s], without `seconds_start`.
        seconds_setup: Part of it for surface, micro model and block.
        seconds_laws: Part of it for patch laws.
        seconds_steps: Part of it for load steps.
        seconds_start: Wall time of interpreter, imports and compiled forms [s].
        seconds_cpu: Processor time of all ranks together, without that of `seconds_start` [s].
        peak_MB: Largest memory, of all ranks together [MB].
        steps: Number of accepted load steps.
        approach_mm: Approach at the last of them [mm].
        force_N: Force at the last of them [N].
        contact_area_fraction: Contact area fraction at the last of them.
        mean_separation_mm: Mean separation at the last of them [mm].
        errors: Errors against the measure; for the measure itself, its uncertainty.
        shares: Causes of the error at the last load step.
        exit_code: Exit code of its process.
        message: Text of the error.
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
    seconds: float = _UNKNOWN
    seconds_setup: float = _UNKNOWN
    seconds_laws: float = _UNKNOWN
    seconds_steps: float = _UNKNOWN
    seconds_start: float = _UNKNOWN
    seconds_cpu: float = _UNKNOWN
    peak_MB: float = _UNKNOWN
    steps: int = 0
    approach_mm: float = _UNKNOWN
    force_N: float = _UNKNOWN
    contact_area_fraction: float = _UNKNOWN
    mean_separation_mm: float = _UNKNOWN
    errors: ErrorMeasures = field(default_factory=ErrorMeasures)
    shares: ErrorBreakdown = field(default_factory=ErrorBreakdown)
    exit_code: int | None = None
    message: str = ""

    def record(self) -> dict[str, Any]:
        """Return the row by column: plain values, None where unknown."""
        record: dict[str, Any] = {}
        for name, value in asdict(self).items():
            parts = {"errors": "error_{}", "shares": "share_{}"}.get(name)
            record |= {parts.format(key): v for key, v in value.items()} if parts else {name: value}
        return {name: None if value != value else value for name, value in record.items()}


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """The configurations of a scene against the best of them.

    The best configuration that was reached is the measure: the others are compared against it.

    Attributes:
        scene: Name of the scene.
        rows: One per configuration, those of the least predicted cost first.
        quantity: What the load prescribes, ``"approach"`` or ``"force"``.
        steps: Number of load steps of the load history.
        grid: Patches that pressures are compared on.
        measure: Name of the measure; None when no configuration can be one.
        against: Kind of the measure, as ``--against`` names it.
        uncertainty: Uncertainty of the measure; NaN where unknown.
        curves: Results by name of the configuration.
        warnings: What a reader should know.
    """

    scene: str
    rows: tuple[Row, ...]
    quantity: str
    steps: int
    grid: PatchGrid
    measure: str | None = None
    against: str | None = None
    uncertainty: ErrorMeasures = field(default_factory=ErrorMeasures)
    curves: Mapping[str, Curves] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, name: str) -> Row:
        """Return the row of a configuration."""
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(name)

    @property
    def response(self) -> str:
        """What the load does not prescribe: ``"force"`` under an approach, and the reverse."""
        return "force" if self.quantity == "approach" else "approach"

    def records(self) -> list[dict[str, Any]]:
        """Return the rows of ``compare.csv``, each as a dictionary by column."""
        return [row.record() for row in self.rows]

    def to_dict(self) -> dict[str, list[Any]]:
        """Return the columns of ``compare.csv`` by name, as data frames take them."""
        records = self.records()
        return {name: [record[name] for record in records] for name in records[0]}

    def error(self, row: Row, error: str | None = None) -> float:
        """Return the size of a row's error, but no less than the uncertainty of the measure.

        Args:
            row: The row.
            error: Name of a field of `ErrorMeasures`; by default the largest of the response over
                the curve.

        Returns:
            The error; NaN where it is unknown.

        Raises:
            InputError: When there is no such error measure.
        """
        name = error or f"{self.response}_max"
        if name not in ErrorMeasures.__slots__:
            allowed = ", ".join(ErrorMeasures.__slots__)
            raise InputError("is no error measure", value=name, allowed=allowed)
        size, bar = abs(getattr(row.errors, name)), getattr(self.uncertainty, name)
        return float(max(size, bar)) if np.isfinite((size, bar)).all() else float(size)

    def frontier(self, error: str | None = None) -> tuple[Row, ...]:
        """Return the rows that no other beats in both time and error, the fastest first.

        Errors below the uncertainty of the measure count as equal to it. Configurations that did
        not come to the end of the load take no part.

        Args:
            error: Name of a field of `ErrorMeasures`; by default the largest of the response over
                the curve.
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
