"""Turns the outcome of a level into a row of the comparison."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from multiscale.comparing.comparison import Row
from multiscale.comparing.outcomes import Outcome

_PHASES = {"laws": "seconds_laws", "load steps": "seconds_steps"}


def row_of(one: Outcome, **found: Any) -> Row:
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
        cells=_text(level.content["block"].get("cells", ())) if level.kind != "analytic" else "",
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


def _times(seconds: dict[str, float]) -> dict[str, float]:
    """Sum phases of a run; what is neither laws nor load steps is set-up."""
    told = {"seconds": sum(seconds.values()), "seconds_setup": 0.0}
    for phase, spent in seconds.items():
        name = _PHASES.get(phase, "seconds_setup")
        told[name] = told.get(name, 0.0) + spent
    return told


def _text(counts: Sequence[int]) -> str:
    return "x".join(map(str, counts))
