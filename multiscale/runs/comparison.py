"""Compares all sensible ways to compute a scene: a sweep over them; the best is the measure.

With R the run that is compared against and k the load steps that both have, errors are

* of force, approach and contact area, relative to their largest in R over these steps,

      max_k |X_k − R_k| / max_k |R_k|,    and signed at R's last step,    (X − R) / R;

* of the mean separation likewise, but relative to R's at the same step, as it falls under load;
* of the patch pressures at R's last step, on the patches of a common grid, the L1 distance

      Σ_i |p_i − r_i| / Σ_i r_i;

* of their distribution there, the Wasserstein distance of p / <p> and r / <r>, which is the area
  between the two distribution functions: blind to where pressures are and to the force.

Errors at R's last step are unknown (NaN) for a run that stopped before it. The uncertainty of R
itself is defined by the same formulas.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from patchlaw.geometry.patches import PatchGrid, interval_overlaps
from patchlaw.multiscale.results.history import History
from patchlaw.multiscale.runs import AGAINST
from patchlaw.multiscale.runs.cases import CaseResult, Journal, run_case, run_cases
from patchlaw.multiscale.runs.configurations import (
    Configuration,
    Grid,
    configurations,
    pressure_grid,
)
from patchlaw.multiscale.runs.resolving import resolve
from patchlaw.multiscale.runs.scene_run import Run
from patchlaw.multiscale.scene.memory import MemoryLacking
from patchlaw.multiscale.scene.parts import block_section
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support import Array, Comm, check_fields, checked, on_root
from patchlaw.support.errors import InputError, NotConverged, PatchlawError
from patchlaw.support.readable import Displayed, Table, column, of_columns, times, unobserved

Curves: TypeAlias = Mapping[str, Array]
"""The load steps of a run, see `multiscale.runs.comparison`; empty of one without any."""

RESPONSES = ("force", "approach", "area", "separation")
ERRORS = (
    *(f"{name}_{where}" for name in RESPONSES for where in ("max", "last")),
    "pressure_l1",
    "distribution",
)
"""Errors of a run against another: of force, approach, contact area and mean separation the largest
over the curve, and the signed one at the last step; the two of the patch pressures there."""

ZERO = 1e-9
"""A force or an area below this share of the largest counts as zero: nothing is relative to it."""

_UNKNOWN = float("nan")
NO_ERRORS: Mapping[str, float] = dict.fromkeys(ERRORS, _UNKNOWN)


@dataclass(frozen=True, kw_only=True)
class Row(Configuration):
    """A configuration with its result and errors: a row of ``compare.csv``.

    Attributes:
        result: What it came to.
        is_measure: Whether the others are compared against it.
        errors: `ERRORS` against the measure, NaN where unknown; of the measure its uncertainty.
    """

    result: CaseResult
    is_measure: bool = False
    errors: Mapping[str, float] = field(default_factory=lambda: NO_ERRORS)

    @property
    def status(self) -> str:
        """How the run ended."""
        return self.result.status

    @property
    def curves(self) -> Curves:
        """The accepted load steps."""
        return self.result.arrays

    @property
    def steps(self) -> int:
        """Number of accepted load steps."""
        return len(self.curves.get("force", ()))

    @property
    def seconds(self) -> float:
        """Wall time of the run [s]; NaN where it did not begin."""
        return float(self.result.measured.get("seconds", _UNKNOWN))

    @property
    def finite_slopes(self) -> bool:
        """Whether it accounts for finite slopes."""
        return bool(self.result.measured.get("finite_slopes"))

    def last(self, name: str) -> float:
        """Return a value at the last accepted load step; NaN without any.

        Args:
            name: Name of one of the curves.
        """
        return float(self.curves[name][-1]) if self.steps else _UNKNOWN

    def record(self) -> dict[str, Any]:
        """Return the row by column: plain values, None where unknown.

        Values such as ``force_N`` are those of the last accepted load step.
        """
        scene = self.scene
        cells = None if self.scene.meshes_roughness else block_section(scene).cells
        record = {
            "name": self.name,
            "kind": self.kind,
            "model": self.model,
            "heights": times(self.heights, "x"),
            "patches": times(scene.patches.grid, "x"),
            "cells": times(cells or (), "x"),
            "status": self.status,
            "finite_slopes": self.finite_slopes,
            "is_measure": self.is_measure,
            "unknowns": self.result.measured.get("unknowns"),
            "seconds": self.seconds,
            "steps": self.steps,
            "approach_mm": self.last("approach"),
            "force_N": self.last("force"),
            "contact_area_fraction": self.last("area"),
            "mean_separation_mm": self.last("separation"),
            **{f"error_{name}": value for name, value in self.errors.items()},
            "message": self.result.failure,
        }
        return {name: None if value != value else value for name, value in record.items()}


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
            error: One of `ERRORS`; by default the largest of the response over the curve.

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
            error: One of `ERRORS`; by default the largest of the response over the curve.
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
    observe: Callable[[Configuration, CaseResult], object] | None = None,
    begun: Callable[[Configuration], object] | None = None,
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
        begun: Called on its rank with every configuration before it is run.

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
        return resolved, [one for one in ways if meshed or not one.scene.meshes_roughness]

    scene, ways = on_root(comm, chosen)

    def solve(one: Configuration, progress: Callable[[], None]) -> CaseResult:
        (begun or unobserved)(one)
        return solved(one, progress)

    results = run_cases(ways, solve, Journal(folder, {}), comm, observe=observe)
    rows = [Row(name=one.name, scene=one.scene, result=results[n]) for n, one in enumerate(ways)]
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
            "finite_slopes": run.coupling.scene.meshes_roughness
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
    by_approach, grid = scene.loading.outline.quantity == "approach", pressure_grid(scene)
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
    measure = best[chosen][0]
    pairs = [(coarse.curves, fine.curves) for coarse, fine in refinements(best[chosen])]
    own = uncertainty(measure.curves, pairs, grid)
    with_errors = (
        replace(
            row,
            errors=own if row is measure else error_measures(row.curves, measure.curves, grid),
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

    These are the number of meshes, the edges of the finest in a contact, finite slopes, cells.
    """
    section, is_meshed = row.scene.reference, row.scene.meshes_roughness
    meshes, edges = is_meshed * section.meshes, is_meshed * (section.fine or 0.0)
    return meshes, -edges, row.finite_slopes, math.prod(row.cells)


def refinements(best_first: Sequence[Row]) -> Iterator[tuple[Row, Row]]:
    """Yield, for edges and for cells, the finest pair of rows that differ by nothing else.

    Numbers of meshes are no refinement: the finest of the meshes is the same.

    Args:
        best_first: Finished rows of one kind, the best first.

    Yields:
        The coarser and the finer one.
    """
    for refined in (1, 3):  # places of edges and cells in `_fineness`
        for fine, coarse in combinations(best_first, 2):
            pairs = enumerate(zip(_fineness(fine), _fineness(coarse), strict=True))
            if [place for place, (one, other) in pairs if one != other] == [refined]:
                yield coarse, fine
                break


def error_measures(run: Curves, against: Curves, grid: Grid) -> dict[str, float]:
    """Return the `ERRORS` of a run against another, relative; NaN where unknown.

    Args:
        run: The run.
        against: The run that it is compared against.
        grid: Numbers of patches on which pressures are compared.
    """
    errors = dict(NO_ERRORS)
    common = min(len(run.get("force", ())), len(against["force"]))
    if not common:
        return errors
    whole, last = common == against["force"].size, common - 1
    for name in RESPONSES:
        mine, right = run[name][:common], against[name]
        scale = np.abs(right[:common])
        if name != "separation":
            scale[:] = scale.max()
        errors[f"{name}_max"] = _largest(mine - right[:common], scale)
        if whole:
            floor = ZERO * float(np.abs(right).max())
            errors[f"{name}_last"] = _ratio(mine[last] - right[last], right[last], floor)
    if whole:
        p, r = (
            on_grid(one["patch_pressure"][last], one["patches"], grid) for one in (run, against)
        )
        errors["pressure_l1"] = _ratio(float(np.abs(p - r).sum()), float(r.sum()))
        errors["distribution"] = _distribution_distance(p, r)
    return errors


def uncertainty(
    against: Curves, pairs: Sequence[tuple[Curves, Curves]], grid: Grid
) -> dict[str, float]:
    """Return the uncertainty of the run that others are compared against; no value is negative.

    Force, approach and area take the run's own error bars where it has them. All else is the sum of
    the distances between runs that differ by one refinement each. If a refinement at least halves
    the error, the error of the finer run is no larger than this distance.

    Args:
        against: The run.
        pairs: A coarser and a finer run for each refinement; without any, nothing is known.
        grid: Numbers of patches on which pressures are compared.
    """
    distances = [error_measures(*pair, grid) for pair in pairs] or [dict(NO_ERRORS)]
    total = {name: float(sum(abs(one[name]) for one in distances)) for name in ERRORS}
    for name in ("force", "approach", "area"):
        value, error = against[name], against[f"{name}_error"]
        known = np.isfinite(error)  # An error bar is unknown before meshes find the first contact.
        if known[-1]:
            top = float(np.abs(value).max())
            total[f"{name}_max"] = _largest(error[known], np.full(np.count_nonzero(known), top))
            total[f"{name}_last"] = _ratio(error[-1], value[-1], ZERO * top)
    return total


def on_grid(pressure: Array, patches: Sequence[int] | Array, grid: Grid) -> Array:
    """Return patch pressures on other patches of the same rectangle; the force is conserved.

    Pressures are uniform on the patches they are given on, and averaged over the new ones.

    Args:
        pressure: Mean pressures, shape (N,) [MPa].
        patches: Numbers of their patches along x and y.
        grid: Numbers of the new ones.

    Returns:
        Mean pressures, one for each new patch [MPa].
    """
    counts = [(int(new), int(old)) for new, old in zip(grid, patches, strict=True)]
    x, y = (
        new * interval_overlaps(np.linspace(0.0, 1.0, new + 1), np.linspace(0.0, 1.0, old + 1))
        for new, old in counts
    )
    return np.asarray((x @ pressure.reshape([old for _, old in counts]) @ y.T).ravel())


def _distribution_distance(pressure: Array, right: Array) -> float:
    """Return the Wasserstein distance of p / <p> and r / <r> over equal numbers of patches.

    Of two samples of the same size it is the mean distance of their sorted values (Villani 2009,
    doi 10.1007/978-3-540-71050-9, remark 2.19). NaN when either carries no load.
    """
    means = float(pressure.mean()), float(right.mean())
    if min(means) <= 0.0:
        return _UNKNOWN
    return float(np.abs(np.sort(pressure) / means[0] - np.sort(right) / means[1]).mean())


def _largest(error: Array, scale: Array) -> float:
    """Return the largest |error| / scale of those with a scale; NaN when there is none."""
    usable = scale > 0.0
    return float(np.max(np.abs(error[usable]) / scale[usable])) if usable.any() else _UNKNOWN


def _ratio(error: float, right: float, floor: float = 0.0) -> float:
    """Return error / right; NaN when |right| is not above a floor."""
    return float(error / right) if abs(right) > floor else _UNKNOWN
