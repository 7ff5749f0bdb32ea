"""The paper's solver: truncated Newton minimisation over the set of contacts.

For a guess A of the set of contacts it minimises O(t) = ½ Σ_A (w_k − d_k)² over t_A. The minimum
is 0, so the Gauss–Newton model of O is exact in the limit. Its normal equations are solved by
conjugate gradients, and only to the accuracy that the step needs; `scipy.sparse.linalg.lsqr` is
the stable form of that. Then summits with t_k < 0 leave A and summits with w_k < d_k enter it,
until there are none of either.

Theory: docs/theory.md, section 9.
"""

from __future__ import annotations

import numpy as np
import scipy

from micro.asperities.summit_problem import (
    TOLERANCE,
    InteractionDisplacement,
    Solution,
    SummitProblem,
    damped_step,
    failure,
)
from support.arrays import Array, Flags, Indices

_WHAT, _ELSE = "the truncated Newton minimisation", ', or choose solver = "active-set"'


def truncated_newton(
    problem: SummitProblem,
    start: Array,
    *,
    most_iterations: int = 60,
    most_sets: int = 200,
) -> Solution:
    """Solve a contact problem by the paper's minimisation over a changing set of contacts.

    All summits that violate a condition change sides together. When their number has not shrunk
    for five rounds only the last of them does, which cannot cycle.

    Args:
        problem: The contact problem.
        start: First guess of the indentations, shape (n,) [mm].
        most_iterations: Number of Newton steps that a minimisation may take.
        most_sets: Number of sets of contacts that may be tried.

    Raises:
        NotConverged: When a minimisation stalls or no set of contacts meets the conditions.

    Source:
        Waddad et al. 2016, section 1.2.2, eqs. 12–15, doi 10.1016/j.triboint.2015.12.023;
        set changes after Júdice & Pires, Comput. Oper. Res. 21 (1994) 587.
    """
    contacting = start > 0.0 if np.any(start > 0.0) else np.ones(len(start), dtype=bool)
    indentation, spent = np.where(contacting, start, 0.0), 0
    slack = 0.1 * TOLERANCE * problem.scale
    rounds = 5
    fewest, patience = len(start) + 1, rounds
    for _ in range(most_sets):
        indentation, caused, inner = _minimise(problem, contacting, indentation, most_iterations)
        spent += inner
        pulled = contacting & (indentation < 0.0)
        penetrated = ~contacting & (caused.displacement < problem.interference - slack)
        wrong = pulled | penetrated
        count = int(np.count_nonzero(wrong))
        if count == 0:
            return problem.solution(indentation, caused, spent)
        fewest, patience = (count, rounds) if count < fewest else (fewest, patience - 1)
        if patience <= 0:
            wrong[np.flatnonzero(wrong)[:-1]] = False
        contacting = contacting ^ wrong
        indentation = np.where(contacting, indentation, 0.0)
    raise failure(_WHAT, "CONTACTING_SET", spent, _ELSE)


def _minimise(
    problem: SummitProblem, contacting: Flags, start: Array, most_iterations: int
) -> tuple[Array, InteractionDisplacement, int]:
    """Bring w − d to 0 over the set of contacts; a negative t displaces no other summit."""
    rows, goal = np.flatnonzero(contacting), 0.1 * TOLERANCE * problem.scale

    def evaluate(t: Array) -> tuple[InteractionDisplacement, Array]:
        caused = problem.interaction(t)
        return caused, (t + caused.displacement - problem.interference)[rows]

    t = start
    caused, error = evaluate(t)
    for iteration in range(most_iterations):
        if np.abs(error).max(initial=0.0) <= goal:
            return t, caused, iteration
        step = np.zeros_like(t)
        forcing = min(0.1, float(np.linalg.norm(error)) / problem.scale)
        step[rows] = _gauss_newton_step(caused, rows, error, forcing)
        t, caused, error = damped_step(evaluate, t, step, error)
    raise failure(_WHAT, "MAX_ITERATIONS", most_iterations, _ELSE)


def _gauss_newton_step(
    caused: InteractionDisplacement, rows: Indices, error: Array, forcing: float
) -> Array:
    """Reduce ‖J step + error‖ by conjugate gradients to ``forcing`` times ‖error‖."""
    jacobian = np.eye(len(rows))
    jacobian[:, np.searchsorted(rows, caused.active)] += caused.derivative[rows]
    return scipy.sparse.linalg.lsqr(
        jacobian, -error, atol=0.0, btol=forcing, conlim=0.0, iter_lim=4 * len(rows)
    )[0]
