"""Newton's method on the normal map of asperities in contact, whatever finds its steps.

Let z_k be the displacement that summit k still has to make itself, z = d − U(z⁺), U the lift by
the others' contacts. A positive z_k is the own indentation; a negative one means that the others
push the summit off the plane. The equation

    G(z) = z + U(z⁺) − d = 0

is the whole complementarity problem (its normal map). As every U_ki starts with slope 0 at
t_i = 0, G is once continuously differentiable, and Newton's Jacobian I + C has columns only for
the active set {z_i > 0}: the set changes within the iteration, not around it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.complementarity.contact_problem import (
    TOLERANCE,
    ContactProblem,
    Lifts,
    Solution,
    solution,
)
from micro.complementarity.line_search import damped_step

Array = NDArray[np.float64]


def newton_on_normal_map(
    problem: ContactProblem[Lifts],
    start: Array,
    *,
    step: Callable[[Lifts, Array], Array],
    failure: Callable[[str, int], NotConverged],
    most: int,
) -> Solution:
    """Solve a contact problem by damped Newton steps.

    Args:
        problem: The contact problem.
        start: First guess of the own indentations, shape (n,) [mm].
        step: Takes the lift at a point and its error G; returns Newton's step from there.
        failure: Makes the method's error of a reason and a number of iterations.
        most: Iterations that it may take.

    Raises:
        NotConverged: When no step lowers the residual, or the iterations are used up.

    Source:
        Robinson, Math. Oper. Res. 17 (1992) 691, doi 10.1287/moor.17.3.691 (normal maps).
    """

    def evaluate(z: Array) -> tuple[Lifts, Array]:
        lift = problem.interaction.lift(z)
        return lift, z + lift.displacement - problem.required

    z = start
    lift, error = evaluate(z)
    for iteration in range(most):
        if problem.residual(z, lift) <= TOLERANCE:
            return solution(problem, z, lift, iteration)
        z, lift, error = damped_step(evaluate, z, step(lift, error), float(np.linalg.norm(error)))
    raise failure("MAX_ITERATIONS", most)
