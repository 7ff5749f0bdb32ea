"""Chooses the measure: the best result, which the others are compared against."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

from multiscale.comparison import AGAINST
from multiscale.comparison.configuration import RunResult


def ranked(results: Sequence[RunResult], against: str) -> list[RunResult]:
    """Return the finished results that could be the measure, the best first.

    One mesh alone has no error bar, and is no measure.

    Args:
        results: All results.
        against: Kind of the measure.
    """
    ended = [one for one in results if one.kind == AGAINST[against] and one.status == "done"]
    fitting = [
        one
        for one in ended
        if one.steps and one.configuration.scale == 1.0 and one.model in ("", "half-space")
    ]
    found = sorted(fitting, key=_fineness, reverse=True)
    return [] if against == "reference" and found and _fineness(found[0])[0] < 2 else found


def _fineness(result: RunResult) -> tuple[float, ...]:
    """Return what makes a result better than another of its kind: the first that differs.

    These are the number of meshes, the edges of the finest in a contact, finite slopes, heights.
    """
    one = result.configuration
    reference = one.content["reference"] if one.kind == "reference" else {}
    meshes, edges = reference.get("meshes", 0), reference.get("fine", 0.0)
    return meshes, -edges, result.finite_slopes, math.prod(one.heights)


def refinements(best_first: Sequence[RunResult]) -> Iterator[tuple[RunResult, RunResult]]:
    """Yield, for edges and for heights, the finest pair of results that differ by nothing else.

    Numbers of meshes are no refinement: the finest of the meshes is the same.

    Args:
        best_first: Finished results of one kind, the best first.

    Yields:
        The coarser and the finer result.
    """
    for refined in (1, 3):  # places of edges and heights in `_fineness`
        for fine, coarse in combinations(best_first, 2):
            pairs = enumerate(zip(_fineness(fine), _fineness(coarse), strict=True))
            if [place for place, (one, other) in pairs if one != other] == [refined]:
                yield coarse, fine
                break
