"""Newton's method for many asperities, its linear systems solved by iteration.

The Jacobian of the normal map (`micro.complementarity.normal_map`) is not made: its products,
distant contacts as point forces, are all that GMRES needs, and each system is solved only as far
as the step pays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, gmres

from geometry.errors import NotConverged
from micro.complementarity.contact_problem import ContactProblem, Solution
from micro.complementarity.normal_map import newton_on_normal_map
from micro.pairs.interaction import Lift
from micro.pairs.split_interaction import SplitLift

Array = NDArray[np.float64]

_MOST_ITERATIONS = 60
_FORCING = 1e-2
_RESTART = 40


def newton_krylov(problem: ContactProblem[Any], start: Array) -> Solution:
    """Solve a contact problem by damped, inexact Newton steps on the normal map.

    Args:
        problem: The contact problem.
        start: First guess of the own indentations, shape (n,) [mm].

    Raises:
        NotConverged: When no step lowers the residual, or the iterations are used up.

    Source:
        Dembo, Eisenstat & Steihaug, SIAM J. Numer. Anal. 19 (1982) 400, doi 10.1137/0719025.
    """
    return newton_on_normal_map(
        problem,
        start,
        step=_inexact_step,
        failure=_failure,
        most=_MOST_ITERATIONS,
    )


def _inexact_step(lift: SplitLift | Lift, error: Array) -> Array:
    """Reduce (I + C) step + error on the active set to a hundredth; the other rows follow."""
    active, step = lift.active, np.zeros_like(error)

    def product(inside: Array) -> Array:
        step[active] = inside
        return inside + lift.product(step)[active]

    target = -error[active]
    if len(active):
        operator = LinearOperator(2 * (len(active),), matvec=product, dtype=np.float64)
        goal = _FORCING * float(np.linalg.norm(target))
        # The absolute tolerance is the one argument whose name no release of scipy changed.
        inside, _ = gmres(operator, target, atol=goal, restart=_RESTART, maxiter=5)
        step[active] = inside
    lifted = lift.product(step)
    return np.where(np.isin(np.arange(len(error)), active), step, -error - lifted)


def _failure(reason: str, iterations: int) -> NotConverged:
    return NotConverged(
        "Newton's method with iterated linear systems",
        reason=reason,
        iterations=iterations,
        remedy="lower load.approach",
    )
