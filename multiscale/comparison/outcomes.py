"""Levels with how they ended, and which of them is the best of its kind."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from multiscale.comparison.level import Level
from multiscale.comparison.level_results import LevelResult
from multiscale.comparison.measures import Curves

Against = Literal["reference", "concurrent", "half-space"]

AGAINST: tuple[Against, ...] = ("reference", "concurrent", "half-space")
"""What levels can be compared against, the best first."""

KINDS = {"reference": "reference", "concurrent": "concurrent", "half-space": "analytic"}
"""The coupling that goes by each of these names."""


@dataclass(frozen=True)
class Outcome:
    """A level and how it ended.

    Attributes:
        level: The level.
        result: How it ended.
    """

    level: Level
    result: LevelResult

    @property
    def done(self) -> bool:
        """Whether the whole load was run."""
        return self.result.status == "done" and self.result.curves is not None

    @property
    def curves(self) -> Curves:
        """What was found, of the scene that is compared; only where something was."""
        assert self.result.curves is not None
        return self.result.curves.divided(self.level.scale)


def ranked(outcomes: Sequence[Outcome], against: Against) -> list[Outcome]:
    """Return the finished levels of a kind that could be compared against, the best first.

    One mesh alone has no error bar, and is no reference.

    Args:
        outcomes: All levels.
        against: The kind.
    """
    kind = KINDS[against]
    fitting = [
        one
        for one in outcomes
        if one.done
        and one.level.kind == kind
        and one.level.model in ("", "half-space")
        and one.level.scale == 1.0
    ]
    found = sorted(fitting, key=_fineness, reverse=True)
    if against == "reference" and found and _fineness(found[0])[0] < 2:
        return []
    return found


def _fineness(one: Outcome) -> tuple[float, ...]:
    """Return what makes a level better than another of its kind: the first that differs.

    These are the number of meshes, the edges of the finest in a contact, finite slopes, heights.
    """
    reference = one.level.content["reference"] if one.level.kind == "reference" else {}
    return (
        reference.get("meshes", 0),
        -reference.get("fine", 0.0),
        one.result.finite_slopes,
        math.prod(one.level.heights),
    )


def refinements(best_first: Sequence[Outcome]) -> Iterator[tuple[Outcome, Outcome]]:
    """Yield, for each thing that can be refined, the finest pair that differs by nothing else.

    These are edges and heights. Numbers of meshes are not: the finest of them is the same.

    Args:
        best_first: Finished levels of one kind, the best first.
    """
    for which in (1, 3):
        groups: dict[tuple[float, ...], list[Outcome]] = {}
        for one in best_first:  # in groups too
            others = tuple(value for k, value in enumerate(_fineness(one)) if k != which)
            groups.setdefault(others, []).append(one)
        pairs = [group for group in groups.values() if len(group) > 1]
        if pairs:
            yield pairs[0][1], pairs[0][0]
