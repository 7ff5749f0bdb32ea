"""The paper's solver: truncated Newton minimisation over the contacting set.

For a guess A of the contacting set, minimise O(t) = ½ Σ_A (w_k − d_k)² over t_A. The minimum is 0,
so the Gauss–Newton model of O is exact in the limit; its normal equations are solved by conjugate
gradients only as far as pays (`scipy.sparse.linalg.lsqr`, the stable form of conjugate gradients
on normal equations). Then summits with t_k < 0 leave A and summits with w_k < d_k enter it, until
neither exists.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import lsqr

from geometry.errors import NotConverged
from micro.complementarity.contact_problem import TOLERANCE, ContactProblem, Solution, solution
from micro.complementarity.line_search import damped_step
from micro.pairs.interaction import Lift

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MOST_ITERATIONS = 60
_MOST_SETS = 200
_BLOCK_CHANGES = 5


def truncated_newton(problem: ContactProblem[Lift], start: Array) -> Solution:
    """Solve a contact problem by the paper's minimisation, with its set of contacts updated.

    All summits that violate a condition change sides together; when their number has not shrunk
    for a few rounds, only the last one does, which does not cycle.

    Args:
        problem: The contact problem.
        start: First guess of the own indentations, shape (n,) [mm].

    Raises:
        NotConverged: When the minimisation stalls or the set of contacts does not settle.

    Source:
        Waddad et al. 2016, section 1.2.2, eqs. 12–15, doi 10.1016/j.triboint.2015.12.023;
        set changes after Júdice & Pires, Comput. Oper. Res. 21 (1994) 587.
    """
    contacting = start > 0.0 if np.any(start > 0.0) else np.ones(len(start), dtype=bool)
    indentation, spent = np.where(contacting, start, 0.0), 0
    fewest, patience = len(start) + 1, _BLOCK_CHANGES
    for _ in range(_MOST_SETS):
        indentation, lift, inner = _minimise(problem, contacting, indentation)
        spent += inner
        wrong = _violations(problem, contacting, indentation, lift)
        count = int(np.count_nonzero(wrong))
        if count == 0:
            return solution(problem, indentation, lift, spent)
        fewest, patience = (count, _BLOCK_CHANGES) if count < fewest else (fewest, patience - 1)
        contacting = contacting ^ (wrong if patience > 0 else _last(wrong))
        indentation = np.where(contacting, indentation, 0.0)
    raise _failure("CONTACTING_SET", spent)


def _minimise(
    problem: ContactProblem[Lift], contacting: Mask, start: Array
) -> tuple[Array, Lift, int]:
    """Bring w − d to 0 over the contacting set; a negative t acts on nobody else."""
    rows, goal = np.flatnonzero(contacting), 0.1 * TOLERANCE * problem.scale

    def evaluate(t: Array) -> tuple[Lift, Array]:
        lift = problem.interaction.lift(t)
        return lift, (t + lift.displacement - problem.required)[rows]

    t = start
    lift, error = evaluate(t)
    for iteration in range(_MOST_ITERATIONS):
        if np.abs(error).max(initial=0.0) <= goal:
            return t, lift, iteration
        norm, step = float(np.linalg.norm(error)), np.zeros_like(t)
        step[rows] = _inner_solve(lift, rows, error, forcing=min(0.1, norm / problem.scale))
        t, lift, error = damped_step(evaluate, t, step, norm)
    raise _failure("MAX_ITERATIONS", _MOST_ITERATIONS)


def _inner_solve(lift: Lift, rows: NDArray[np.intp], error: Array, *, forcing: float) -> Array:
    """Reduce ‖J step + error‖ by conjugate gradients to ``forcing`` times ‖error‖."""
    jacobian = np.eye(len(rows))
    jacobian[:, np.searchsorted(rows, lift.active)] += lift.derivative[rows]
    return lsqr(jacobian, -error, atol=0.0, btol=forcing, conlim=0.0, iter_lim=4 * len(rows))[0]


def _violations(problem: ContactProblem[Lift], contacting: Mask, t: Array, lift: Lift) -> Mask:
    slack = 0.1 * TOLERANCE * problem.scale
    pulled = contacting & (t < 0.0)
    penetrated = ~contacting & (lift.displacement < problem.required - slack)
    return pulled | penetrated


def _last(wrong: Mask) -> Mask:
    only = np.zeros_like(wrong)
    only[np.flatnonzero(wrong)[-1]] = True
    return only


def _failure(reason: str, iterations: int) -> NotConverged:
    return NotConverged(
        "the truncated Newton minimisation",
        reason=reason,
        iterations=iterations,
        remedy='lower load.approach, or choose solver = "active-set"',
    )
