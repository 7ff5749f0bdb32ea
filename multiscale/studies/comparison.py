"""Compares all sensible ways to compute a scene: error against wall time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from patchlaw.multiscale.auto.keys import auto_keys, is_measured, resolved_sections, with_resolved
from patchlaw.multiscale.couplings.dispatch import coupling_class
from patchlaw.multiscale.readable import column, duration
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.setup import make_setup
from patchlaw.multiscale.studies import AGAINST
from patchlaw.multiscale.studies.configurations import Configuration, configurations, pressure_grid
from patchlaw.multiscale.studies.errors import (
    ERRORS,
    NO_ERRORS,
    ErrorCauses,
    Row,
    error_measures,
    uncertainty,
)
from patchlaw.multiscale.studies.measured_run import measured_run
from patchlaw.multiscale.studies.running import CaseResult, Journal, run_cases
from patchlaw.support.arguments import Comm, check_fields, checked
from patchlaw.support.collective import on_root, place_in
from patchlaw.support.displayed import Displayed, Table, of_columns
from patchlaw.support.errors import InputError
from patchlaw.support.fields import Positive


@dataclass(frozen=True, kw_only=True, repr=False)
class Comparison(Displayed):
    """The configurations of a scene against the best of them.

    The best configuration that was reached is the measure: the others are compared against it.

    Attributes:
        scene: Name of the scene.
        rows: One per configuration, those of the least predicted cost first.
        response: What the load does not prescribe: ``"force"`` under an approach, and the reverse.
        measure: Name of the measure; None when no configuration can be one.
        against: Kind of the measure, as ``--against`` names it.
        uncertainty: Uncertainty of the measure by error; NaN where unknown.
        warnings: What a reader should know.
    """

    scene: str
    rows: tuple[Row, ...]
    response: str
    measure: str | None = None
    against: str | None = None
    uncertainty: Mapping[str, float] = field(default_factory=lambda: NO_ERRORS)
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, finite=False)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, name: str) -> Row:
        """Return the row of a configuration."""
        return {row.name: row for row in self.rows}[name]

    def records(self) -> list[dict[str, Any]]:
        """Return the rows of ``compare.csv``, each as a dictionary by column."""
        return [row.record() for row in self.rows]

    def error(self, row: Row, error: str | None = None) -> float:
        """Return the size of a row's error, but no less than the uncertainty of the measure.

        Args:
            row: The row.
            error: One of `multiscale.studies.errors.ERRORS`; by default the largest of the response
                over the curve.

        Returns:
            The error; NaN where it is unknown.

        Raises:
            InputError: When there is no such error measure.
        """
        name = error or f"{self.response}_max"
        if name not in ERRORS:
            raise InputError("is no error measure", value=name, allowed=", ".join(ERRORS))
        return float(np.maximum(abs(row.errors[name]), np.nan_to_num(self.uncertainty[name])))

    def frontier(self, error: str | None = None) -> tuple[Row, ...]:
        """Return the rows that no other beats in both time and error, the fastest first.

        Errors below the uncertainty of the measure count as equal to it. Configurations that did
        not come to the end of the load take no part.

        Args:
            error: One of `multiscale.studies.errors.ERRORS`; by default the largest of the response
                over the curve.
        """
        ended = [row for row in self.rows if row.status == "done"]
        costs = np.array([(row.seconds, self.error(row, error)) for row in ended]).reshape(-1, 2)
        others = costs[:, None]
        is_beaten = ((others >= costs).all(axis=2) & (others > costs).any(axis=2)).any(axis=1)
        best = np.flatnonzero(np.isfinite(costs).all(axis=1) & ~is_beaten)
        return tuple(sorted((ended[index] for index in best), key=lambda row: row.seconds))

    def displayed(self) -> tuple[str, Table]:
        """Return what was compared in a line, and a table of the configurations."""
        errors = [self.error(row) if self.measure else math.nan for row in self.rows]
        table = of_columns(
            ["configuration", *(row.name for row in self.rows)],
            column("time", (row.seconds for row in self.rows), "s", 3),
            column(f"error of the {self.response}", errors, "%", 3),
            ["status", *("measure" if row.is_measure else row.status for row in self.rows)],
        )
        against = f", against {self.measure}" if self.measure else ""
        return f"Comparison of {len(self)} configurations of {self.scene}{against}", table


@checked
def compare(
    scene: Scene,
    comm: Comm | None = None,
    *,
    against: str | None = None,
    budget_s: Annotated[float, Positive] | None = None,
    folder: str | Path | None = None,
    solve: Callable[[Configuration, Any, float], CaseResult] = measured_run,
    begin: Callable[[Configuration], None] = lambda one: None,
    observe: Callable[[Configuration, CaseResult], None] | None = None,
) -> Comparison:
    """Run a scene in every sensible configuration, one after another.

    Keys that are ``auto`` get the same values in all configurations. With a budget, configurations
    that are predicted to take more time than it leaves are left out, and the finest reference with
    an error bar that leaves time for the others is run first.

    Args:
        scene: The scene.
        comm: MPI communicator, all ranks of which run every configuration together; None for this
            process alone.
        against: Kind of the measure that configurations are compared against. By default the best
            that is reached, of an explicit reference, the concurrent coupling and the half-space.
        budget_s: Wall time of this call [s]; a configuration that exceeds what is left of it is
            ended. None for any.
        folder: Folder where results are stored, so that the next call goes on from them; None
            stores nothing.
        solve: Runs a configuration on a communicator for so many seconds at most.
        begin: Called with every configuration that is about to be run.
        observe: Called with every configuration that this call has run, and its result.

    Returns:
        The comparison, with a row for every configuration, run or not.

    Raises:
        InputError: When the scene or an argument does not allow it, or what is stored is damaged.

    Note:
        Collective.
    """
    if against is not None and against not in AGAINST:
        allowed = ", ".join(AGAINST)
        raise InputError(
            "is nothing to compare against", key="against", value=against, allowed=allowed
        )
    if any(one and one.heights is not None for one in (scene.surface, scene.counter_surface)):
        allowed = "surface.file: save them, as by numpy.save"
        raise InputError("are not compared in memory", key="surface.heights", allowed=allowed)
    if scene.body is not None:
        raise InputError("is a mesh, and a comparison makes its own", key="body", allowed="[block]")
    end = math.inf if budget_s is None else time.monotonic() + budget_s

    def run(one: Configuration) -> CaseResult:
        left = on_root(comm, lambda: end - time.monotonic())
        if math.isfinite(one.cost) and one.cost > left:
            rest = duration(left) if left > 0.0 else "nothing"
            why = f"it is predicted to take {duration(one.cost)}, and the budget leaves {rest}"
            return CaseResult(status="not started", failure=why)
        begin(one)
        return solve(one, comm, (0.8 if one is first else 1.0) * left)

    def chosen() -> tuple[Scene, list[Configuration]]:
        resolved = resolved_scene(scene)
        return resolved, configurations(resolved, place_in(comm)[1])

    scene, ways = on_root(comm, chosen)
    first = reference_within(ways, budget_s) if against in (None, "reference") else None
    cases, journal = sorted(ways, key=lambda one: one is not first), Journal(folder, {})
    results = run_cases(
        cases, lambda one, _: run(one), journal, comm, one_by_one=True, observe=observe
    )
    rows = [Row.of(one, results[number]) for number, one in enumerate(cases)]
    return compared(scene, sorted(rows, key=lambda row: row.cost), against)


def resolved_scene(scene: Scene) -> Scene:
    """Return a scene with values for all keys that are ``auto``."""
    sized = not (coupling_class(scene).meshes_roughness and is_measured(scene))
    if auto_keys(scene) <= {"micro.model"} and sized:
        return scene
    return with_resolved(scene, resolved_sections(make_setup(scene), scene))


def reference_within(ways: Sequence[Configuration], budget_s: float | None) -> Configuration | None:
    """Return the finest reference with an error bar that leaves time of a budget for others.

    Args:
        ways: The configurations.
        budget_s: Wall time for all of them [s]; None for any.

    Returns:
        The reference; None where there is no budget, or none within it.
    """
    fitting = [
        one
        for one in ways
        if one.coupling.meshes_roughness
        and one.scene.reference.meshes > 1
        and one.cost <= 0.6 * (budget_s or 0.0)  # predicted; it is ended at 0.8
    ]
    return max(fitting, key=lambda one: one.cost, default=None)


def compared(scene: Scene, rows: Sequence[Row], against: str | None = None) -> Comparison:
    """Compare rows with the best of them.

    Args:
        scene: The scene.
        rows: Its configurations with their results, without errors.
        against: Kind of the measure; the best kind where it was not reached, or by default.
    """
    best = {kind: ranked(rows, kind) for kind in AGAINST}
    reached = [kind for kind in AGAINST if best[kind]]
    chosen = against if against in reached else next(iter(reached), None)
    by_approach, grid = scene.loading.quantity == "approach", pressure_grid(scene)
    alone = Comparison(
        scene=scene.name,
        rows=tuple(rows),
        response="force" if by_approach else "approach",
        against=chosen,
        warnings=tuple(_warnings(rows, against, chosen)),
    )
    if chosen is None:
        return alone
    measure, tops = best[chosen][0], {AGAINST[kind]: best[kind][0] for kind in reached}
    pairs = [(coarse.curves, fine.curves) for coarse, fine in refinements(best[chosen])]
    own = uncertainty(measure.curves, pairs, grid)
    causes = ErrorCauses(rows, tops, measure, alone.response)
    with_errors = (
        replace(
            row,
            errors=own if row is measure else error_measures(row.curves, measure.curves, grid),
            shares=causes.shares(row),
            is_measure=row is measure,
        )
        for row in rows
    )
    exact = f"{measure.name} has no error bar of its own: it is taken as exact"
    unknown = not math.isfinite(own[f"{alone.response}_max"])
    warnings = (*alone.warnings, exact) if unknown else alone.warnings
    return replace(
        alone, rows=tuple(with_errors), measure=measure.name, uncertainty=own, warnings=warnings
    )


def _warnings(rows: Sequence[Row], against: str | None, chosen: str | None) -> Iterator[str]:
    if against not in (None, chosen):
        instead = f"compared against the {chosen} instead" if chosen else "nothing to compare with"
        yield f"no configuration of kind {against} was reached: {instead}"
    timed = [row for row in rows if row.phases]
    wall = sum(row.ranks * row.seconds for row in timed)
    cpu = sum(row.result.measured["cpu_s"] for row in timed)
    if cpu < 0.7 * wall:
        yield (
            f"the processes worked {duration(cpu)} in {duration(wall)} of their wall time: the "
            "machine was busy with something else, and times are too long"
        )


def ranked(rows: Sequence[Row], against: str) -> list[Row]:
    """Return the finished rows that could be the measure, the best first.

    One mesh alone has no error bar, and is no measure.

    Args:
        rows: All rows.
        against: Kind of the measure.
    """
    fitting = [
        one
        for one in rows
        if one.kind == AGAINST[against] and one.status == "done" and one.steps
        and one.model in ("", "half-space")
    ]  # fmt: skip
    best_first = sorted(fitting, key=_fineness, reverse=True)
    one_mesh = against == "reference" and best_first and _fineness(best_first[0])[0] < 2
    return [] if one_mesh else best_first


def _fineness(row: Row) -> tuple[float, ...]:
    """Return what makes a row better than another of its kind: the first that differs.

    These are the number of meshes, the edges of the finest in a contact, finite slopes, heights.
    """
    section, is_meshed = row.scene.reference, row.coupling.meshes_roughness
    meshes, edges = is_meshed * section.meshes, is_meshed * (section.fine or 0.0)
    return meshes, -edges, row.finite_slopes, math.prod(row.heights)


def refinements(best_first: Sequence[Row]) -> Iterator[tuple[Row, Row]]:
    """Yield, for edges and for heights, the finest pair of rows that differ by nothing else.

    Numbers of meshes are no refinement: the finest of the meshes is the same.

    Args:
        best_first: Finished rows of one kind, the best first.

    Yields:
        The coarser and the finer one.
    """
    for refined in (1, 3):  # places of edges and heights in `_fineness`
        for fine, coarse in combinations(best_first, 2):
            pairs = enumerate(zip(_fineness(fine), _fineness(coarse), strict=True))
            if [place for place, (one, other) in pairs if one != other] == [refined]:
                yield coarse, fine
                break
