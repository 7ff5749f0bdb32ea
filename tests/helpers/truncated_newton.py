"""The paper's own solver of interacting summits, an independent witness of Newton's method.

It minimises O(t) = ½ Σ_A (w_k − d_k)² over t_A, for a guess A of the set of contacts. The minimum
is 0, so the Gauss–Newton model of O is exact in the limit. Its normal equations are solved by
conjugate gradients, and only to the accuracy that the step needs; `scipy.sparse.linalg.lsqr` is the
stable form of that. Then summits with t_k < 0 leave A and summits with w_k < d_k enter it, until
there are none of either.

Source:
    Waddad et al. 2016, section 1.2.2, eqs. 12–15, doi 10.1016/j.triboint.2015.12.023.
"""

import numpy as np
import scipy

from patchlaw.micro.asperities import hertz_pairs
from patchlaw.micro.asperities.hertz_pairs import TOLERANCE, active_set, damped_step, failure

_WHAT = "the truncated Newton minimisation"
_MOST_MINIMISING, _MOST_SETS = 60, 200  # Newton steps, and sets of contacts that may be tried


def truncated_newton(problem, start):
    """Solve a contact problem by the paper's minimisation over a changing set of contacts.

    All summits that violate a condition change sides together. When their number has not shrunk
    for five rounds only the last of them does, which cannot cycle (set changes
    after Júdice & Pires, Comput. Oper. Res. 21 (1994) 587).
    """
    contacting = start > 0.0 if np.any(start > 0.0) else np.ones(len(start), dtype=bool)
    indentation, spent = np.where(contacting, start, 0.0), 0
    slack = 0.1 * TOLERANCE * problem.scale
    rounds = 5
    fewest, patience = len(start) + 1, rounds
    for _ in range(_MOST_SETS):
        indentation, caused, inner = _minimise(problem, contacting, indentation)
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
    raise failure(_WHAT, "CONTACTING_SET", spent)


def _minimise(problem, contacting, start):
    """Bring w − d to 0 over the set of contacts; a negative t displaces no other summit."""
    rows, goal = np.flatnonzero(contacting), 0.1 * TOLERANCE * problem.scale

    def evaluate(t):
        caused = problem.interaction(t)
        return caused, (t + caused.displacement - problem.interference)[rows]

    t = start
    caused, error = evaluate(t)
    for iteration in range(_MOST_MINIMISING):
        if np.abs(error).max(initial=0.0) <= goal:
            return t, caused, iteration
        step = np.zeros_like(t)
        forcing = min(0.1, float(np.linalg.norm(error)) / problem.scale)
        step[rows] = _gauss_newton_step(caused, rows, error, forcing)
        t, caused, error = damped_step(evaluate, t, step, error)
    raise failure(_WHAT, "MAX_ITERATIONS", _MOST_MINIMISING)


def _gauss_newton_step(caused, rows, error, forcing):
    """Reduce ‖J step + error‖ by conjugate gradients to ``forcing`` times ‖error‖."""
    jacobian = np.eye(len(rows))
    jacobian[:, np.searchsorted(rows, caused.active)] += caused.derivative[rows]
    return scipy.sparse.linalg.lsqr(
        jacobian, -error, atol=0.0, btol=forcing, conlim=0.0, iter_lim=4 * len(rows)
    )[0]


SOLVERS = {"active-set": active_set, "truncated-newton": truncated_newton}


def solve_by(name, monkeypatch):
    """Let one of the two solve for summits, whatever asks for it."""
    monkeypatch.setattr(hertz_pairs, "active_set", SOLVERS[name])
