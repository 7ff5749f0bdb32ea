"""Splits the error of a configuration by its causes, as far as the other results allow.

All configurations have the same heights. Between a configuration X and the measure A lie at most
three models that are the best of their kind: the finest half-space (H), the finest concurrent
coupling (C), which is the same on the block, and the best explicit reference (R). Differences
between them add up, so that

    X − A  =  (X − best of X's kind)  +  steps between the best, H → C → R, up to A.

The first term is by neglected slopes, by the micro model, by the laws and by the discretisation;
H − C is by the half-space in place of the finite block; C − R is by finite slopes that are
accounted for in the first order only, and by the discretisation of both. All terms are taken at the
last load step and relative to A, of the force, or of the approach where the force is prescribed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from multiscale.comparison.catalogue import LOW_HEIGHTS, SMALL_SLOPES
from multiscale.comparison.configuration import Configuration
from multiscale.comparison.run_result import RunResult

BEST_MODEL = {"analytic": "analytic", "reference": "reference"}
"""Coupling of the best model of a coupling's kind; of all others it is ``concurrent``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorBreakdown:
    """Signed shares of an error; those that are known add up to it. None where unknown.

    Attributes:
        micro: By the micro model, as on the half-space.
        coupling: By what the coupling neglects; on a mesh, by its elements too.
        block: By the half-space in place of the finite block.
        slopes: By neglected slopes, from the same configuration with and without them. Where a
            reference with low heights was reached, also by slopes in the first order only.
        discretisation: By grids and meshes, and everything that could not be separated.
    """

    micro: float | None = None
    coupling: float | None = None
    block: float | None = None
    slopes: float | None = None
    discretisation: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """Force, or approach, of a configuration at the last load step.

    Attributes:
        value: The force or approach.
        slope_effect: Relative change of it by finite slopes as the configuration accounts for
            them; 0 where it neglects them.
    """

    value: float
    slope_effect: float = 0.0

    def with_slope_effect(self, effect: float) -> float:
        """Return the value that the configuration would have with another effect of slopes.

        A value that slopes reduce to nothing stays: the value without them is unknown.
        """
        if self.slope_effect <= -1.0:
            return self.value
        return self.value * (1.0 + effect) / (1.0 + self.slope_effect)


def error_breakdown(
    response: Response,
    kind: str,
    *,
    measure: str,
    best: Mapping[str, Response],
    slope_effect: float | None,
    alone: Response | None,
    is_half_space: bool,
) -> ErrorBreakdown:
    """Split the error of one configuration.

    Args:
        response: The response of the configuration.
        kind: Its coupling.
        measure: Coupling of the measure.
        best: The best responses of ``analytic``, ``concurrent`` and ``reference``, without those
            that were not reached.
        slope_effect: Effect of slopes in the first order; None when unknown.
        alone: The response of the configuration's micro model alone, on the same grid.
        is_half_space: Whether this micro model is the half-space, which errs by its grid only.
    """
    model, right = BEST_MODEL.get(kind, "concurrent"), best[measure]

    def difference(left: Response | None, other: Response | None) -> float | None:
        """Return a relative difference between responses with the same effect of slopes."""
        if left is None or other is None:
            return None
        effect = slope_effect or 0.0
        return (left.with_slope_effect(effect) - other.with_slope_effect(effect)) / right.value

    micro = 0.0 if model == "reference" else difference(alone, best.get("analytic"))
    coupling = difference(response, best.get(model))
    if kind not in ("isolated", "consistent"):
        coupling = 0.0
    elif coupling is not None:
        coupling = None if micro is None else coupling - micro
    slopes: float | None = None
    if (model == "analytic") == (measure == "analytic"):
        block: float | None = 0.0
    elif model == "analytic":
        block = difference(best.get("analytic"), best.get("concurrent"))
    else:
        block = difference(best.get("concurrent"), best.get("analytic"))
    if slope_effect is not None:
        slopes = (response.value - response.with_slope_effect(right.slope_effect)) / right.value
    shares = {
        "micro": 0.0 if is_half_space else micro,
        "coupling": coupling,
        "block": block,
        "slopes": slopes,
    }
    known = sum(share for share in shares.values() if share is not None)
    error = (response.value - right.value) / right.value
    return ErrorBreakdown(**shares, discretisation=error - known)


def error_breakdowns(
    results: Sequence[RunResult], best: Mapping[str, RunResult], measure: RunResult, quantity: str
) -> Callable[[RunResult], ErrorBreakdown]:
    """Return the function that splits the error of a result by causes.

    Args:
        results: All results.
        best: The best result of ``analytic``, ``concurrent`` and ``reference``, where reached.
        measure: The one of them that the others are compared against.
        quantity: Name of the curve that is compared, ``force`` or ``approach``.
    """
    assert measure.curves is not None
    last = len(measure.curves) - 1

    def value(result: RunResult) -> float | None:
        if result.curves is None or len(result.curves) <= last:
            return None
        return float(getattr(result.curves, quantity)[last])

    def slope_effects(ending: str) -> Iterator[float]:
        """Yield the effects of slopes by pairs of results; of the concurrent coupling first."""
        named = {one.configuration.name: one for one in results}
        pairs = [
            (named[name.removesuffix(ending)], small)
            for name, small in named.items()
            if name.endswith(ending) and name.removesuffix(ending) in named
        ]
        for steep, small in sorted(
            pairs, key=lambda pair: pair[0].configuration.kind != "concurrent"
        ):
            values = value(steep), value(small)
            if values[0] and values[1]:
                yield values[0] / values[1] - 1.0

    # An effect that is unknown is taken from the other.
    first_order = next(slope_effects(SMALL_SLOPES), None)
    complete = next(slope_effects(LOW_HEIGHTS), first_order)
    first_order = complete if first_order is None else first_order

    def response(result: RunResult) -> Response | None:
        found = value(result)
        if found is None:
            return None
        rough = result.configuration.kind == "reference"
        effect = complete if rough else first_order if result.finite_slopes else 0.0
        return Response(value=found, slope_effect=effect or 0.0)

    tops = {kind: response(one) for kind, one in best.items()}
    known = {kind: one for kind, one in tops.items() if one is not None}
    alone = {
        _micro_key(one.configuration): response(one)
        for one in results
        if one.configuration.kind == "analytic"
    }
    right = known[measure.configuration.kind]

    def breakdown(result: RunResult) -> ErrorBreakdown:
        found, configuration = response(result), result.configuration
        if found is None or configuration.scale != 1.0 or not right.value:
            return ErrorBreakdown()
        return error_breakdown(
            found,
            configuration.kind,
            measure=measure.configuration.kind,
            best=known,
            slope_effect=first_order,
            alone=alone.get(_micro_key(configuration)),
            is_half_space=configuration.model == "half-space",
        )

    return breakdown


def _micro_key(configuration: Configuration) -> tuple[Any, ...]:
    """Return what distinguishes a micro model and its surface from others."""
    return configuration.heights, *sorted(configuration.content["micro"].items())
