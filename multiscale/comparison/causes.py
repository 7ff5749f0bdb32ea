"""Splits the error of a level by its causes, as far as the levels at hand allow.

All levels have the same heights. Between a level X and the one A that it is compared with lie at
most three models without any error of their own kind: the best half-space (H), the best concurrent
coupling (C), which is the same on the block, and the best explicit reference (R). Differences
between them add up, so that

    X − A  =  (X − best of X's kind)  +  steps between the best, H → C → R, up to A:

the first by slopes taken as small, the level's own micro model, its laws and its discretisation,
H − C by the half-space in place of the finite block, C − R by slopes in the first order alone, and
by the discretisation of both. All are taken at the last load step and relative to A, of the force,
or of the approach where the force is prescribed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from multiscale.comparison.level import Level
from multiscale.comparison.levels import LOW_HEIGHTS, SMALL_SLOPES
from multiscale.comparison.outcomes import KINDS, Against, Outcome

_PLACES = {"analytic": 0, "isolated": 1, "consistent": 1, "concurrent": 1, "reference": 2}


@dataclass(frozen=True, slots=True, kw_only=True)
class Causes:
    """Shares of a level's error, signed; they add up to it. None where it cannot be told.

    Attributes:
        micro: By the micro model: what it errs on the half-space.
        coupling: By what the coupling leaves out; on the mesh, by its elements too.
        block: By the half-space in place of the finite block.
        slopes: By slopes taken as small, of levels that do: from the same level with and without
            them. Where an explicit reference with heights and load that are ten times smaller, on
            the same mesh, was reached, also by slopes in the first order alone.
        discretisation: By grids and meshes, and all that could not be told apart.
    """

    micro: float | None = None
    coupling: float | None = None
    block: float | None = None
    slopes: float | None = None
    discretisation: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Value:
    """Force, or approach, of a level at the last load step.

    Attributes:
        value: The force or approach.
        slopes: What finite slopes change in it by the level's own account, relative to it without:
            none where it takes them as small.
    """

    value: float
    slopes: float = 0.0

    def seeing(self, slopes: float) -> float:
        """Return the value that the level would have, did it account for slopes so.

        Where slopes take all there is, nothing tells what there was without them.
        """
        if self.slopes <= -1.0:
            return self.value
        return self.value * (1.0 + slopes) / (1.0 + self.slopes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Best:
    """The best levels of each kind at the last load step; None where none was reached.

    Attributes:
        half_space: The finest half-space.
        block: The finest concurrent coupling.
        rough: The best explicit reference.
        slopes: What finite slopes change in the first order; None when unknown.
    """

    half_space: Value | None
    block: Value | None
    rough: Value | None
    slopes: float | None = None

    def at(self, place: int) -> Value | None:
        """Return the best level at a place on the way H, C, R."""
        return (self.half_space, self.block, self.rough)[place]


def causes(
    one: Value, kind: str, *, against: Value, against_kind: str, best: Best, twin: Value | None,
    cells: bool,
) -> Causes:  # fmt: skip
    """Split the error of one level.

    Args:
        one: The level.
        kind: Its coupling.
        against: The level that it is compared with.
        against_kind: The coupling of that one, the best of its kind.
        best: The best levels.
        twin: The level's own micro model alone, on the same grid of heights.
        cells: Whether that micro model is the half-space, which errs by its cells only.
    """
    place, goal, scale = _PLACES[kind], _PLACES[against_kind], against.value
    known, alike = best.slopes is not None, best.slopes or 0.0

    def apart(left: Value | None, right: Value | None) -> float | None:
        """Return a difference between levels that see slopes alike."""
        if left is None or right is None:
            return None
        return (left.seeing(alike) - right.seeing(alike)) / scale

    micro = 0.0 if place == 2 else apart(twin, best.half_space)
    own = apart(one, best.at(place))
    block: float | None = 0.0
    if min(place, goal) == 0 and place != goal:
        block = apart(best.half_space, best.block)
        block = block if block is None or place == 0 else -block
    shares = {
        "micro": 0.0 if cells else micro,
        "coupling": None if own is None or micro is None else own - micro,
        "block": block,
        "slopes": (one.value - one.seeing(against.slopes)) / scale if known else None,
    }
    if kind not in ("isolated", "consistent"):
        shares["coupling"] = 0.0
    told = sum(share for share in shares.values() if share is not None)
    return Causes(**shares, discretisation=(one.value - scale) / scale - told)


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
        self._steps, self._goal = len(ranked[against][0].curves), against
        first = next(self._changes(outcomes, SMALL_SLOPES), None)
        whole = next(self._changes(outcomes, LOW_HEIGHTS), first)
        # what is not known is taken to be what is
        self._first, self._whole = whole if first is None else first, whole
        tops = {one: self._value(found[0]) if found else None for one, found in ranked.items()}
        self._best = Best(
            half_space=tops["half-space"],
            block=tops["concurrent"],
            rough=tops["reference"],
            slopes=self._first,
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
        if not self._against.value:
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

    def _changes(self, outcomes: Sequence[Outcome], ending: str) -> Iterator[float]:
        """Yield what slopes change, by pairs of levels; of the concurrent coupling first."""
        named = {one.level.name: one for one in outcomes}
        pairs = [
            (named[name.removesuffix(ending)], small)
            for name, small in named.items()
            if name.endswith(ending) and name.removesuffix(ending) in named
        ]
        for steep, small in sorted(pairs, key=lambda pair: pair[0].level.kind != "concurrent"):
            values = self._response(steep), self._response(small)
            if values[0] and values[1]:
                yield values[0] / values[1] - 1.0

    def _value(self, one: Outcome) -> Value | None:
        """Return force or approach at the last step, and what slopes are in it."""
        value = self._response(one)
        if value is None:
            return None
        rough = one.level.kind == "reference"
        seen = self._whole if rough else self._first if one.result.finite_slopes else 0.0
        return Value(value=value, slopes=seen or 0.0)

    def _response(self, one: Outcome) -> float | None:
        if one.result.curves is None or len(one.curves) < self._steps:
            return None
        return float(getattr(one.curves, self.response)[self._steps - 1])


def _micro(level: Level) -> tuple[Any, ...]:
    """Return what tells a micro model and its surface from others."""
    return level.heights, *sorted(level.content["micro"].items())
