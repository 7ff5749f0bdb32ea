"""Newton's method on the active set: the default solver of the interacting asperity models.

The Jacobian of the normal map (`micro.complementarity.normal_map`) is made on the active set, and
its linear system factorised.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.complementarity.contact_problem import ContactProblem, Solution
from micro.complementarity.normal_map import newton_on_normal_map
from micro.pairs.interaction import Lift

Array = NDArray[np.float64]

_MOST_ITERATIONS = 40


def active_set(problem: ContactProblem[Lift], start: Array) -> Solution:
    """Solve a contact problem by damped Newton steps on the normal map.

    Args:
        problem: The contact problem.
        start: First guess of the own indentations, shape (n,) [mm].

    Raises:
        NotConverged: When no step lowers the residual, or the iterations are used up.
    """
    return newton_on_normal_map(
        problem, start, step=_newton_step, failure=_failure, most=_MOST_ITERATIONS
    )


def _newton_step(lift: Lift, error: Array) -> Array:
    """Solve (I + C) step = −error; rows outside the active set follow from those in it."""
    active, derivative = lift.active, lift.derivative
    matrix = derivative[active]
    matrix[np.diag_indices(len(active))] += 1.0
    try:
        inside = np.linalg.solve(matrix, -error[active])
    except np.linalg.LinAlgError:
        raise _failure("SINGULAR_JACOBIAN", 1) from None
    step = -error - derivative @ inside
    step[active] = inside
    return step


def _failure(reason: str, iterations: int) -> NotConverged:
    return NotConverged(
        "Newton's method on the active set",
        reason=reason,
        iterations=iterations,
        remedy="lower load.approach",
    )
