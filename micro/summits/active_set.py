"""Newton's method on the active set: the default solver of the interacting asperity models.

Let z_k be the displacement that summit k still has to make itself, z = d − U(z⁺), U the lift by
the others' contacts. A positive z_k is the own indentation; a negative one means that the others
push the summit off the plane. The equation

    G(z) = z + U(z⁺) − d = 0

is the whole complementarity problem (its normal map). As every U_ki starts with slope 0 at
t_i = 0, G is once continuously differentiable, and Newton's Jacobian I + C has columns only for
the active set {z_i > 0}: the set changes within the iteration, not around it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.pairs.interaction import Lift
from micro.summits.contact_problem import TOLERANCE, ContactProblem, Solution, solution
from micro.summits.line_search import damped_step

Array = NDArray[np.float64]

_MOST_ITERATIONS = 40


def active_set(problem: ContactProblem[Lift], start: Array) -> Solution:
    """Solve a contact problem by damped Newton steps on the normal map.

    Args:
        problem: The contact problem.
        start: First guess of the own indentations, shape (n,) [mm].

    Raises:
        NotConverged: When no step lowers the residual, or the iterations are used up.

    Source:
        Robinson, Math. Oper. Res. 17 (1992) 691, doi 10.1287/moor.17.3.691 (normal maps).
    """

    def evaluate(z: Array) -> tuple[Lift, Array]:
        lift = problem.interaction.lift(z)
        return lift, z + lift.displacement - problem.required

    z = start
    lift, error = evaluate(z)
    for iteration in range(_MOST_ITERATIONS):
        if problem.residual(z, lift) <= TOLERANCE:
            return solution(problem, z, lift, iteration)
        step = _newton_step(lift, error)
        z, lift, error = damped_step(evaluate, z, step, float(np.linalg.norm(error)))
    raise _failure("MAX_ITERATIONS", _MOST_ITERATIONS)


def _newton_step(lift: Lift, error: Array) -> Array:
    """Solve (I + C) step = −error; rows outside the active set follow from those in it."""
    active = lift.active
    matrix = lift.slope[active]
    matrix[np.diag_indices(len(active))] += 1.0
    try:
        inside = np.linalg.solve(matrix, -error[active])
    except np.linalg.LinAlgError:
        raise _failure("SINGULAR_JACOBIAN", 1) from None
    step = -error - lift.slope @ inside
    step[active] = inside
    return step


def _failure(reason: str, iterations: int) -> NotConverged:
    return NotConverged(
        "Newton's method on the active set",
        reason=reason,
        iterations=iterations,
        remedy="lower load.approach",
    )
