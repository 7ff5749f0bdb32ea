"""Turns the outcomes of levels into a comparison: which is the best, and how far the others lie."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from geometry.patches import PatchGrid
from multiscale.comparison.causes import Split
from multiscale.comparison.comparison import Comparison, Row
from multiscale.comparison.level import Level, pressure_grid
from multiscale.comparison.measures import Measures, measures, uncertainty
from multiscale.comparison.outcomes import AGAINST, Against, Outcome, ranked, refinements
from multiscale.scene.scene import Scene

_PHASES = {"laws": "seconds_laws", "load steps": "seconds_steps"}
_IDLE = 0.7  # of the wall time: less work than that tells of a busy machine


def compared(
    scene: Scene, outcomes: Sequence[Outcome], against: Against | None = None
) -> Comparison:
    """Compare levels with the best of them.

    Args:
        scene: The scene.
        outcomes: Its levels.
        against: What to compare against; where that was not reached, or by default, the best is.
    """
    tops = {one: ranked(outcomes, one) for one in AGAINST}
    reached = [one for one in AGAINST if tops[one]]
    chosen = against if against in reached else next(iter(reached), None)
    load_history = scene.loading.load_history
    found = [one for one in outcomes if one.result.curves is not None]
    common: dict[str, Any] = {
        "scene": scene.name,
        "quantity": load_history.quantity,
        "steps": load_history.count,
        "grid": _grid(scene, found),
        "curves": {one.level.name: one.curves for one in found},
    }
    warnings = [*_missed(against, chosen), *_busy(outcomes)]
    if chosen is None:
        rows = tuple(_row_of(one) for one in outcomes)
        return Comparison(rows=rows, warnings=tuple(warnings), **common)
    best = tops[chosen][0]
    pairs = [(coarse.curves, fine.curves) for coarse, fine in refinements(tops[chosen])]
    own = uncertainty(best.curves, pairs, common["grid"])
    split = Split(outcomes, tops, chosen, load_history.quantity)
    if not math.isfinite(getattr(own, f"{split.response}_max")):
        warnings.append(f"{best.level.name} has no error bar of its own: it is taken as exact")
    return Comparison(
        rows=tuple(_rows(outcomes, best, own, split, common["grid"])),
        measure=best.level.name,
        against=chosen,
        uncertainty=own,
        warnings=tuple(warnings),
        **common,
    )


def _rows(
    outcomes: Sequence[Outcome], best: Outcome, own: Measures, split: Split, grid: PatchGrid
) -> Iterator[Row]:
    """Yield the rows, each with its distance from the best level; that one with its own error."""
    for one in outcomes:
        errors = Measures()
        if one is best:
            errors = own
        elif one.result.curves is not None:
            errors = measures(one.curves, best.curves, grid)
        yield _row_of(one, is_measure=one is best, errors=errors, causes=split.causes(one))


def _missed(against: Against | None, chosen: Against | None) -> Iterator[str]:
    """Yield a warning when what was to be compared against was not reached."""
    if against is not None and chosen != against:
        instead = f"compared against the {chosen} instead" if chosen else "nothing to compare with"
        yield f"no level of kind {against} was reached: {instead}"


def _busy(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield a warning when levels had to wait for processors."""
    timed = [one for one in outcomes if one.result.seconds]
    wall = sum(one.level.ranks * sum(one.result.seconds.values()) for one in timed)
    worked = sum(one.result.cpu_s for one in timed)
    if worked < _IDLE * wall:
        yield (
            f"the levels worked {worked:.3g} s in {wall:.3g} s of their processes' wall time: the "
            "machine was busy with something else, and times are too long"
        )


def _grid(scene: Scene, found: Sequence[Outcome]) -> PatchGrid:
    """Return the patches that pressures are compared on."""
    lengths = found[0].curves.patches.lengths if found else (1.0, 1.0)
    return PatchGrid(grid=pressure_grid(scene), lengths=lengths)


def _row_of(one: Outcome, **found: Any) -> Row:
    """Return the row of a level.

    Args:
        one: The level and how it ended.
        **found: What the comparison adds: fields of a `Row`.
    """
    level, result = one.level, one.result
    if result.curves is not None:
        curves = one.curves
        found |= {
            "steps": len(curves),
            "approach_mm": float(curves.approach[-1]),
            "force_N": float(curves.force[-1]),
            "contact_area_fraction": float(curves.area[-1]),
            "mean_separation_mm": float(curves.separation[-1]),
        }
    if result.seconds:
        found |= _times(result.seconds)
    return Row(
        name=level.name,
        kind=level.kind,
        model=level.model,
        heights=_text(level.heights),
        patches=_text(level.content["patches"]["grid"]),
        cells=_text(_cells(level)),
        finite_slopes=level.kind == "reference" or result.finite_slopes,
        status=result.status,
        unknowns=result.unknowns,
        ranks=level.ranks,
        seconds_start=result.start_s,
        seconds_cpu=result.cpu_s,
        peak_MB=result.peak_MB,
        exit_code=result.exit_code,
        message=result.message,
        **found,
    )


def _cells(level: Level) -> Sequence[int]:
    """Return the elements of a level's block, none where it has none, or as many as it needs."""
    if level.kind == "reference":
        return level.content["reference"].get("cells", ())
    return level.content["block"].get("cells", ()) if level.scene.coupling.on_mesh else ()


def _times(seconds: dict[str, float]) -> dict[str, float]:
    """Sum phases of a run; what is neither laws nor load steps is set-up."""
    told = {"seconds": sum(seconds.values()), "seconds_setup": 0.0}
    for phase, spent in seconds.items():
        name = _PHASES.get(phase, "seconds_setup")
        told[name] = told.get(name, 0.0) + spent
    return told


def _text(counts: Sequence[int]) -> str:
    return "x".join(map(str, counts))
