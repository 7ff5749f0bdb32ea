"""The contacts of given summits under a rigid plane, and how they resist its motions.

A rigid plane that has approached by δ interferes with every summit by d_k = <δ(x_k) − (z_M − z_k)>.
Without interaction each contact makes this displacement alone, w_k = d_k. With interaction the
displacements by all contacts add up to w_k (`micro.asperities.summit_problem`).

Theory: docs/theory.md, sections 8 and 9.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from micro.asperities.hertz_pairs import HertzPairs
from micro.asperities.summit_problem import (
    BYTES_PER_PAIR,
    Method,
    Solution,
    SummitProblem,
    active_set,
    check_pairs,
    solve,
)
from micro.asperities.truncated_newton import truncated_newton
from support.arrays import Array

SOLVERS: Mapping[str, Method] = MappingProxyType(
    {"active-set": active_set, "truncated-newton": truncated_newton}
)
"""Solvers of the models with interaction, by name."""


def solve_summits(pairs: HertzPairs, interference: Array, start: Array, solver: str) -> Solution:
    """Solve for the summits above the plane.

    These are the undisplaced summits above it, and those that the body raises above it. The
    displacements of all others stay 0. The interaction is summed over all pairs: time and memory
    grow with the square of their number.

    Args:
        pairs: The n asperities.
        interference: Depth of the plane below each undisplaced summit, negative for summits below
            the plane, shape (n,) [mm].
        start: First guess of the indentations, shape (n,) [mm].
        solver: A name in `SOLVERS`.

    Raises:
        InputError: When the interaction of so many summits does not fit into the memory.
        NotConverged: When the contact conditions cannot be met to 1e-10.
    """
    if not pairs.interact:
        alone = np.maximum(interference, 0.0)
        return Solution(alone, alone, 0, 0.0, 0)
    above = np.flatnonzero(interference > 0.0)
    own, displacement, spent = np.zeros_like(interference), np.zeros_like(interference), 0
    if above.size == 0:
        return Solution(own, displacement, 0, 0.0, 0)
    size = BYTES_PER_PAIR * (2.0 if solver == "truncated-newton" else 1.0)
    while True:
        check_pairs(len(above), size)
        problem = SummitProblem(
            interaction=pairs.subset(above).evaluate, interference=interference[above]
        )
        solved = solve(problem, SOLVERS[solver], start[above])
        own[above], displacement[above] = solved.indentation, solved.displacement
        spent += solved.iterations
        if pairs.body is None:
            break
        # Through the half-space contacts only press summits down; a body can raise them.
        raised = interference - pairs.body.displacement(pairs.force(own)) > 0.0
        raised[above] = False
        if not raised.any():
            break
        above, start = np.sort(np.append(above, np.flatnonzero(raised))), own
    return solved._replace(indentation=own, displacement=displacement, iterations=spent)


def plane_stiffness(pairs: HertzPairs, indentation: Array, modes: Array) -> Array:
    """Return the derivative of the loads on a rigid plane by its motions, shape (k, k).

    Args:
        pairs: The n asperities.
        indentation: Indentations of their contacts, shape (n,) [mm].
        modes: Displacements of the summits by unit motions, shape (n, k).
    """
    active = np.flatnonzero(indentation > 0.0)
    touching, t, moved = pairs.subset(active), indentation[active], modes[active]
    rate, own = 1.5 * touching.force(t) / t, moved
    if pairs.interact:
        own = np.linalg.solve(np.eye(len(active)) + touching.evaluate(t).derivative, moved)
    return np.asarray(moved.T @ (rate[:, None] * own))
