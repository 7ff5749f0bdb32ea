"""Compares all sensible ways to compute a scene: a sweep over them; the best is the measure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from patchlaw.geometry.patches import PatchGrid
from patchlaw.multiscale.accuracy import resolve
from patchlaw.multiscale.readable import column
from patchlaw.multiscale.results.history import History
from patchlaw.multiscale.scene.memory import MemoryLacking
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene_run import Run
from patchlaw.multiscale.studies import AGAINST
from patchlaw.multiscale.studies.comparison import (
    ERRORS,
    NO_ERRORS,
    ErrorCauses,
    Row,
    error_measures,
    uncertainty,
)
from patchlaw.multiscale.studies.configurations import Configuration, configurations, pressure_grid
from patchlaw.multiscale.studies.running import CaseResult, Journal, run_case, run_cases
from patchlaw.support.arguments import Comm, check_fields, checked
from patchlaw.support.displayed import Displayed, Table, of_columns
from patchlaw.support.errors import InputError, NotConverged, PatchlawError
from patchlaw.support.parallel import on_root


@dataclass(frozen=True, kw_only=True, repr=False)
class Comparison(Displayed):
    """The configurations of a scene against the best of them.

    The best configuration that was reached is the measure: the others are compared against it.

    Attributes:
        scene: Name of the scene.
        rows: One per configuration, roughly the cheap ones first.
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
            error: One of `multiscale.studies.comparison.ERRORS`; by default the largest of the response
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
            error: One of `multiscale.studies.comparison.ERRORS`; by default the largest of the response
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
    folder: str | Path | None = None,
    observe: Callable[[Configuration, CaseResult], None] | None = None,
) -> Comparison:
    """Run a scene in every sensible configuration, as a sweep runs its cases.

    Keys that an accuracy chooses get the same values in all configurations.

    Args:
        scene: The scene.
        comm: MPI communicator, each rank of which runs configurations of its own; None for this
            process alone.
        against: Kind of the measure that configurations are compared against. By default the best
            that is reached, of an explicit reference, the concurrent coupling and the half-space.
            Roughness is meshed only where a reference can be the measure.
        folder: Folder where results are stored, so that the next call goes on from them; None
            stores nothing.
        observe: Called on its rank with every configuration that is done now, and its result.

    Returns:
        The comparison, with a row for every configuration.

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

    def chosen() -> tuple[Scene, list[Configuration]]:
        resolved, meshed = resolve(scene), against in (None, "reference")
        ways = configurations(resolved)
        return resolved, [one for one in ways if meshed or not one.coupling.meshes_roughness]

    scene, ways = on_root(comm, chosen)
    mine = run_cases(ways, solved, Journal(folder, {}), comm, observe=observe)
    held = [mine] if comm is None else comm.allgather(mine)
    results = {number: one for part in held for number, one in part.items()}
    rows = [Row.of(one, results[number]) for number, one in enumerate(ways)]
    return compared(scene, rows, against)


def solved(one: Configuration, progress: Callable[[], None]) -> CaseResult:
    """Run a configuration; return its result, or why there is none.

    Args:
        one: The configuration.
        progress: Called every now and then.
    """
    try:
        return run_case(one.scene, progress=progress, describe=_described)
    except PatchlawError as error:
        ends = {MemoryLacking: "not started", InputError: "refused", NotConverged: "not converged"}
        status = next((end for kind, end in ends.items() if isinstance(error, kind)), "failed")
        return CaseResult(status=status, failure=str(error))


def _described(run: Run, history: History) -> dict[str, Any]:
    """Return the wall time of a run [s], what it had, and its curves over the load steps.

    These are ``approach`` [mm], ``force`` [N], ``area`` fraction, mean ``separation`` [mm], shape
    (steps,); ``patch_pressure``, shape (steps, patches) [MPa]; ``approach_error`` and so on, NaN
    where unknown; ``patches``, their numbers along x and y. An explicit reference gives its values
    at mesh size zero, with their errors. The patch pressures are those of its finest mesh, scaled
    to the force at mesh size zero.
    """
    record, pressure = history.reference, history.patch_pressure_MPa
    assert isinstance(history.patches, PatchGrid)
    curves = {
        "approach": history.approach_mm,
        "force": history.force_N,
        "area": history.contact_area_fraction,
        "separation": history.mean_separation_mm,
        "patches": np.array(history.patches.grid),
    }
    for name in ("approach", "force", "area"):
        estimate = getattr(record, name, None)
        unknown = np.full(len(history), np.nan)
        curves[f"{name}_error"] = unknown if estimate is None else estimate.error
        curves[name] = curves[name] if estimate is None else estimate.value
    if record is not None:
        ratio = np.ones(len(history))
        np.divide(curves["force"], history.force_N, out=ratio, where=history.force_N > 0.0)
        pressure = pressure * ratio[:, None]
    return {
        "measured": {
            "seconds": sum(history.seconds.values()),
            "unknowns": run.coupling.unknowns,
            "finite_slopes": run.coupling.kind.meshes_roughness
            or bool(run.coupling.parts.finite_slopes),
        },
        "arrays": curves | {"patch_pressure": pressure},
    }


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
    instead = f"compared against the {chosen} instead" if chosen else "nothing to compare with"
    missed = (f"no configuration of kind {against} was reached: {instead}",)
    alone = Comparison(
        scene=scene.name,
        rows=tuple(rows),
        response="force" if by_approach else "approach",
        against=chosen,
        warnings=missed * (against not in (None, chosen)),
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
