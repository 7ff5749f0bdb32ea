"""Turns the outcomes of levels into a comparison: which is the best, and how far the others lie."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from geometry.patches import PatchGrid
from multiscale.causes import Best, Causes, causes
from multiscale.comparison import Comparison, Row
from multiscale.level_results import LevelResult
from multiscale.levels import Level, pressure_grid
from multiscale.measures import Curves, Measures, measures, uncertainty
from multiscale.scene import Scene

Against = Literal["reference", "concurrent", "half-space"]

AGAINST: tuple[Against, ...] = ("reference", "concurrent", "half-space")
"""What levels can be compared against, the best first."""

_KINDS = {"reference": "reference", "concurrent": "concurrent", "half-space": "analytic"}
_IDLE = 0.7  # of the wall time: less work than that tells of a busy machine
_PHASES = {"laws": "seconds_laws", "load steps": "seconds_steps"}


@dataclass(frozen=True)
class Outcome:
    """A level and how it ended."""

    level: Level
    result: LevelResult

    @property
    def done(self) -> bool:
        """Whether the whole load was run."""
        return self.result.status == "done" and self.result.curves is not None

    @property
    def curves(self) -> Curves:
        """What was found; only where something was."""
        assert self.result.curves is not None
        return self.result.curves


def compared(
    scene: Scene, outcomes: Sequence[Outcome], against: Against | None = None
) -> Comparison:
    """Compare levels with the best of them.

    Args:
        scene: The scene.
        outcomes: Its levels.
        against: What to compare against; where that was not reached, or by default, the best is.
    """
    ranked = {one: _ranked(outcomes, one) for one in AGAINST}
    reached = [one for one in AGAINST if ranked[one]]
    chosen = against if against in reached else next(iter(reached), None)
    warnings: list[str] = []
    if against is not None and chosen != against:
        instead = f"compared against the {chosen} instead" if chosen else "nothing to compare with"
        warnings.append(f"no level of kind {against} was reached: {instead}")
    warnings += _busy(outcomes)
    programme = scene.loading.programme
    found = [one for one in outcomes if one.result.curves is not None]
    common: dict[str, Any] = {
        "scene": scene.name,
        "quantity": programme.quantity,
        "steps": len(programme.targets),
        "grid": _grid(scene, found),
        "curves": {one.level.name: one.curves for one in found},
    }
    if chosen is None:
        rows = tuple(_row(one) for one in outcomes)
        return Comparison(rows=rows, warnings=tuple(warnings), **common)
    best = ranked[chosen][0]
    pairs = [(coarse.curves, fine.curves) for coarse, fine in _refinements(ranked[chosen])]
    own = uncertainty(best.curves, pairs, common["grid"])
    if not math.isfinite(getattr(own, f"{_response(scene)}_max")):
        warnings.append(f"{best.level.name} has no error bar of its own: it is taken as exact")
    split = _Split(scene, outcomes, ranked, chosen)
    rows = tuple(
        _row(
            one,
            is_measure=one is best,
            errors=own if one is best else _errors(one, best, common["grid"]),
            causes=split.causes(one),
        )
        for one in outcomes
    )
    return Comparison(
        rows=rows,
        measure=best.level.name,
        against=chosen,
        uncertainty=own,
        warnings=tuple(warnings),
        **common,
    )


def _busy(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield a warning when levels had to wait for processors."""
    results = [one.result for one in outcomes if one.result.seconds]
    wall = sum(one.level.ranks * sum(one.result.seconds.values()) for one in outcomes)
    worked = sum(result.cpu_s for result in results)
    if worked < _IDLE * wall:
        yield (
            f"the levels worked {worked:.3g} s in {wall:.3g} s of their processes' wall time: the "
            "machine was busy with something else, and times are too long"
        )


def _ranked(outcomes: Sequence[Outcome], against: Against) -> list[Outcome]:
    """Return the finished levels of a kind that could be compared against, the best first.

    One mesh alone has no error bar, and is no reference.
    """
    kind = _KINDS[against]
    fitting = [
        one
        for one in outcomes
        if one.done and one.level.kind == kind and one.level.model in ("", "half-space")
    ]
    ranked = sorted(fitting, key=_fineness, reverse=True)
    if against == "reference" and ranked and _fineness(ranked[0])[0] < 2:
        return []
    return ranked


def _fineness(one: Outcome) -> tuple[float, ...]:
    """Return what makes a level better than another of its kind.

    These are the number of meshes, the edges of the finest in a contact, elements and heights.
    """
    content = one.level.content
    cells, reference = content["block"].get("cells", (1,)), content["reference"]
    own = one.level.kind == "reference"
    return (
        reference["meshes"] if own else 0,
        -reference.get("fine", 0.0) if own else 0.0,
        math.prod(cells),
        math.prod(one.level.heights),
    )


def _refinements(ranked: Sequence[Outcome]) -> Iterator[tuple[Outcome, Outcome]]:
    """Yield, for each thing that can be refined, the finest pair that differs by nothing else.

    Numbers of meshes are none of these things: the finest of them is the same.
    """
    for which in range(1, 4):
        groups: dict[tuple[float, ...], list[Outcome]] = {}
        for one in ranked:  # the best first, in groups too
            others = tuple(value for k, value in enumerate(_fineness(one)) if k != which)
            groups.setdefault(others, []).append(one)
        pairs = [group for group in groups.values() if len(group) > 1]
        if pairs:
            yield pairs[0][1], pairs[0][0]


def _grid(scene: Scene, found: Sequence[Outcome]) -> PatchGrid:
    """Return the scene's patches, made at least four along each side."""
    lengths = found[0].curves.patches.lengths if found else (1.0, 1.0)
    return PatchGrid(grid=pressure_grid(scene), lengths=lengths)


def _errors(one: Outcome, best: Outcome, grid: PatchGrid) -> Measures:
    if one.result.curves is None:
        return Measures()
    return measures(one.curves, best.curves, grid)


def _response(scene: Scene) -> str:
    return "force" if scene.loading.programme.quantity == "approach" else "approach"


class _Split:
    """Splits errors by causes, at the last load step of the level that is compared against."""

    def __init__(
        self,
        scene: Scene,
        outcomes: Sequence[Outcome],
        ranked: dict[Against, list[Outcome]],
        against: Against,
    ) -> None:
        self._response = _response(scene)
        self._steps = len(ranked[against][0].curves)
        self._goal = against
        tops = {one: self._value(found[0]) if found else None for one, found in ranked.items()}
        slopes = [one.result.finite_slopes for one in outcomes]
        told = [one for one in slopes if one is not None and self._response == "force"]
        self._best = Best(
            half_space=tops["half-space"],
            block=tops["concurrent"],
            rough=tops["reference"],
            slopes=told[0] if told else None,
        )
        self._against = tops[against]
        self._alone = {
            _micro(one.level): self._value(one) for one in outcomes if one.level.kind == "analytic"
        }

    def causes(self, one: Outcome) -> Causes:
        """Return the causes of a level's error, where it came to the last step."""
        value = self._value(one)
        if value is None or not self._against:
            return Causes()
        return causes(
            value,
            one.level.kind,
            against=self._against,
            against_kind=_KINDS[self._goal],
            best=self._best,
            twin=self._alone.get(_micro(one.level)),
            cells=one.level.model == "half-space",
        )

    def _value(self, one: Outcome) -> float | None:
        """Return force or approach at the last step."""
        if one.result.curves is None or len(one.curves) < self._steps:
            return None
        return float(getattr(one.curves, self._response)[self._steps - 1])


def _micro(level: Level) -> tuple[Any, ...]:
    """Return what tells a micro model and its surface from others."""
    return level.heights, *sorted(level.content["micro"].items())


def _row(one: Outcome, **found: Any) -> Row:
    level, result = one.level, one.result
    curves = result.curves
    if curves is not None:
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
