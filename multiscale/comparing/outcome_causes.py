"""Splits the errors of all levels of a comparison by their causes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from multiscale.comparing.causes import Best, Causes, causes
from multiscale.comparing.level import Level
from multiscale.comparing.outcomes import KINDS, Against, Outcome


class Split:
    """Splits errors by causes, at the last load step of the level that is compared against.

    Args:
        outcomes: All levels.
        ranked: Those that could be compared against, the best first.
        against: What they are compared against.
        quantity: What the load prescribes.

    Attributes:
        response: What it does not: ``"force"`` or ``"approach"``.
    """

    def __init__(
        self,
        outcomes: Sequence[Outcome],
        ranked: Mapping[Against, list[Outcome]],
        against: Against,
        quantity: str,
    ) -> None:
        self.response = "force" if quantity == "approach" else "approach"
        self._steps = len(ranked[against][0].curves)
        self._goal = against
        tops = {one: self._value(found[0]) if found else None for one, found in ranked.items()}
        told = [*self._measured_slopes(outcomes), *self._estimated_slopes(outcomes)]
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
        if value is None or not self._against or one.level.scale != 1.0:
            return Causes()
        return causes(
            value,
            one.level.kind,
            against=self._against,
            against_kind=KINDS[self._goal],
            best=self._best,
            twin=self._alone.get(_micro(one.level)),
            cells=one.level.model == "half-space",
        )

    def _measured_slopes(self, outcomes: Sequence[Outcome]) -> Iterator[float]:
        """Yield what slopes change by a reference with small ones, on the same mesh."""
        for small in outcomes:
            if small.level.scale == 1.0:
                continue
            same = small.level.name.rpartition(",")[0]
            for steep in outcomes:
                values = self._value(steep), self._value(small)
                if steep.level.name == same and values[0] and values[1]:
                    yield values[0] / values[1] - 1.0

    def _estimated_slopes(self, outcomes: Sequence[Outcome]) -> Iterator[float]:
        """Yield what slopes change to first order, which is known of the force."""
        for one in outcomes:
            if one.result.finite_slopes is not None and self.response == "force":
                yield one.result.finite_slopes

    def _value(self, one: Outcome) -> float | None:
        """Return force or approach at the last step."""
        if one.result.curves is None or len(one.curves) < self._steps:
            return None
        return float(getattr(one.curves, self.response)[self._steps - 1])


def _micro(level: Level) -> tuple[Any, ...]:
    """Return what tells a micro model and its surface from others."""
    return level.heights, *sorted(level.content["micro"].items())
