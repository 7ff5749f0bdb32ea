"""The contact problem of summits that displace each other, and its solution by Newton's method.

A contact with the indentation t_k moves its own summit by t_k. Contact i moves every other summit k
by U_ki(t_i), the interaction displacement. The total displacement is w_k = t_k + Σ_i U_ki(t_i). If
the plane lies d_k below the undisplaced summit k, its interference, the contact conditions are

    w_k ≥ d_k,    t_k ≥ 0,    t_k (w_k − d_k) = 0:

it penetrates no summit, and a summit that is not in contact carries no force.

Newton's method solves the normal map of these conditions. Let z = d − U(z⁺) with z⁺ = max(z, 0).
A positive z_k is the indentation of a contact; a negative one is an open gap. All the conditions
together are the one equation

    G(z) = z + U(z⁺) − d = 0.

Every U_ki starts with the slope 0 at t_i = 0, so G is continuously differentiable. Its Jacobian
I + ∂U/∂t has columns for the active set {z_i > 0} alone.

Theory: docs/theory.md, section 9, eq. 9.1.

Source:
    Waddad et al. 2016, eqs. 10–11 and 23, doi 10.1016/j.triboint.2015.12.023;
    Robinson, Math. Oper. Res. 17 (1992) 691, doi 10.1287/moor.17.3.691 (normal maps).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from patchlaw.support.arrays import Array, Indices
from patchlaw.support.checks import process_memory
from patchlaw.support.errors import InputError, NotConverged

TOLERANCE = 1e-10
"""Largest complementarity error, relative to the largest interference."""

BYTES_PER_PAIR = 48.0
"""Memory for a pair of summits while a problem is solved [B].

With 2,500 asperities, 1,800 of them in contact, 27 B were measured on a half-space and 31 B on a
finite body.
"""

_NEWTON = "Newton's method on the active set"
_MOST_STEPS = 40
"""Newton steps that may be taken; ordinary problems take 4 to 7."""


class InteractionDisplacement(NamedTuple):
    """Displacements of n summits by the m active contacts, except by each contact's own field.

    Attributes:
        active: Indices of the contacts with a positive indentation, shape (m,).
        displacement: Displacements of the summits, shape (n,) [mm].
        derivative: Derivatives of the displacements by the active indentations, shape (n, m).
        overlapping_contacts: Number of ordered pairs (k, i) in which contact i has grown so close
            to summit k that its kernel is continued linearly.
    """

    active: Indices
    displacement: Array
    derivative: Array
    overlapping_contacts: int = 0


Interaction = Callable[[Array], InteractionDisplacement]
"""Returns the displacements by given indentations, shape (n,) [mm]; negative ones count as 0."""


class Solution(NamedTuple):
    """A solved contact problem.

    Attributes:
        indentation: Indentations t ≥ 0, shape (n,) [mm].
        iterations: Linear systems solved on the way.
        residual: Complementarity error relative to the largest interference.
        overlapping_contacts: See `InteractionDisplacement`.
    """

    indentation: Array
    iterations: int
    residual: float
    overlapping_contacts: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SummitProblem:
    """Summits that a rigid plane could touch.

    Args:
        interaction: How the n contacts displace each other's summits.
        interference: Depth d_k of the plane below each undisplaced summit, shape (n,) [mm]; some
            are positive.
    """

    interaction: Interaction
    interference: Array

    @property
    def scale(self) -> float:
        """Largest interference [mm]."""
        return float(self.interference.max())

    def residual(self, indentation: Array, displacement: Array) -> float:
        """Return max |min(t_k, w_k − d_k)| relative to the largest d_k.

        Args:
            indentation: Indentations t, shape (n,) [mm]; negative ones count as 0.
            displacement: The interaction displacements that they cause, shape (n,) [mm].
        """
        own = np.maximum(indentation, 0.0)
        gap = own + displacement - self.interference
        return float(np.abs(np.minimum(own, gap)).max()) / self.scale

    def solution(
        self, indentation: Array, caused: InteractionDisplacement, iterations: int
    ) -> Solution:
        """Return the solution with given indentations.

        Args:
            indentation: The indentations, shape (n,) [mm]; negative ones become 0.
            caused: The interaction displacements that they cause.
            iterations: Linear systems solved on the way.
        """
        own = np.maximum(indentation, 0.0)
        return Solution(
            indentation=own,
            iterations=iterations,
            residual=self.residual(own, caused.displacement),
            overlapping_contacts=caused.overlapping_contacts,
        )


def check_pairs(count: int) -> None:
    """Refuse a number of asperities whose dense matrices do not fit into the memory.

    Args:
        count: Number of asperities that interact.

    Raises:
        InputError: When the matrices need more than the memory of this process.
    """
    needed, available = BYTES_PER_PAIR * count**2, process_memory()
    if needed > available:
        raise InputError(
            f"the interaction of {count} asperities needs {needed / 1e9:.3g} GB of memory"
            f" and {available / 1e9:.3g} GB are there",
            allowed="half-space, circular-independent or elliptic-independent",
            key="micro.model",
        )


def solve(problem: SummitProblem, start: Array) -> Solution:
    """Solve from a start or, where this fails, along a growing interference.

    The interference is then scaled from 0 to 1. The load step is halved after a failure and
    doubled after a success.

    Args:
        problem: The contact problem.
        start: First guess of the indentations, shape (n,) [mm].

    Raises:
        NotConverged: When even small load steps fail.
    """
    try:
        return active_set(problem, start)
    except NotConverged as failure:
        spent = failure.iterations
    load, step, indentation = 0.0, 0.5, np.zeros_like(problem.interference)
    while True:
        trial = min(load + step, 1.0)
        try:
            part = replace(problem, interference=trial * problem.interference)
            solution = active_set(part, indentation)
        except NotConverged as failure:
            spent, step = spent + failure.iterations, 0.5 * step
            if step < 1.0 / 256.0:
                raise NotConverged(
                    f"the contact of {len(indentation)} interacting asperities"
                    f" (largest interference {problem.scale:.4g} mm, reached {load:.1%} of it)",
                    reason=failure.reason,
                    iterations=spent,
                    remedy="lower load.approach, or choose a model without interaction in"
                    " micro.model",
                ) from failure
            continue
        spent += solution.iterations
        if trial == 1.0:
            return solution._replace(iterations=spent)
        load, step, indentation = trial, 2.0 * step, solution.indentation


def active_set(problem: SummitProblem, start: Array) -> Solution:
    """Solve a contact problem by damped Newton steps on its normal map.

    Args:
        problem: The contact problem.
        start: First guess of the indentations, shape (n,) [mm].

    Raises:
        NotConverged: When no step lowers the error, or the iterations are used up.
    """

    def evaluate(z: Array) -> tuple[InteractionDisplacement, Array]:
        caused = problem.interaction(z)
        return caused, z + caused.displacement - problem.interference

    z = start
    caused, error = evaluate(z)
    for iteration in range(_MOST_STEPS):
        if problem.residual(z, caused.displacement) <= TOLERANCE:
            return problem.solution(z, caused, iteration)
        z, caused, error = damped_step(evaluate, z, _newton_step(caused, error), error)
    raise failure(_NEWTON, "MAX_ITERATIONS", _MOST_STEPS)


def _newton_step(caused: InteractionDisplacement, error: Array) -> Array:
    """Solve (I + ∂U/∂t) step = −error; rows outside the active set follow from those in it."""
    active, derivative = caused.active, caused.derivative
    matrix = derivative[active]
    matrix[np.diag_indices(len(active))] += 1.0
    try:
        inside = np.linalg.solve(matrix, -error[active])
    except np.linalg.LinAlgError:
        raise failure(_NEWTON, "SINGULAR_JACOBIAN", 1) from None
    step = -error - derivative @ inside
    step[active] = inside
    return np.asarray(step)


def failure(what: str, reason: str, iterations: int) -> NotConverged:
    """Return the error of an iteration.

    Args:
        what: Which iteration.
        reason: The name of the reason.
        iterations: Iterations spent.
    """
    return NotConverged(what, reason=reason, iterations=iterations, remedy="lower load.approach")


def damped_step(
    evaluate: Callable[[Array], tuple[InteractionDisplacement, Array]],
    point: Array,
    step: Array,
    error: Array,
) -> tuple[Array, InteractionDisplacement, Array]:
    """Return the first of point + step, point + step/2, … whose error is smaller.

    Args:
        evaluate: Takes the indentations; returns the interaction displacements that they cause
            and the error to bring to 0.
        point: Where the step starts, shape (n,).
        step: The full Newton step, shape (n,).
        error: The error at ``point``.

    Returns:
        The new point, its interaction displacements and its error.

    Raises:
        NotConverged: When no step down to 1/1024 lowers the Euclidean norm of the error.
    """
    norm, length = np.linalg.norm(error), 1.0
    while length >= 2.0**-10:
        trial = point + length * step
        caused, left = evaluate(trial)
        if np.linalg.norm(left) <= (1.0 - 1e-4 * length) * norm:
            return trial, caused, left
        length *= 0.5
    raise failure("a damped Newton step", "LINE_SEARCH", 1)
