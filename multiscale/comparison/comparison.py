"""The configurations of a scene against the best of them: error against wall time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np

from geometry.patches import PatchGrid
from multiscale.comparison import AGAINST
from multiscale.comparison.configuration import RunResult
from multiscale.comparison.errors import (
    ErrorBreakdown,
    ErrorCauses,
    ErrorMeasures,
    error_measures,
    uncertainty,
)
from multiscale.comparison.measure import ranked, refinements
from multiscale.comparison.scene_content import pressure_grid
from multiscale.readable import duration
from multiscale.scene.scene import Scene
from support.errors import InputError

BUSY = 0.7
"""A machine is called busy when the processes worked less than this share of their wall time."""


@dataclass(frozen=True, kw_only=True)
class Row(RunResult):
    """The result of a configuration with its errors: a row of ``compare.csv``.

    Attributes:
        is_measure: Whether the others are compared against it.
        errors: Errors against the measure; for the measure itself, its uncertainty.
        shares: Causes of the error at the last load step.
    """

    is_measure: bool = False
    errors: ErrorMeasures = field(default_factory=ErrorMeasures)
    shares: ErrorBreakdown = field(default_factory=ErrorBreakdown)

    def record(self) -> dict[str, Any]:
        """Return the row by column: plain values, None where unknown.

        Times are those of `RunResult`, ``seconds`` without ``seconds_start``; values such as
        ``force_N`` are those of the last accepted load step.
        """
        one, phases = self.configuration, dict(self.phases)
        laws, steps = phases.pop("laws", None), phases.pop("load steps", None)
        cells = one.content["reference" if self.kind == "reference" else "block"].get("cells", ())
        record = {
            "name": self.name,
            "kind": self.kind,
            "model": self.model,
            "heights": _text(one.heights),
            "patches": _text(one.content["patches"]["grid"]),
            "cells": _text(cells),
            "status": self.status,
            "finite_slopes": self.finite_slopes,
            "is_measure": self.is_measure,
            "unknowns": self.unknowns,
            "ranks": one.ranks,
            "seconds": self.seconds,
            "seconds_setup": sum(phases.values()) if self.phases else None,
            "seconds_laws": laws,
            "seconds_steps": steps,
            "seconds_start": self.start_s,
            "seconds_cpu": self.cpu_s,
            "peak_MB": self.peak_MB,
            "steps": self.steps,
            "approach_mm": self.last("approach"),
            "force_N": self.last("force"),
            "contact_area_fraction": self.last("area"),
            "mean_separation_mm": self.last("separation"),
            **{f"error_{name}": value for name, value in asdict(self.errors).items()},
            **{f"share_{name}": value for name, value in asdict(self.shares).items()},
            "exit_code": self.exit_code,
            "message": self.message,
        }
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
    warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, name: str) -> Row:
        """Return the row of a configuration."""
        return {row.name: row for row in self.rows}[name]

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
        name, allowed = error or f"{self.response}_max", [one.name for one in fields(row.errors)]
        if name not in allowed:
            raise InputError("is no error measure", value=name, allowed=", ".join(allowed))
        size, bar = abs(getattr(row.errors, name)), getattr(self.uncertainty, name)
        return float(np.maximum(size, np.nan_to_num(bar)))

    def frontier(self, error: str | None = None) -> tuple[Row, ...]:
        """Return the rows that no other beats in both time and error, the fastest first.

        Errors below the uncertainty of the measure count as equal to it. Configurations that did
        not come to the end of the load take no part.

        Args:
            error: Name of a field of `ErrorMeasures`; by default the largest of the response over
                the curve.
        """
        ended = [row for row in self.rows if row.status == "done"]
        costs = np.array([(row.seconds, self.error(row, error)) for row in ended]).reshape(-1, 2)
        others = costs[:, None]
        is_beaten = ((others >= costs).all(axis=2) & (others > costs).any(axis=2)).any(axis=1)
        best = np.flatnonzero(np.isfinite(costs).all(axis=1) & ~is_beaten)
        return tuple(sorted((ended[index] for index in best), key=lambda row: row.seconds))


def compared(scene: Scene, results: Sequence[RunResult], against: str | None = None) -> Comparison:
    """Compare results with the best of them.

    Args:
        scene: The scene.
        results: The results of its configurations.
        against: Kind of the measure; the best kind where it was not reached, or by default.
    """
    rows = [Row(**vars(one)) for one in results]
    best = {kind: ranked(rows, kind) for kind in AGAINST}
    reached = [kind for kind in AGAINST if best[kind]]
    chosen = against if against in reached else next(iter(reached), None)
    loads = scene.loading
    lengths = next((one.curves.patches.lengths for one in rows if one.steps), (1.0, 1.0))
    found = Comparison(
        scene=scene.name,
        rows=tuple(rows),
        quantity=loads.quantity,
        steps=loads.count,
        grid=PatchGrid(grid=pressure_grid(scene), lengths=lengths),
        against=chosen,
        warnings=tuple(_warnings(rows, against, chosen)),
    )
    if chosen is None:
        return found
    measure, tops = best[chosen][0], {AGAINST[kind]: best[kind][0] for kind in reached}
    pairs = [(coarse.curves, fine.curves) for coarse, fine in refinements(best[chosen])]
    own = uncertainty(measure.curves, pairs, found.grid)
    causes = ErrorCauses(rows, tops, measure, found.response)
    for index, row in enumerate(rows):
        errors = error_measures(row.curves, measure.curves, found.grid)
        rows[index] = replace(row, errors=errors, shares=causes.breakdown(row))
        if row is measure:
            rows[index] = replace(rows[index], errors=own, is_measure=True)
    found = replace(found, rows=tuple(rows), measure=measure.name, uncertainty=own)
    if math.isfinite(getattr(own, f"{found.response}_max")):
        return found
    exact = f"{measure.name} has no error bar of its own: it is taken as exact"
    return replace(found, warnings=(*found.warnings, exact))


def _warnings(rows: Sequence[Row], against: str | None, chosen: str | None) -> Iterator[str]:
    if against not in (None, chosen):
        instead = f"compared against the {chosen} instead" if chosen else "nothing to compare with"
        yield f"no configuration of kind {against} was reached: {instead}"
    timed = [row for row in rows if row.phases]
    wall = sum(row.configuration.ranks * row.seconds for row in timed)
    cpu = sum(row.cpu_s for row in timed)
    if cpu < BUSY * wall:
        yield (
            f"the processes worked {duration(cpu)} in {duration(wall)} of their wall time: the "
            "machine was busy with something else, and times are too long"
        )


def _text(counts: Sequence[int]) -> str:
    return "x".join(map(str, counts))
