"""Compares all sensible ways to compute a scene: error against wall time."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from geometry.errors import InputError
from geometry.patches import PatchGrid
from multiscale.comparison.catalogue import configurations
from multiscale.comparison.comparison import Comparison, Row
from multiscale.comparison.configuration import Configuration, pressure_grid
from multiscale.comparison.error_breakdown import error_breakdowns
from multiscale.comparison.error_measures import ErrorMeasures, error_measures, uncertainty
from multiscale.comparison.launching import Launch, check_launchable, run_all
from multiscale.comparison.run_result import RunResult
from multiscale.planning.auto_keys import auto_keys, provisional, resolved_sections, with_resolved
from multiscale.planning.problem_setup import make_setup
from multiscale.scene.scene import Scene
from multiscale.storage import write_json

AGAINST = {"reference": "reference", "concurrent": "concurrent", "half-space": "analytic"}
"""Coupling of each kind of measure; the best kind is the first."""

AUTO_VALUES = "auto_values.json"
"""File of the values that were chosen for the scene's keys that are ``auto``."""

BUSY = 0.7
"""A machine is called busy when the processes worked less than this share of their wall time."""


def compare(
    scene: Scene,
    comm: Any = None,
    *,
    against: str | None = None,
    budget_s: float | None = None,
    folder: Path | None = None,
    ranks: int = 1,
    launch: Launch | None = None,
    begin: Callable[[Configuration], None] | None = None,
    observe: Callable[[RunResult, bool], None] | None = None,
) -> Comparison:
    """Run a scene in every sensible configuration, each in a process of its own.

    The values for keys that are ``auto`` are the same in all configurations.

    Args:
        scene: The scene.
        comm: MPI communicator; processes cannot be launched from an MPI job of several processes.
        against: Kind of the measure that configurations are compared against. By default the best
            that is reached, of an explicit reference, the concurrent coupling and the half-space.
        budget_s: Wall time for all configurations that are run now [s]; one that exceeds the rest
            is ended. None for any.
        folder: Folder where results are stored, so that the next call goes on from them; None
            stores nothing.
        ranks: Number of processes of configurations that can use more than one, under ``mpirun``.
        launch: Runs one configuration; by default `launching.launch_process`.
        begin: Called with every configuration that is about to be run.
        observe: Called with every result, and whether it is from an earlier call.

    Returns:
        The comparison, with a row for every configuration, run or not.

    Raises:
        InputError: When the scene, an argument or the MPI job does not allow it.
    """
    if against is not None and against not in AGAINST:
        allowed = ", ".join(AGAINST)
        raise InputError("is nothing to compare against", value=against, allowed=allowed)
    if budget_s is not None and not budget_s > 0.0:
        raise InputError("is no budget", value=budget_s, allowed="more than 0 s")
    if launch is None or comm is not None:
        check_launchable(ranks, comm)
    results = []
    with tempfile.TemporaryDirectory(prefix="patchlaw-compare-") as temporary:
        place = Path(temporary) if folder is None else folder
        scene = resolved_scene(scene, place)
        found = run_all(
            configurations(scene, ranks), place, budget_s=budget_s, launch=launch, begin=begin
        )
        for result, stored in found:
            if observe is not None:
                observe(result, stored)
            results.append(result)
    return compared(scene, results, against)


def resolved_scene(scene: Scene, folder: Path) -> Scene:
    """Return a scene with values for all keys that are ``auto``, but for the micro model.

    The values are stored. Another call might measure other times on a busy machine, and then
    choose, for example, other patches.

    Args:
        scene: The scene.
        folder: Folder of the results.
    """
    auto = auto_keys(scene)
    if auto <= {"micro.model"}:
        return scene
    path, given = folder / AUTO_VALUES, scene.model_dump(by_alias=True, mode="json")
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        values = stored["sections"] if stored["scene"] == given else None
    except (OSError, ValueError, KeyError, TypeError):
        values = None
    if values is None:
        values = resolved_sections(make_setup(scene), scene)
        write_json(path, {"scene": given, "sections": values})
    return provisional(with_resolved(scene, values), auto & {"micro.model"})


def compared(scene: Scene, results: Sequence[RunResult], against: str | None = None) -> Comparison:
    """Compare results with the best of them.

    Args:
        scene: The scene.
        results: The results of its configurations.
        against: Kind of the measure; the best kind where it was not reached, or by default.
    """
    best = {kind: ranked(results, kind) for kind in AGAINST}
    reached = [kind for kind in AGAINST if best[kind]]
    chosen = against if against in reached else next(iter(reached), None)
    load_history = scene.loading.load_history
    curves = {one.configuration.name: one.curves for one in results if one.curves is not None}
    lengths = next((one.patches.lengths for one in curves.values()), (1.0, 1.0))
    grid = PatchGrid(grid=pressure_grid(scene), lengths=lengths)
    warnings = list(_warnings(results, against, chosen))
    common: dict[str, Any] = {
        "scene": scene.name,
        "quantity": load_history.quantity,
        "steps": load_history.count,
        "grid": grid,
        "curves": curves,
    }
    if chosen is None:
        return Comparison(rows=tuple(map(_row, results)), warnings=tuple(warnings), **common)
    measure = best[chosen][0]
    name, right = measure.configuration.name, curves[measure.configuration.name]
    pairs = [(curves[coarse], curves[fine]) for coarse, fine in refinements(best[chosen])]
    own = uncertainty(right, pairs, grid)
    response = "force" if load_history.quantity == "approach" else "approach"
    tops = {AGAINST[kind]: best[kind][0] for kind in reached}
    shares = error_breakdowns(results, tops, measure, response)
    if not math.isfinite(getattr(own, f"{response}_max")):
        warnings.append(f"{name} has no error bar of its own: it is taken as exact")
    rows = []
    for one in results:
        errors = own if one is measure else ErrorMeasures()
        if one is not measure and one.curves is not None:
            errors = error_measures(one.curves, right, grid)
        rows.append(_row(one, is_measure=one is measure, errors=errors, shares=shares(one)))
    return Comparison(
        rows=tuple(rows),
        measure=name,
        against=chosen,
        uncertainty=own,
        warnings=tuple(warnings),
        **common,
    )


def ranked(results: Sequence[RunResult], against: str) -> list[RunResult]:
    """Return the finished results that could be the measure, the best first.

    One mesh alone has no error bar, and is no measure.

    Args:
        results: All results.
        against: Kind of the measure.
    """

    def fits(one: Configuration) -> bool:
        models = ("", "half-space")
        return one.kind == AGAINST[against] and one.model in models and one.scale == 1.0

    fitting = [one for one in results if one.done and fits(one.configuration)]
    found = sorted(fitting, key=_fineness, reverse=True)
    return [] if against == "reference" and found and _fineness(found[0])[0] < 2 else found


def _fineness(result: RunResult) -> tuple[float, ...]:
    """Return what makes a result better than another of its kind: the first that differs.

    These are the number of meshes, the edges of the finest in a contact, finite slopes, heights.
    """
    one = result.configuration
    reference = one.content["reference"] if one.kind == "reference" else {}
    return (
        reference.get("meshes", 0),
        -reference.get("fine", 0.0),
        result.finite_slopes,
        math.prod(one.heights),
    )


def refinements(best_first: Sequence[RunResult]) -> Iterator[tuple[str, str]]:
    """Yield, for edges and for heights, the finest pair of results that differ by nothing else.

    Numbers of meshes are no refinement: the finest of the meshes is the same.

    Args:
        best_first: Finished results of one kind, the best first.

    Yields:
        Names of the coarser and the finer configuration.
    """
    for refined in (1, 3):
        groups: dict[tuple[float, ...], list[str]] = {}
        for one in best_first:
            others = tuple(value for k, value in enumerate(_fineness(one)) if k != refined)
            groups.setdefault(others, []).append(one.configuration.name)
        pairs = [group for group in groups.values() if len(group) > 1]
        if pairs:
            yield pairs[0][1], pairs[0][0]


def _warnings(
    results: Sequence[RunResult], against: str | None, chosen: str | None
) -> Iterator[str]:
    if against is not None and chosen != against:
        instead = f"compared against the {chosen} instead" if chosen else "nothing to compare with"
        yield f"no configuration of kind {against} was reached: {instead}"
    timed = [one for one in results if one.seconds]
    wall = sum(one.configuration.ranks * sum(one.seconds.values()) for one in timed)
    cpu = sum(one.cpu_s for one in timed)
    if cpu < BUSY * wall:
        yield (
            f"the processes worked {cpu:.3g} s in {wall:.3g} s of their wall time: the machine was "
            "busy with something else, and times are too long"
        )


def _row(result: RunResult, **columns: Any) -> Row:
    """Return the row of a result; the columns are those that the comparison adds."""
    one, curves = result.configuration, result.curves
    if curves is not None:
        columns |= {
            "steps": len(curves),
            "approach_mm": float(curves.approach[-1]),
            "force_N": float(curves.force[-1]),
            "contact_area_fraction": float(curves.area[-1]),
            "mean_separation_mm": float(curves.separation[-1]),
        }
    if seconds := dict(result.seconds):
        columns["seconds"] = sum(seconds.values())
        columns["seconds_laws"] = seconds.pop("laws", math.nan)
        columns["seconds_steps"] = seconds.pop("load steps", math.nan)
        columns["seconds_setup"] = sum(seconds.values())
    meshed = "reference" if one.kind == "reference" else "block"
    has_cells = one.kind == "reference" or one.scene.coupling.on_mesh
    cells = one.content[meshed].get("cells", ()) if has_cells else ()
    return Row(
        name=one.name,
        kind=one.kind,
        model=one.model,
        heights=_text(one.heights),
        patches=_text(one.content["patches"]["grid"]),
        cells=_text(cells),
        finite_slopes=one.kind == "reference" or result.finite_slopes,
        status=result.status,
        unknowns=result.unknowns,
        ranks=one.ranks,
        seconds_start=result.start_s,
        seconds_cpu=result.cpu_s,
        peak_MB=result.peak_MB,
        exit_code=result.exit_code,
        message=result.message,
        **columns,
    )


def _text(counts: Sequence[int]) -> str:
    return "x".join(map(str, counts))
