"""Finite slopes in a contact problem: their displacements follow from the solution before.

They are a few per cent of all, and change by a hundredth of that in the second solution. The
solutions need not be more accurate than the next change: the first ones stop early.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.compliance.elastic_grid import ElasticGrids
from micro.contact.anderson import Anderson
from micro.contact.problem import Pressures
from micro.contact.rigid_motions import Motions

Array = NDArray[np.float64]
Solve = Callable[[Array, Motions | None, Pressures | None, float], Pressures]
"""From the displacement asked for, free motions, a start and a tolerance to a solution."""

_MOST_LAGS = 30
_FIRST = 1e-2
"""Residual of the first solution, before finite slopes are known."""
_AHEAD = 2e-2
"""Residual of a solution, of the last change by finite slopes: what the next change will be."""
_LAG = 3e-9
"""Change by finite slopes that is let be, of the largest displacement."""


def with_slopes(
    solve: Solve,
    grids: ElasticGrids,
    required: Array,
    motions: Motions | None,
    start: Pressures | None,
    tolerance: float,
) -> Pressures:
    """Solve a contact problem until it agrees with the displacements by finite slopes.

    Args:
        solve: Solves it without them.
        grids: The elastic body; without finite slopes one solution is all.
        required: Displacement that the body asks for, shape (nx, ny) [mm].
        motions: Free motions of the body.
        start: A solution nearby.
        tolerance: Largest residual.

    Raises:
        NotConverged: When a solution does not converge, or displacements do not agree.
    """
    if grids.slopes is None:
        return solve(required, motions, start, tolerance)
    known, lag = Anderson(), np.zeros(required.shape)
    if start is not None and start.pressure.any():
        lag = grids.by_slopes(start.pressure)
    rough, iterations, passes = max(tolerance, _FIRST), 0, 0
    last = max(_LAG, 10.0 * tolerance)
    for _ in range(_MOST_LAGS):
        found = start = solve(required - lag, motions, start, rough)
        iterations, passes = iterations + found.iterations, passes + found.passes
        touching = found.pressure > 0.0
        if not touching.any():
            return found
        change = grids.by_slopes(found.pressure) - lag
        nearer = required if motions is None else required + motions.displacement(found.motion)
        left = float(np.abs(change[touching]).max()) / float(nearer[touching].max())
        if left <= last and rough <= tolerance:
            residual = max(found.residual, left)
            return found._replace(residual=residual, iterations=iterations, passes=passes)
        lag = known.next(lag, change)
        ahead = _AHEAD * left
        rough = tolerance if ahead <= last else min(_FIRST, ahead)
    raise NotConverged(
        "the displacements by finite slopes",
        reason=f"they still change by {left:.1e} of the displacement",
        iterations=iterations,
        remedy="set micro.finite_slopes = false, or smooth the surface",
    )
